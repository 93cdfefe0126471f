"""The noise of the data behind a fit: given or from what is left, and how many values share it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from .comparison import NoiseIs, Objective
from .problem import FitProblem

# How many neighbouring values of a residual err as one.
#
# A facet of a camera's correlation is wider than the step between two of its points, and what a
# model cannot follow is smooth: neighbouring residuals are alike, and say less than as many
# independent ones. Where the derivatives vary slowly over such a neighbourhood, the variance of
# what is fitted grows by 1 + sum of rho(d) over the neighbours of a point, rho the correlation at
# the distance d; the sum is broken off where rho is first no more than chance.

Array = NDArray[np.float64]

#: Rings around a point that others are compared with, unless told.
RINGS = 60
#: Distances looked at in a block, and blocks looked at, evenly spread.
DISTANCES, BLOCKS = 500_000, 60
#: Standard deviations of a correlation of independent values, which are no correlation.
CHANCE = 2.0
#: Of the largest extent: beyond, there are no neighbours any more, unless told.
REACH = 0.5


def alike_in(objective: Objective, residual: Array) -> float:
    """Of a comparison's residual (m,); 1 where its objective does not say where its values lie.

    Blocks count alike, whatever they are normalised with.
    """
    places = getattr(objective, "places", ())
    if not places:
        return 1.0
    ends = np.cumsum(objective.sizes)[:-1]
    return alike(np.split(residual, ends), places)


def alike(
    residuals: Sequence[Array], places: Sequence[Array], reach: float = REACH, rings: int = RINGS
) -> float:
    """Number of values that err as one, 1 where they are independent.

    Parameters
    ----------
    residuals : blocks (n,), each of one quantity in one frame. places : (n, 2) mm or (n, 1) of
        each. reach : of the largest extent, beyond which there are no neighbours any more.
        rings : of distances, up to there.
    """
    products, pairs, asked = np.zeros(rings), np.zeros(rings), 0
    random = np.random.default_rng(0)
    step = max(1, -(-len(residuals) // BLOCKS))
    for own, at in zip(residuals[::step], places[::step], strict=True):
        if len(own) < 2:
            continue
        few = random.permutation(len(own))[: max(20, DISTANCES // len(own))]
        extent = float(np.ptp(at, axis=0).max())
        ring = np.minimum(cdist(at[few], at) / (reach * extent) * rings, rings).astype(int)
        ring[np.arange(len(few)), few] = rings  # a point is no neighbour of its own
        value = own[few, None] * own
        inside = ring < rings
        # Every block counts alike, whatever its size.
        unit = float(np.mean(own**2))
        if not unit > 0:
            continue
        products += np.bincount(ring[inside], value[inside] / unit, minlength=rings)
        pairs += np.bincount(ring[inside], minlength=rings)
        asked += len(few)
    if not asked:
        return 1.0
    known = pairs > 0
    rho = products[known] / pairs[known]
    neighbours = pairs[known] / asked
    # Every pair was met twice, at most; of few pairs a correlation is chance.
    chance = rho <= CHANCE / np.sqrt(np.maximum(pairs[known] / 2, 1.0))
    positive = int(np.argmax(chance)) if chance.any() else len(rho)
    return float(1.0 + (rho * neighbours)[:positive].sum())


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
