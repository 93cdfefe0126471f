"""What specimens have in common beside a model: false alarms, power, and who is compared."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.misfit import alike_in_all, notes_of_discrepancies
from bubblefit.notes import NoteKind

PLACES = np.linspace(0.1, 3.0, 30)
#: Of a law whose modulus is a constant: the load is proportional.
SLOPES = 100.0 * PLACES[:, None] @ np.array([[1.0, 0.0, 0.0]])


def scattered(count: int, random: np.random.Generator) -> np.ndarray:
    """(count, n) N: stiffer by a factor each, uneven over half of the curve, and noise."""
    distance = np.abs(PLACES[:, None] - PLACES)
    root = np.linalg.cholesky(np.exp(-((distance / 1.5) ** 2)) + 1e-6 * np.eye(len(PLACES)))
    factor = 20.0 * PLACES * random.standard_normal((count, 1))
    uneven = 15.0 * random.standard_normal((count, len(PLACES))) @ root.T
    return factor + uneven + random.standard_normal((count, len(PLACES)))


def found(residuals: np.ndarray, places: list[np.ndarray] | None = None):
    count = len(residuals)
    own = places or [PLACES] * count
    return alike_in_all(list(residuals), own, [SLOPES[: len(p)] for p in own], "N")


@pytest.mark.parametrize("specimens", [3, 5, 10])
def test_specimens_that_scatter_are_seldom_told(specimens: int) -> None:
    """As often as is said, one of a hundred; not more than one in twenty for whole tests of three
    directions."""
    random, told = np.random.default_rng(specimens), 0
    sets = 400
    for _ in range(sets):
        off = scattered(specimens, random)
        off -= (off @ SLOPES[:, :1] / (SLOPES[:, 0] @ SLOPES[:, 0])).mean() * SLOPES[:, 0]
        one = found(off)
        assert one is not None and one.specimens == specimens
        told += one.told
    assert told / sets <= 0.03


def test_a_wrong_form_is_told() -> None:
    """A curve that bends by 60 N where a constant modulus cannot."""
    random = np.random.default_rng(8)
    bend = 60.0 * ((PLACES / 1.5 - 1.0) ** 2 - 0.4)
    told = [found(bend + scattered(5, random)).told for _ in range(100)]
    assert sum(told) > 70
    ten = [found(bend + scattered(10, random)) for _ in range(50)]
    assert all(one.told for one in ten)
    # Without what another modulus would follow.
    beside = bend - SLOPES[:, 0] * (bend @ SLOPES[:, 0]) / (SLOPES[:, 0] @ SLOPES[:, 0])
    expected = float(np.sqrt(np.mean(beside**2)))
    assert np.mean([one.rms for one in ten]) == pytest.approx(expected, rel=0.1)
    (note,) = notes_of_discrepancies({"strips: warp": ten[0]})
    assert (note.kind, note.of) == (NoteKind.DISCREPANCY, "strips: warp")
    assert f"{ten[0].rms:.2g} N of what the fit leaves is alike in all 10 specimens" in note


def test_what_the_law_can_follow_is_no_wrong_form() -> None:
    """All specimens stiffer alike: another modulus, not another form."""
    random = np.random.default_rng(9)
    shift = 400.0 * PLACES
    for _ in range(20):
        off = scattered(5, random)
        before, after = found(off), found(shift + off)
        assert after.ratio == pytest.approx(before.ratio, rel=1e-6)


def test_too_few_to_compare() -> None:
    random = np.random.default_rng(1)
    off = scattered(4, random)
    assert found(off[:2]) is None
    # Two of four broke early: their curves say too little of the whole.
    places = [PLACES, PLACES, PLACES[:15], PLACES[:15]]
    residuals = [own[: len(at)] for own, at in zip(off, places, strict=True)]
    assert found(residuals, places) is None  # type: ignore[arg-type]
    # Specimens that do not differ leave nothing to test against.
    assert found(np.tile(off[:1], (5, 1))) is None
    assert alike_in_all([np.ones(1)] * 5, [np.ones(1)] * 5, [np.ones((1, 1))] * 5, "N") is None
