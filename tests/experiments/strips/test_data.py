"""experiments/strips/data.py: points, lengths and breaks of a strip."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.strips.data import BELOW_ZERO, BEYOND_END, strain_regions
from bubblefit.readers.curves import fit_load_polynomial

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
