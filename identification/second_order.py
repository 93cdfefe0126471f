"""What a fit's objective has of second order beside the squares of its slopes.

Where much is left of the residual, two things are no longer small. The slopes change from place to
place, and each counts by what is left there: that comes from differences of the exact slopes, each
over half of a standard deviation, along the directions that the data determine worst (the others
have curvature enough). And the norm of a block is not curved along the block's own residual: a fit
of the sum of norms follows noise otherwise than one of squares with fixed weights. That costs
nothing. Near a residual of noise alone both are nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..notes import Note, NoteKind
from .linear import Linear, Second
from .noise import Noise, misfits
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

#: Times the noise of the data that is left of a comparison, from which on it is looked at.
LARGE = 2.0
#: Directions that are looked at, an analysis each.
MOST = 8
#: Of a step, in standard deviations; its least and largest size, relative to the unknowns.
STEP, LEAST_STEP, LARGEST_STEP = 0.5, 1e-3, 0.05
#: Curvature that must be left of that of the first derivatives, for the sum to be taken for it.
LEFT = 0.05
#: Change of a modulus' sigma, relative, that is worth telling, and taking.
WORTH = 0.1
NOT_DEFINITE = "not positive definite"
TOO_LITTLE = "too little changes"


@dataclass(frozen=True)
class Order:
    """Whether the uncertainty is of first or of second order.

    used : it is of second order. why : "" where it is; else NOT_DEFINITE or TOO_LITTLE. change : by
    modulus, by how much the second order changes its sigma, relative, where it does most; empty
    where it has none. directions : along which it was looked at. analyses : that it took.
    """

    used: bool
    why: str
    change: Mapping[str, float]
    directions: int
    analyses: int

    @property
    def numbers(self) -> dict[str, Any]:
        """For result.json."""
        return {
            "order": 2 if self.used else 1,
            "why": self.why,
            "change_of_sigma": dict(self.change),
            "directions": self.directions,
            "analyses": self.analyses,
        }

    @property
    def words(self) -> str:
        """In a line."""
        changes = ", ".join(f"{name} {100 * by:+.0f} %" for name, by in self.change.items())
        if self.used:
            return f"second order: 1 sigma against that of the first derivatives: {changes}"
        if self.why == NOT_DEFINITE:
            return (
                "first order, although much is left of the residual: to second order the optimum "
                "is no minimum along some direction, and 1 sigma may be far too small (a profile "
                "likelihood tells)"
            )
        return f"first order: the second would change 1 sigma by {changes}"

    @property
    def notes(self) -> list[Note]:
        """Where the second order matters."""
        if not self.used and self.why != NOT_DEFINITE:
            return []
        return [Note(NoteKind.SECOND_ORDER, f"the uncertainty is of {self.words}")]


def large(problem: FitProblem, residual: Array) -> bool:
    """Whether so much is left of any comparison that the second order may matter."""
    return any(misfit.ratio > LARGE for misfit in misfits(problem, residual).values())


def second_of(problem: FitProblem, best: Evaluation, noise: Noise) -> Second:
    """At the optimum: from differences of the exact slopes, along the worst determined directions.

    A direction along which no analysis ends well, to neither side, counts as if its slopes did not
    change.
    """
    assert best.jacobian is not None
    before, linear = problem.analyses, Linear.of(problem, best, noise)
    along = linear.sharp[:, np.argsort(linear.curvature)[:MOST]]
    spread = np.linalg.norm(along.T @ linear.moved, axis=1)
    steps = np.clip(STEP * spread, LEAST_STEP, LARGEST_STEP)
    weighted = linear.weights**2 * best.residual
    changes, known = [], []
    for k, (direction, step) in enumerate(zip(along.T, steps, strict=True)):
        there, way = _beside(problem, best, linear.sizes * direction * step)
        if there is None or there.jacobian is None:
            continue
        slope = (there.jacobian - best.jacobian).T @ weighted / (way * step)
        changes.append(linear.sizes * slope)
        known.append(k)
    added = np.zeros((len(linear.sizes),) * 2)
    if changes:
        v, t = along[:, known], np.array(changes).T
        inner = v.T @ t
        # Symmetric, and t along every direction v, which are orthonormal.
        added = t @ v.T + v @ t.T - 0.5 * v @ (inner + inner.T) @ v.T
        added = 0.5 * (added + added.T)
    found = Second(added, _left(problem, best, noise), len(known), problem.analyses - before)
    norms = found.slopes(problem, best.jacobian * linear.sizes * linear.weights[:, None])
    blocks = norms[problem.blocks.starts]
    return replace(found, added=added - blocks.T @ blocks)


def definite(linear: Linear, second: Second) -> bool:
    """Whether enough of the curvature of the first derivatives is left along every direction."""
    unit = linear.sharp / np.sqrt(linear.curvature)
    return bool(np.linalg.eigvalsh(unit.T @ second.added @ unit).min() > LEFT - 1.0)


def _left(problem: FitProblem, best: Evaluation, noise: Noise) -> Array:
    """(m,) the residual of each block over its norm; zero where the block weighs by its noise."""
    blocks = problem.blocks
    norms = blocks.norms(best.residual)
    own = norms > blocks.norms(noise.least)
    return np.asarray(best.residual * (own / np.where(own, norms, 1.0))[blocks.of])


def _beside(problem: FitProblem, best: Evaluation, step: Array) -> tuple[Evaluation | None, float]:
    """A point a step to either side that is allowed and ends well, and to which side."""
    a, c = problem.unknowns.inequalities
    for way in (1.0, -1.0):
        y = best.unknowns + way * step
        if (a @ y < c - 1e-9).any():
            continue
        there = problem.evaluate(y, True)
        if there is not None:
            return there, way
    return None, 1.0
