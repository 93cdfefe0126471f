"""Is what is left the noise that is given? False alarms, and what is told either way."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.misfit import CHANCE, NoiseTest, noise_tests, notes_of_noise
from bubblefit.inference.noise import Misfit
from bubblefit.inference.problem import FitProblem
from bubblefit.notes import NoteKind
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CONSTANT, LAW, MODEL, reference, single

NOISE = 0.05


def fit(given: float | None) -> FitProblem:
    places = MODEL.mesh.points[:, :2]
    fields = zip(MODEL.pressures, reference().displacement, strict=True)
    targets = [FieldTarget(p, u, at_rest=places) for p, u in fields]
    objective = FieldObjective(targets, "e", noise=given)
    return single(MODEL, MembraneSolver(), LAW, objective, CONSTANT)


def smooth(length: float) -> np.ndarray:
    """A root of the correlation of neighbours, (places, places)."""
    places = MODEL.mesh.points[:, :2]
    distance = np.hypot(*(places[:, None] - places).T)
    return np.linalg.cholesky(np.exp(-((distance / length) ** 2)) + 1e-9 * np.eye(len(places)))


@pytest.mark.parametrize("length", [1e-3, 15.0])
def test_noise_as_it_is_given_is_seldom_told(length: float) -> None:
    """White, or alike over a facet: in one of fifty, twice; more and less are always told."""
    root, told = smooth(length), {0.5: 0, 1.0: 0, 2.0: 0}
    problem, random = fit(NOISE), np.random.default_rng(3)
    fields, count = len(MODEL.pressures), 30
    for _ in range(count):
        noise = np.concatenate(
            [(root @ random.standard_normal((len(root), 3))).T.ravel() for _ in range(fields)]
        )
        for times in told:
            tests = noise_tests(problem, NOISE * times * noise / problem.scale)
            kinds = [note.kind for note in notes_of_noise(tests)]
            expected = {0.5: [NoteKind.BELOW_NOISE], 2.0: [NoteKind.ABOVE_NOISE]}
            told[times] += kinds == expected.get(times, kinds) and bool(kinds)
    assert told[1.0] <= 2
    assert told[0.5] == told[2.0] == count


def test_what_is_counted() -> None:
    problem = fit(NOISE)
    residual = np.random.default_rng(5).standard_normal(len(problem.scale)) * NOISE / problem.scale
    (test,) = noise_tests(problem, residual).values()
    assert test.values == len(residual) and test.free == pytest.approx(test.independent - 3)
    assert test.square == pytest.approx(test.independent * test.misfit.ratio**2)
    assert test.above + test.below == pytest.approx(1.0)
    # Nobody gave it: nothing is tested.
    assert noise_tests(fit(None), residual) == {}


def test_what_is_told() -> None:
    above = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 30.0, 29.0)
    below = NoiseTest(Misfit(1.5, 3.0, "given", "N"), 300, 30.0, 29.0)
    few = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 3.0, 2.0)
    # However many values say it: a twentieth is no matter.
    little = NoiseTest(Misfit(3.15, 3.0, "given", "N"), 10**6, 1e6, 1e6)
    assert little.above < CHANCE
    notes = notes_of_noise({"warp": above, "fill": below, "bias": few, "other": little})
    assert [(n.kind, n.of) for n in notes] == [
        (NoteKind.ABOVE_NOISE, "warp"), (NoteKind.BELOW_NOISE, "fill"),
    ]  # fmt: skip
    assert notes[0] == (
        "the fit leaves 4.54 N RMS, 1.51 times the noise given (3 N; 300 values count as 30 "
        "independent ones): the noise is given too small, or model or data are off by more than "
        "noise, and the uncertainty reckons with what is left as if it were noise"
    )
    assert "the noise is given too large" in notes[1]
    assert above.numbers["probability_of_more"] == above.above < CHANCE < few.above
    assert Misfit(1.0, 0.0, "assumed", "mm").ratio == np.inf
