"""Starts of a fit: laws within their bounds, drawn by number, with which every model can be run.

References
----------
I. M. Sobol, On the distribution of points in a cube and the approximate evaluation of integrals,
USSR Comput. Math. Math. Phys. 7 (1967) 86.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import NoFeasibleStart, SolverFailure
from ..materials.forms.base import Array
from .descent import bounded_step
from .problem import FitProblem
from .unknowns import Unknowns

MAX_ANALYSES = 50  # trial analyses for one start

MAX_DRAWS = 200_000  # draws for one start

DRAWS_AT_ONCE = 500

SOBOL_POINTS_AT_ONCE = 512  # a power of two, which Sobol points need to be evenly distributed

MAX_DRAWN_VALUES = 4  # control values drawn for one modulus; further ones are interpolated


def feasible_start(problem: FitProblem, seed: int, number: int) -> Array:
    """Return the unknowns at which one start of a study begins, the same on any machine.

    Candidates of the problem's `starts` are tried until an analysis ends well, in a stable
    equilibrium.

    Parameters
    ----------
    problem : FitProblem
    seed : int
        Seed of the study.
    number : int
        Index of the start, from 0.

    Returns
    -------
    (unknowns,) array

    Raises
    ------
    NoFeasibleStart
        After `MAX_DRAWS` draws without an admissible law, or `MAX_ANALYSES` failed analyses.
    """
    # With a surrogate, the runs of the expensive solver are not spent on trial points.
    starts = problem.starts or RandomStarts()
    problem = problem.surrogate or problem
    unknowns = problem.unknowns
    tried = 0
    random = np.random.default_rng([seed, number, 1])
    for coefficients in starts.candidates(unknowns, seed, number):
        y = _drawn(problem, unknowns.at(coefficients), random)
        if y is None:
            continue
        tried += 1
        y = _within_work(unknowns, y)
        if y is not None:
            point = problem.evaluate(y, False, warm=False)
            if point is not None and point.stable:
                return y
        if tried >= MAX_ANALYSES and not unknowns.size:
            raise NoFeasibleStart(
                f"start {number}: the deck failed with all of {tried} random parameters, at last: "
                f"{problem.failure}; narrow their bounds"
            )
        if tried >= MAX_ANALYSES:
            raise NoFeasibleStart(
                f"start {number}: the analysis failed, or the work of a closed path is above its "
                f"bound, at all of {tried} random points with positive moduli; raise the lower "
                "bounds or law.closed_path, or add increments"
            )
    raise NoFeasibleStart(
        f"start {number}: none of {MAX_DRAWS} random points inside the bounds has positive "
        "moduli over the strain range; check the bounds and the strain range"
    )


def _drawn(problem: FitProblem, y: Array, random: np.random.Generator) -> Array | None:
    """Return unknowns with drawn parameters of models; None where the models refuse them.

    Parameters
    ----------
    y : (unknowns,) array
        Unknowns, whose parameters of models are replaced in place.
    """
    unknowns = problem.unknowns
    if not any(nuisance.drawn for nuisance in unknowns.nuisance.all):
        return y
    y[unknowns.size :] = unknowns.nuisance.drawn(random)
    try:
        for comparison in problem.comparisons:
            comparison.model_at(unknowns.nuisance_values(comparison.name, y))
    except SolverFailure:
        return None
    return y


def _within_work(unknowns: Unknowns, y: Array) -> Array | None:
    """Return the nearest unknowns that keep the bound of the work; None where none are found.

    Parameters
    ----------
    y : (unknowns,) array
        Unknowns, which may violate it.
    """
    step: Array | None = np.zeros_like(y)
    if not unknowns.within_work(y):
        step = bounded_step(unknowns, np.eye(len(y)), np.zeros(len(y)), y)
    return None if step is None else y + step


def dimensions(unknowns: Unknowns) -> int:
    """Return how many numbers between 0 and 1 determine a law inside the bounds."""
    if unknowns.bounds.largest is None:
        return unknowns.size
    return _interpolation(unknowns.form.modulus_of).shape[1]


def coefficients_at(unknowns: Unknowns, share: Array) -> Array:
    """Return the free coefficients that points of the unit cube stand for.

    Evenly distributed points make coefficients that are evenly distributed in the box of their
    bounds, or, where moduli are bounded, logarithms of the moduli at the control strains that are.

    Parameters
    ----------
    unknowns : Unknowns
    share : (count, dimensions) array
        Coordinates of the points, between 0 and 1.

    Returns
    -------
    (count, size) array, MPa
    """
    if unknowns.bounds.largest is None:
        lower, upper = unknowns.box
        return np.asarray(lower + (upper - lower) * share)
    lower, upper = (np.log(moduli) for moduli in unknowns.bounds.at_control_strains(unknowns.form))
    interpolation = _interpolation(unknowns.form.modulus_of)
    values = np.exp(lower + (upper - lower) * (share @ interpolation.T))
    return np.asarray(values @ unknowns.from_values.T)


def _interpolation(modulus_of: Sequence[str]) -> Array:
    """Return the matrix (size, drawn) from drawn numbers to the control values of all moduli.

    Up to `MAX_DRAWN_VALUES` control values of a modulus are drawn each by itself. More are
    interpolated between as many drawn ones, because a curve through many independent values hardly
    ever stays within its bounds between them.
    """
    blocks = []
    for name in dict.fromkeys(modulus_of):
        count = sum(modulus == name for modulus in modulus_of)
        drawn_count = min(count, MAX_DRAWN_VALUES)
        positions = np.linspace(0.0, drawn_count - 1.0, count)
        columns = [np.interp(positions, range(drawn_count), row) for row in np.eye(drawn_count)]
        blocks.append(np.column_stack(columns))
    return np.asarray(scipy.linalg.block_diag(*blocks))


def allowed(unknowns: Unknowns, coefficients: Array) -> NDArray[np.bool_]:
    """Return (n,) which free coefficients (n, size) MPa make moduli inside their bounds."""
    grid, margin = unknowns.positivity
    moduli = coefficients @ grid.T
    is_allowed = (moduli >= margin).all(axis=1)
    if unknowns.ceiling is not None:
        is_allowed &= (moduli <= unknowns.ceiling).all(axis=1)
    return np.asarray(is_allowed)


@dataclass(frozen=True)
class RandomStarts:
    """Starts that are drawn independently, each from at most `MAX_DRAWS` draws."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield free coefficients (size,) MPa of allowed moduli."""
        random = np.random.default_rng([seed, number])
        for _ in range(MAX_DRAWS // DRAWS_AT_ONCE):
            shares = random.random((DRAWS_AT_ONCE, dimensions(unknowns)))
            draws = coefficients_at(unknowns, shares)
            yield from draws[allowed(unknowns, draws)]


@dataclass(frozen=True, eq=False)
class EstimatedStarts:
    """One start at estimated coefficients (size,) MPa, all further ones drawn at random."""

    coefficients: Array

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield the estimate first for start 0, then free coefficients (size,) MPa as drawn."""
        if number == 0:
            yield self.coefficients
        yield from RandomStarts().candidates(unknowns, seed, number)


@dataclass(frozen=True)
class SobolStarts:
    """Starts from a Sobol sequence, scrambled by the seed, which spreads them evenly.

    Start k is the k-th point of the sequence (from 0) whose moduli keep the bounds. Random points
    follow as further candidates, for a point that cannot be analysed.
    """

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield the allowed point of that number, then free coefficients (size,) MPa as drawn."""
        sequence = scipy.stats.qmc.Sobol(dimensions(unknowns), seed=seed)
        passed = 0
        for _ in range(MAX_DRAWS // SOBOL_POINTS_AT_ONCE):
            points = coefficients_at(unknowns, sequence.random(SOBOL_POINTS_AT_ONCE))
            allowed_points = points[allowed(unknowns, points)]
            if number < passed + len(allowed_points):
                yield allowed_points[number - passed]
                break
            passed += len(allowed_points)
        yield from RandomStarts().candidates(unknowns, seed, number)
