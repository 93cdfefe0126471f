"""Which order of load polynomial."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.strips.polynomials import compare_orders
from bubblefit.readers.curves import read_load_curves, split_at_restarts
from bubblefit.readers.polynomials import fit_load_polynomial
from hypothesis import given, settings
from hypothesis import strategies as st

from ..complaints import complaint


def test_scores_are_what_they_say():
    random = np.random.default_rng(3)
    u = np.sort(random.uniform(0, 5, 30))
    load = 50 * u + 20 * u**2 + random.normal(0, 5, 30)
    names = np.arange(30) % 3
    for through_origin in (True, False):
        single = compare_orders(u, load, [3, 1, 2], through_origin)
        whole = compare_orders(u, load, [1, 2, 3], through_origin, names.tolist())
        assert [score.order for score in single.scores] == [1, 2, 3]
        for score, by_specimen in zip(single.scores, whole.scores, strict=True):
            order = score.order
            k = order + (not through_origin)
            squares = 30 * score.rmse**2
            about_mean = ((load - load.mean()) ** 2).sum()
            adjusted = 1 - (squares / (30 - k)) / (about_mean / 29)
            assert score.adjusted_r_squared == pytest.approx(adjusted)
            assert score.aic == pytest.approx(30 * np.log(squares / 30) + 2 * (k + 1))
            assert score.bic == pytest.approx(30 * np.log(squares / 30) + np.log(30) * (k + 1))
            # The shortcut through the hat matrix against really fitting without.
            for groups, found in ((np.arange(30), score), (names, by_specimen)):
                out = np.concatenate(
                    [
                        load[groups == g]
                        - fit_load_polynomial(
                            u[groups != g], load[groups != g], order, through_origin
                        )(u[groups == g])
                        for g in np.unique(groups)
                    ]
                )
                assert found.left_out == pytest.approx(np.sqrt((out**2).mean()), rel=1e-8)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), true=st.integers(1, 3), highest=st.integers(4, 8))
def test_lowest_rmse_always_takes_the_highest_order(seed, true, highest):
    random = np.random.default_rng(seed)
    u = np.linspace(0, 5, 60)
    load = u**true + random.normal(0, 1, 60)
    found = compare_orders(u, load, range(1, highest + 1))
    assert found.by_fit == highest
    r_squared = [score.r_squared for score in found.scores]
    assert (np.diff(r_squared) >= -1e-12).all()
    assert found.by_bic <= found.by_aic


def test_rules_that_can_say_no_find_the_order():
    random = np.random.default_rng(11)
    u = np.linspace(0, 5, 200)
    found = compare_orders(u, 100 * u - 30 * u**2 + 5 * u**3 + random.normal(0, 5, 200))
    assert (found.by_fit, found.by_bic) == (8, 3)
    # Nothing left: no logarithm of zero, and the lowest order that does it.
    exact = compare_orders(u, 100 * u, [1, 2])
    assert np.isfinite([score.aic for score in exact.scores]).all()
    assert exact.by_bic == 1


def test_orders_one_to_eight_unless_told():
    u = np.linspace(0, 1, 30)
    found = compare_orders(u, np.sin(u))
    assert [score.order for score in found.scores] == [1, 2, 3, 4, 5, 6, 7, 8]


def test_orders_that_cannot_be_compared():
    u = np.array([1.0, 2.0, 3.0])
    assert "orders: expected at least one" in complaint(compare_orders, u, u**2, [])
    assert "order 2: comparing needs 4 points" in complaint(compare_orders, u, u**2, [2])
    assert "specimens: expected 3 names" in complaint(compare_orders, u, u**2, [1], specimens=["a"])


@pytest.mark.parametrize("through_origin", [True, False])
def test_as_few_points_as_can_be_compared(through_origin: bool):
    """Two more than coefficients; one less is refused (above)."""
    u = np.arange(1.0, 5.0 if through_origin else 6.0)
    load = np.array([1.0, 5.0, 8.0, 17.0, 26.0])[: len(u)]
    (score,) = compare_orders(u, load, [2], through_origin).scores
    assert np.isfinite([score.left_out, score.adjusted_r_squared]).all()
    assert "comparing needs" in complaint(compare_orders, u[1:], load[1:], [2], through_origin)


@pytest.mark.parametrize(("other", "finite"), [(1.0, True), (0.0, False)])
def test_a_specimen_that_the_others_do_not_settle(other: float, finite: bool):
    """Its error is that of a line through the one other point, which may lie at the origin."""
    u, load = np.array([100.0, 100.0, other]), np.array([205.0, 195.0, 3.0])
    (score,) = compare_orders(u, load, [1], specimens=["a", "a", "b"]).scores
    # Without a: 3 u, off by 95 and 105. Without b: 2 u, off by 1.
    expected = np.sqrt((95.0**2 + 105.0**2 + 1.0) / 3) if finite else np.inf
    assert score.left_out == pytest.approx(expected)


def test_the_orders_offered_decide_the_thesis_choice(shared_data):
    for curve in read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv"):
        parts = split_at_restarts(curve)
        names = [part.specimen for part in parts for _ in part.load]
        found = compare_orders(curve.elongation, curve.load, specimens=names)
        assert found.by_fit == 8
        assert compare_orders(curve.elongation, curve.load, range(1, 5)).by_fit == 4
        # "The fill and bias directions can be simplified to third order" (section 3.2): even to
        # second in fill; warp needs more.
        assert found.by_bic == {"warp": 5, "fill": 2, "bias": 3}[curve.direction]
