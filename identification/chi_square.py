"""Is what a fit leaves the noise that the project gives? A test of chi-square, either way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ..notes import Note, NoteKind
from .correlation import alike_in
from .noise import Misfit, misfits
from .problem import FitProblem

Array = NDArray[np.float64]

#: Of so many fits in which the noise is as it is given, one is told to be off to a side.
CHANCE = 0.01
#: Of the noise: less is no matter, however many values say it (rounding, a mesh).
MATTERS = 0.1


@dataclass(frozen=True)
class NoiseTest:
    """A comparison's residual beside the noise given.

    values : how many; independent : as how many independent ones they count; free : of those, less
    what the unknowns have taken up.
    """

    misfit: Misfit
    values: int
    independent: float
    free: float

    @property
    def square(self) -> float:
        """Chi-square."""
        return self.independent * self.misfit.ratio**2

    @property
    def above(self) -> float:
        """How often such noise leaves as much, or more."""
        return float(chi2.sf(self.square, self.free))

    @property
    def below(self) -> float:
        """How often it leaves as little, or less."""
        return float(chi2.cdf(self.square, self.free))

    @property
    def told(self) -> NoteKind | None:
        """What is to be told; None where it is as it should be."""
        expected = np.sqrt(self.free / self.independent)
        if self.above < CHANCE and self.misfit.ratio > (1 + MATTERS) * expected:
            return NoteKind.ABOVE_NOISE
        if self.below < CHANCE and self.misfit.ratio < (1 - MATTERS) * expected:
            return NoteKind.BELOW_NOISE
        return None

    @property
    def numbers(self) -> dict[str, Any]:
        """For result.json."""
        return {
            "values": self.values,
            "independent": self.independent,
            "chi_square": self.square,
            "degrees_of_freedom": self.free,
            "probability_of_more": self.above,
            "probability_of_less": self.below,
        }


def noise_tests(problem: FitProblem, residual: Array) -> dict[str, NoiseTest]:
    """Of every comparison whose noise the project gives, by its name; residual (m,) of all.

    Neighbours that err as one, as the residual itself tells, count as one. The unknowns are shared
    among the comparisons as their independent values are.
    """
    given: dict[str, tuple[Misfit, int, float]] = {}
    total, every = 0.0, misfits(problem, residual)
    if not any(misfit.noise_is == "given" for misfit in every.values()):
        return {}
    for k, (name, misfit) in enumerate(every.items()):
        own = residual[problem.rows(k)]
        independent = len(own) / alike_in(problem.comparisons[k].objective, own)
        total += independent
        if misfit.noise_is == "given" and misfit.noise > 0:
            given[name] = misfit, len(own), independent
    taken = problem.unknowns.count / max(total, 1.0)
    return {
        name: NoiseTest(misfit, values, independent, max(independent * (1.0 - taken), 1.0))
        for name, (misfit, values, independent) in given.items()
    }


def notes_of_noise(tests: Mapping[str, NoiseTest]) -> list[Note]:
    """Where more, or less, is left than the noise given can leave."""
    return [
        Note(kind, _words(test, kind), name)
        for name, test in tests.items()
        if (kind := test.told) is not None
    ]


def _words(test: NoiseTest, kind: NoteKind) -> str:
    m = test.misfit
    left = (
        f"the fit leaves {m.rms:.3g} {m.unit} RMS, {m.ratio:.3g} times the noise given "
        f"({m.noise:.3g} {m.unit}; {test.values} values count as {test.independent:.3g} "
        "independent ones)"
    )
    if kind == NoteKind.ABOVE_NOISE:
        return (
            f"{left}: the noise is given too small, or model or data are off by more than noise, "
            "and the uncertainty reckons with what is left as if it were noise"
        )
    return (
        f"{left}: the noise is given too large, and the uncertainty, which reckons with it, is "
        "larger than the data say"
    )
