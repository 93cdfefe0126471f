"""experiments/strips/data.py: points of a gauge's strains, and orders of polynomials compared."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.strips.data import BELOW_ZERO, BEYOND_END, compare_orders, strain_regions
from bubblefit.readers.curves import fit_load_polynomial, read_load_curves, split_at_restarts

from ...builders.strip_tests import BIAS, WARP
from ...support.refusals import complaint


def test_breaks_of_a_broken_line_are_recovered():
    strain = np.linspace(0.0, 0.41, 300)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.05, 0) + 400 * np.maximum(strain - 0.3, 0)
    # The places of the grid are a hundredth apart.
    assert strain_regions(strain, load) == pytest.approx((0.05, 0.3), abs=0.005)
    # 40 places between zero and the last strain: the first and the last may be breaks, too.
    strain = np.linspace(0.0, 0.41, 83)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.01, 0) + 400 * np.maximum(strain - 0.4, 0)
    assert strain_regions(strain, load) == pytest.approx((0.01, 0.40), abs=1e-9)
    strain = np.linspace(0.0, 0.4, 5)
    assert len(strain_regions(strain, strain)) == 2
    for few in (strain[:4], 0 * strain):
        assert f"five points are needed for regions, got {len(few)}" in complaint(
            strain_regions, few, few
        )


def test_points_of_a_strip_and_those_left_out():
    elongation, load = WARP.points
    assert elongation.tolist() == [0.0, 1.0, 1.0, 2.0, 2.0, 4.0]
    assert load.tolist() == [0.0, 100.0, 120.0, 200.0, 240.0, 400.0]
    assert WARP.specimen_of.tolist() == [0, 0, 1, 0, 1, 0] and WARP.unmatched_count == 3
    (file,) = WARP.data_files(by_points=True)
    assert (file.path, file.used_count, file.dropped) == (
        Path("w.csv"),
        4,
        {BELOW_ZERO: 1, BEYOND_END: 1},
    )
    (file,) = WARP.data_files(by_points=False)
    assert (file.used_count, file.dropped) == (6, {})
    # The last point may lie at the end by rounding.
    for shorter, beyond in ((1e-10, 3), (1e-8, 4)):
        just = replace(WARP, final_length=20.0 + 4.0 * (1 - shorter))
        assert (
            just.unmatched_count == beyond
            and just.data_files(True)[0].dropped[BEYOND_END] == beyond - 2
        )
    assert BIAS.points[0].size == BIAS.specimen_of.size == BIAS.unmatched_count == 0


def test_lengths_and_noise_of_a_strip():
    assert WARP.elongation == 4.0 and WARP.end_strain() == pytest.approx(np.log(1.2))
    some = np.array([True, True, True, True, True, False])
    assert WARP.end_strain(some) == WARP.end_strain()
    opened = replace(WARP, open_end=True)
    assert opened.end_strain(some) == pytest.approx(np.log(1.1))
    assert opened.end_strain(None) == pytest.approx(np.log(1.2))
    assert replace(BIAS, open_end=True).end_strain(some) == pytest.approx(np.log(1.2))
    assert WARP.noise(1000.0) == (7.5, "specimens' scatter")
    assert WARP.noise(1000.0, 0.0) == (0.0, "given")
    assert BIAS.noise(1000.0) == (5.0, "assumed")
    assert BIAS.break_shares() is None


def test_breaks_of_a_strip_are_shares_of_its_strain():
    """A load that bends at a quarter and at two thirds of the strain, and one that is cut there."""
    elongation = np.linspace(0, 20, 400)  # so long that no other measure of strain will do
    strain = np.log1p(elongation / 20.0)
    first, second = (np.maximum(strain - strain[-1] * share, 0) for share in (1 / 4, 2 / 3))
    load = 900 * strain - 800 * first + 500 * second
    polynomial = fit_load_polynomial(elongation, load, 12)
    shares = replace(WARP, final_length=40.0, polynomial=polynomial).break_shares()
    assert shares == pytest.approx((0.25, 0.667), abs=0.05)


def test_poissons_ratio_is_that_of_lateral_strains_up_to_the_final_length():
    """The slope, whatever the zero, of each specimen that has lateral strains; their mean."""
    assert WARP.poissons_ratio() is None
    first, second = WARP.curves
    # 20 mm of gauge, 4 mm of elongation; beyond them the strip necks.
    lateral = 0.01 - 0.3 * first.elongation / 20 - 0.5 * (first.elongation > 4)
    ratios = 0.3, 0.4
    curves = replace(first, lateral=lateral), replace(second, lateral=-0.4 * second.elongation / 20)
    assert replace(WARP, curves=curves).poissons_ratio() == pytest.approx(np.mean(ratios))
    assert replace(WARP, curves=(curves[0], second)).poissons_ratio() == pytest.approx(0.3)


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
