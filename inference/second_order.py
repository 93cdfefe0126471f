"""Second-order terms of the uncertainty of a fit with a large residual, by finite differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..materials.forms.base import Array
from ..notes import Note, NoteKind
from .linear import LinearisedFit, SecondOrderTerms
from .noise import Noise, misfits
from .problem import Evaluation, FitProblem

SECOND_ORDER = NoteKind("second order")
LARGE_MISFIT = 2.0  # residual over the noise from which on second-order terms may matter
WORTHWHILE_CHANGE = 0.1  # least relative change of a modulus' sigma for which they are used
# Why the second order is not used.
NOT_DEFINITE = "not positive definite"
TOO_LITTLE = "too little changes"


@dataclass(frozen=True)
class SecondOrderSettings:
    """Settings of the finite differences of the Jacobian."""

    max_directions: int = 8  # number of directions, the least certain ones, an analysis each
    step_sigmas: float = 0.5  # length of a step, in standard deviations
    min_step: float = 1e-3  # least length of a step, relative to the sizes of the unknowns
    max_step: float = 0.05  # largest length, likewise
    #: Share of the first-order curvature that must be left along every direction with second-order
    #: terms, for these to be used.
    min_curvature: float = 0.05


DEFAULT_SETTINGS = SecondOrderSettings()


@dataclass(frozen=True)
class UncertaintyOrder:
    """Tell whether the uncertainty of a fit is of first or of second order, and the reason.

    Attributes
    ----------
    used : bool
        Whether second-order terms are used.
    reason : str
        "" if they are, else NOT_DEFINITE or TOO_LITTLE.
    change : mapping of float
        Largest relative change of each modulus' sigma by second-order terms; empty where they do
        not give one (NOT_DEFINITE).
    directions, analyses : int
        Number of directions that were differenced, and of analyses for it.
    """

    used: bool
    reason: str
    change: Mapping[str, float]
    directions: int
    analyses: int

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the order as it is written to `result.json`."""
        return {
            "order": 2 if self.used else 1,
            "why": self.reason,
            "change_of_sigma": dict(self.change),
            "directions": self.directions,
            "analyses": self.analyses,
        }

    @property
    def words(self) -> str:
        """Return the order and its reason in words."""
        changes = ", ".join(f"{name} {100 * change:+.0f} %" for name, change in self.change.items())
        if self.used:
            return f"second order: 1 sigma against that of the first derivatives: {changes}"
        if self.reason != NOT_DEFINITE:
            return f"first order: the second would change 1 sigma by {changes}"
        return (
            "first order, although much is left of the residual: to second order the optimum is no "
            "minimum along some direction, and 1 sigma may be far too small (a profile likelihood "
            "tells)"
        )

    @property
    def notes(self) -> list[Note]:
        """Return a note where the second order matters."""
        if not self.used and self.reason != NOT_DEFINITE:
            return []
        return [Note(SECOND_ORDER, f"the uncertainty is of {self.words}")]


def has_large_residual(problem: FitProblem, residual: Array) -> bool:
    """Return whether a residual is so large that the second order may matter.

    Parameters
    ----------
    problem : FitProblem
    residual : (m,) array
    """
    return any(misfit.ratio > LARGE_MISFIT for misfit in misfits(problem, residual).values())


def second_order_terms(
    problem: FitProblem,
    best: Evaluation,
    noise: Noise,
    settings: SecondOrderSettings = DEFAULT_SETTINGS,
) -> SecondOrderTerms:
    """Compute second-order terms from differences of the Jacobian along uncertain directions.

    The Jacobian is differenced over a step of `settings.step_sigmas` standard deviations. The terms
    also take off the curvature along each block's own residual, where a norm has none. A direction
    with no successful analysis on either side counts as if the Jacobian did not change along it.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    noise : Noise
    settings : SecondOrderSettings
    """
    assert best.jacobian is not None
    previous_analyses = problem.analyses
    linear = LinearisedFit.of(problem, best, noise)
    directions, changes = _slope_changes(problem, best, linear, settings)
    added = _symmetric(directions, changes)
    # Residuals over their block's norm; zero where the block weighs by its noise.
    norms = problem.blocks.norms(best.residual)
    smallest = problem.blocks.norms(noise.smallest_residual_sigma)
    is_large = norms > np.maximum(smallest, problem.blocks.least_norms)
    inverse_norms = is_large / np.where(is_large, norms, 1.0)
    unit_residual = best.residual * inverse_norms[problem.blocks.block_of]
    analyses = problem.analyses - previous_analyses
    terms = SecondOrderTerms(added, unit_residual, directions.shape[1], analyses)
    slopes = terms.slopes(problem, best.jacobian * linear.sizes * linear.weights[:, None])
    block_slopes = slopes[problem.blocks.starts]
    return replace(terms, hessian_term=added - block_slopes.T @ block_slopes)


def _slope_changes(
    problem: FitProblem,
    best: Evaluation,
    linear: LinearisedFit,
    settings: SecondOrderSettings,
) -> tuple[Array, Array]:
    """Return directions (unknowns, k), and the second-order term (unknowns, k) along each.

    It is the change of J'Wr by that of the Jacobian J alone, per unit of the direction, with r the
    residual and W the weights of its squares.
    """
    assert best.jacobian is not None
    least_certain = np.argsort(linear.curvature)[: settings.max_directions]
    directions = linear.sharp[:, least_certain]
    sigma = np.linalg.norm(directions.T @ linear.noise_response, axis=1)
    steps = np.clip(settings.step_sigmas * sigma, settings.min_step, settings.max_step)
    weighted = linear.weights**2 * best.residual
    changes = []
    differentiated = []
    for k, (direction, step) in enumerate(zip(directions.T, steps, strict=True)):
        neighbour, sign = _neighbour(problem, best, linear.sizes * direction * step)
        if neighbour is None or neighbour.jacobian is None:
            continue
        slope = (neighbour.jacobian - best.jacobian).T @ weighted / (sign * step)
        changes.append(linear.sizes * slope)
        differentiated.append(k)
    if not changes:
        empty = np.zeros((len(linear.sizes), 0))
        return empty, empty
    return directions[:, differentiated], np.array(changes).T


def _symmetric(directions: Array, changes: Array) -> Array:
    """Return the symmetric matrix (n, n) that gives the changes (n, k) along the directions.

    The directions (n, k) are orthonormal.
    """
    count, direction_count = directions.shape
    if not direction_count:
        return np.zeros((count, count))
    v = directions
    t = changes
    inner = v.T @ t
    matrix = t @ v.T + v @ t.T - 0.5 * v @ (inner + inner.T) @ v.T
    return 0.5 * (matrix + matrix.T)


def is_definite(linear: LinearisedFit, second: SecondOrderTerms) -> bool:
    """Return whether enough curvature is left along every direction with second-order terms.

    Parameters
    ----------
    linear : LinearisedFit
        The fit to first order.
    second : SecondOrderTerms
    """
    unit = linear.sharp / np.sqrt(linear.curvature)
    smallest = np.linalg.eigvalsh(unit.T @ second.hessian_term @ unit).min()
    return bool(smallest > DEFAULT_SETTINGS.min_curvature - 1.0)


def _neighbour(
    problem: FitProblem, best: Evaluation, step: Array
) -> tuple[Evaluation | None, float]:
    """Evaluate an allowed point a step to one side or the other; return it and the side's sign."""
    rows, limits = problem.unknowns.inequalities
    for sign in (1.0, -1.0):
        y = best.unknowns + sign * step
        if (rows @ y < limits - 1e-9).any():
            continue
        neighbour = problem.evaluate(y, True)
        if neighbour is not None:
            return neighbour, sign
    return None, 1.0
