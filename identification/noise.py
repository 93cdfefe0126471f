"""The noise of the data behind a fit: given or from what is left, and how many values share it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .comparison import NoiseIs
from .correlation import alike_in
from .problem import FitProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Misfit:
    """RMS residual of a comparison beside the noise of its data, both in `unit`s."""

    rms: float
    noise: float
    noise_is: NoiseIs
    unit: str

    @property
    def ratio(self) -> float:
        """How many times the noise is left."""
        return self.rms / self.noise if self.noise > 0 else np.inf


def misfits(problem: FitProblem, residual: Array) -> dict[str, Misfit]:
    """Of every comparison, by its name, from the residual (m,) of all."""
    misfit, found = residual * problem.scale, {}
    for k, comparison in enumerate(problem.comparisons):
        rms = float(np.sqrt(np.mean(misfit[problem.rows(k)] ** 2)))
        own = comparison.objective
        found[comparison.name] = Misfit(
            rms, own.least_noise, getattr(own, "noise_is", "assumed"), own.unit
        )
    return found


@dataclass(frozen=True, eq=False)
class Noise:
    """What counts as noise.

    level : by comparison, in the unit of its data (mm, N). alike : by comparison, how many
    neighbouring values err as one. rows : (m,) of each residual the standard deviation that as
    many independent values would have. least : (m,) the same of the least noise of each
    comparison's data, all values independent.
    """

    level: dict[str, float]
    alike: dict[str, float]
    rows: Array
    least: Array

    @classmethod
    def of(cls, problem: FitProblem, residual: Array) -> Noise:
        """The RMS of what is left (m,), but not less than the objective's least noise.

        A misfit of zero (computed data) does not mean that a measurement would determine
        everything. Neighbours that err as one (`correlation.alike`) count as one; a misfit that is
        less than the noise does not tell them, and is taken for white unless the objective knows
        better (`alike`, of the specimens behind a load curve).
        """
        scale = problem.scale
        level, together = {}, {}
        rows, least = np.empty_like(scale), np.empty_like(scale)
        for k, (name, misfit) in enumerate(misfits(problem, residual).items()):
            own = problem.rows(k)
            level[name], together[name] = max(misfit.noise, misfit.rms), 1.0
            if misfit.rms > misfit.noise:
                together[name] = alike_in(problem.comparisons[k].objective, residual[own])
            known = getattr(problem.comparisons[k].objective, "alike", 1.0)
            together[name] = max(together[name], known)
            rows[own] = level[name] * np.sqrt(together[name]) / scale[own]
            least[own] = misfit.noise / scale[own]
        known = [n.weight for n in problem.unknowns.nuisance.all if n.prior is not None]
        rows[len(rows) - len(known) :] = least[len(rows) - len(known) :] = known
        return cls(level, together, rows, least)
