"""inference/specimen_discrepancy.py: a misfit common to all specimens against their scatter."""

import numpy as np
import pytest
from bubblefit.inference.discrepancy import DISCREPANCY, notes_of_discrepancies
from bubblefit.inference.specimen_discrepancy import specimen_discrepancy
from scipy.stats import ttest_1samp

PLACES = np.linspace(0.1, 3.0, 30)
#: Of a law whose modulus is a constant: the load is proportional.
SLOPES = 100.0 * PLACES[:, None] @ np.array([[1.0, 0.0, 0.0]])


def scattered(count, random):
    """(count, n) N: stiffer by a factor each, uneven over half of the curve, and noise."""
    distance = np.abs(PLACES[:, None] - PLACES)
    root = np.linalg.cholesky(np.exp(-((distance / 1.5) ** 2)) + 1e-6 * np.eye(len(PLACES)))
    factor = 20.0 * PLACES * random.standard_normal((count, 1))
    uneven = 15.0 * random.standard_normal((count, len(PLACES))) @ root.T
    return factor + uneven + random.standard_normal((count, len(PLACES)))


def discrepancy_of(residuals, places=None):
    own = places or [PLACES] * len(residuals)
    return specimen_discrepancy(list(residuals), own, [SLOPES[: len(p)] for p in own], "N")


@pytest.mark.parametrize("specimens", [3, 5, 10])
def test_scatter_between_specimens_is_seldom_a_discrepancy(specimens):
    random, told = np.random.default_rng(specimens), 0
    sets = 400
    for _ in range(sets):
        off = scattered(specimens, random)
        off -= (off @ SLOPES[:, :1] / (SLOPES[:, 0] @ SLOPES[:, 0])).mean() * SLOPES[:, 0]
        one = discrepancy_of(off)
        assert one is not None and one.specimen_count == specimens
        told += one.is_significant
    assert told / sets <= 0.03


def test_f_ratio_of_three_specimens_is_square_of_students_t():
    """Beside the slope there is one shape to be tested, the load at no elongation."""
    off = scattered(3, np.random.default_rng(4))
    one, starts = discrepancy_of(off), [np.polyfit(PLACES, own, 1)[1] for own in off]
    assert one.f_ratio == pytest.approx(ttest_1samp(starts, 0.0).statistic ** 2, rel=1e-9)
    assert one.critical_ratio == pytest.approx(98.50, abs=0.01)


def test_wrong_form_is_a_significant_discrepancy_of_specimens():
    random = np.random.default_rng(8)
    bend = 60.0 * ((PLACES / 1.5 - 1.0) ** 2 - 0.4)
    assert (
        sum([discrepancy_of(bend + scattered(5, random)).is_significant for _ in range(100)]) > 70
    )
    ten = [discrepancy_of(bend + scattered(10, random)) for _ in range(50)]
    assert all(one.is_significant for one in ten)
    # Without what another modulus would follow.
    beside = bend - SLOPES[:, 0] * (bend @ SLOPES[:, 0]) / (SLOPES[:, 0] @ SLOPES[:, 0])
    expected = float(np.sqrt(np.mean(beside**2)))
    assert np.mean([one.rms for one in ten]) == pytest.approx(expected, rel=0.1)
    (note,) = notes_of_discrepancies({"strips: warp": ten[0]})
    assert (note.kind, note.of) == (DISCREPANCY, "strips: warp")
    assert f"{ten[0].rms:.2g} N " in note and "all 10 specimens" in note


def test_misfit_that_the_law_can_follow_is_no_discrepancy():
    """All specimens stiffer alike: another modulus, not another form."""
    random = np.random.default_rng(9)
    for _ in range(20):
        off = scattered(5, random)
        before, after = discrepancy_of(off), discrepancy_of(400.0 * PLACES + off)
        assert after.f_ratio == pytest.approx(before.f_ratio, rel=1e-6)
    # Two of four broke early: their curves say too little of the whole.
    places = [PLACES, PLACES, PLACES[:15], PLACES[:15]]
    assert (
        discrepancy_of([own[: len(at)] for own, at in zip(off, places, strict=False)], places)
        is None
    )
    # Specimens that do not differ leave nothing to test against, nor do two, nor single points.
    assert discrepancy_of(off[:2]) is None and discrepancy_of(np.tile(off[:1], (5, 1))) is None
    assert (
        specimen_discrepancy([np.ones(1)] * 5, [np.ones(1)] * 5, [np.ones((1, 1))] * 5, "N") is None
    )
