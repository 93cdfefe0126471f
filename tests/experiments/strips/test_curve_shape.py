"""experiments/strips/curve_shape.py: orders of polynomials compared."""

import numpy as np
import pytest
from bubblefit.experiments.strips.curve_shape import compare_orders
from bubblefit.readers.curves import fit_load_polynomial, read_load_curves, split_at_restarts

from ...support.refusals import complaint


def test_scores_of_orders_equal_fits_without_the_points():
    random = np.random.default_rng(3)
    u = np.sort(random.uniform(0, 5, 30))
    load = 50 * u + 20 * u**2 + random.normal(0, 5, 30)
    names = np.arange(30) % 3
    for through_origin in (True, False):
        single = compare_orders(u, load, [1, 2, 3], through_origin)
        whole = compare_orders(u, load, [1, 2, 3], through_origin, names.tolist())
        assert [order for order, _, _ in single] == [1, 2, 3]
        for (order, rmse, each), (_, _, by_specimen) in zip(single, whole, strict=True):
            left = load - fit_load_polynomial(u, load, order, through_origin)(u)
            assert rmse == pytest.approx(np.sqrt((left**2).mean()))
            # The shortcut through the hat matrix against really fitting without.
            for groups, found in ((np.arange(30), each), (names, by_specimen)):
                out = load.copy()
                for g in np.unique(groups):
                    kept = groups != g
                    own = fit_load_polynomial(u[kept], load[kept], order, through_origin)
                    out[~kept] -= own(u[~kept])
                assert found == pytest.approx(np.sqrt((out**2).mean()), rel=1e-8)


@pytest.mark.parametrize("through_origin", [True, False])
def test_orders_need_enough_points_to_be_compared(through_origin):
    u = np.arange(1.0, 5.0 if through_origin else 6.0)
    load = np.array([1.0, 5.0, 8.0, 17.0, 26.0])[: len(u)]
    ((_, _, left_out),) = compare_orders(u, load, [2], through_origin)
    assert np.isfinite(left_out)
    said = complaint(compare_orders, u[1:], load[1:], [2], through_origin)
    assert said.startswith("order 2: comparing needs")


@pytest.mark.parametrize(("other", "finite"), [(1.0, True), (0.0, False)])
def test_order_is_not_scored_by_undetermined_specimens(other, finite):
    """Its error is that of a line through the one other point, which may lie at the origin."""
    u, load = np.array([100.0, 100.0, other]), np.array([205.0, 195.0, 3.0])
    ((_, _, left_out),) = compare_orders(u, load, [1], specimens=["a", "a", "b"])
    # Without a: 3 u, off by 95 and 105. Without b: 2 u, off by 1.
    expected = np.sqrt((95.0**2 + 105.0**2 + 1.0) / 3) if finite else np.inf
    assert left_out == pytest.approx(expected)


def test_choice_of_the_thesis_depends_on_the_orders_offered(shared_data):
    for curve in read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv"):
        parts = split_at_restarts(curve)
        names = [part.specimen for part in parts for _ in part.load]
        found = compare_orders(curve.elongation, curve.load, specimens=names)
        _, rmse, left_out = zip(*found, strict=True)
        assert (np.diff(rmse) < 0).all()
        # "The fill and bias directions can be simplified to third order" (section 3.2): even to
        # second in fill, for a specimen that was left out; warp needs more.
        best = {"warp": 6, "fill": 5, "bias": 7}[curve.direction]
        assert int(np.argmin(left_out)) + 1 == best
        if curve.direction == "fill":
            assert left_out[1] < min(left_out[2], left_out[3])
