"""From one level of a load to the next, through halved steps where the next one is too far.

The strain history is committed at the levels only and not in between, so that the path integral of
the law, and with it the result, does not depend on how a level was reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ..base import Progress
from .newton import Membrane

Array = NDArray[np.float64]


class NoEquilibrium(SolverFailure):
    """No step from a level to the next one was found."""


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked of an analysis beside its model.

    parameters : of the derivatives. guess : (increments, nodes, 3) displacements to start each
    increment from. tell : called with every increment that is done.
    """

    parameters: Sequence[str] = ()
    guess: Array | None = None
    tell: Callable[[Progress], None] | None = None


@dataclass(frozen=True)
class Done:
    """How far a run is: increments of the model."""

    time: float


class Loading:
    """One way of loading a membrane, by a level: a pressure, an elongation, a deflection.

    What differs from one to the other: what equilibrium at a level means, and where to look for it.
    """

    #: How often a step between two levels is halved at most.
    most_cuts = 6

    def equilibrium(self, start: Array, level: float) -> Array | None:
        """Displacement (nodes, 3) at a level, looked for from `start`; None if not found."""
        raise NotImplementedError

    def first(self, level: float) -> Array | None:
        """Displacement at the first level, from the unloaded membrane."""
        raise NotImplementedError

    def ahead(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Where to look for the next level after all that were found."""
        raise NotImplementedError

    def onward(self, u: Array, at: float, to: float, before: Array | None) -> Array:
        """Where to look for a level from u at another, inside a step that is halved: straight on.

        before : the displacement as far back, where there is one.
        """
        return u if before is None else np.asarray(2.0 * u - before)

    def guessed(self, guess: Array) -> Array:
        """A guess as it may be taken for a start."""
        return guess

    def reached(
        self, lower: float, u: Array, level: float, start: Array, cuts: int
    ) -> Array | None:
        """Equilibrium at `level` from that at `lower`, which is u."""
        return reach(self, lower, u, level, start, cuts)

    def problem(self, before: float, level: float, place: str) -> str:
        """What to say where `level` cannot be reached; place : "increment 3 of 7"."""
        raise NotImplementedError


def march(
    loading: Loading,
    levels: Sequence[float] | Array,
    asked: Asked,
    begun: tuple[float, Array] | None = None,
    done: int = 0,
) -> Iterator[Array]:
    """Displacement (nodes, 3) at one level after the other; the caller accepts each in between.

    Parameters
    ----------
    begun : level and displacement to start from; the unloaded membrane otherwise.
    done : increments of the model that are behind us.

    Raises
    ------
    NoEquilibrium : a level cannot be reached.
    """
    known, path = ([begun[0]], [begun[1]]) if begun is not None else ([], [])
    for i, level in enumerate(float(value) for value in levels):
        found = None
        if asked.guess is not None:
            found = loading.equilibrium(loading.guessed(asked.guess[i]), level)
        if found is None and path:
            start = loading.ahead(known, path, level)
            found = loading.reached(known[-1], path[-1], level, start, loading.most_cuts)
        elif found is None:
            found = loading.first(level)
        if found is None:
            place = f"increment {i + 1} of {len(levels)}"
            raise NoEquilibrium(loading.problem(known[-1] if known else 0.0, level, place))
        yield found
        known.append(level)
        path.append(found)
        if asked.tell is not None:
            asked.tell(Done(done + i + 1))


def reach(
    loading: Loading, lower: float, u: Array, level: float, start: Array, cuts: int
) -> Array | None:
    """Equilibrium at `level`: from `start`, else through the middle between `lower` and it."""
    found = loading.equilibrium(start, level)
    return found if found is not None else halved(loading, lower, u, level, cuts)


def halved(loading: Loading, lower: float, u: Array, level: float, cuts: int) -> Array | None:
    """Equilibrium at `level` in two steps from `lower`, where it is u; each may be halved again."""
    if cuts == 0:
        return None
    middle = 0.5 * (lower + level)
    start = loading.onward(u, lower, middle, None)
    halfway = reach(loading, lower, u, middle, start, cuts - 1)
    if halfway is None:
        return None
    start = loading.onward(halfway, middle, level, u)
    return reach(loading, middle, halfway, level, start, cuts - 1)


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """On the line through the last two of the path; where the last one is without two."""
    if len(path) < 2:
        return path[-1]
    ahead = (level - levels[-1]) / (levels[-1] - levels[-2])
    return np.asarray(path[-1] + ahead * (path[-1] - path[-2]))


def lagrange(x: Array, known: Array, at: float) -> Array:
    """The polynomial through `known` (k, nodes, 3) at x (k,), at another place."""
    shares = [
        math.prod((at - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.asarray(np.einsum("a,ank->nk", shares, known))


class Record:
    """What every analysis keeps of its increments.

    path (increments, nodes, 3) mm; forces likewise, N, of the nodes on what holds them; low, high
    (3,) extremes of the strain components.
    """

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path, self.forces = (np.zeros((count, *membrane.reference.shape)) for _ in range(2))
        self.low, self.high = np.zeros(3), np.zeros(3)

    def accept(self, i: int, u: Array) -> None:
        """Accept increment i, whose displacement is u (nodes, 3)."""
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        np.minimum(self.low, self.membrane.strain_old.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, self.membrane.strain_old.max(axis=(0, 1)), out=self.high)
