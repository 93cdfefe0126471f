"""Incremental loading: equilibria at one load level after another, and their record.

Each search starts from a guess of an earlier run, or from an extrapolation of the path so far;
where it fails, the step between two levels is halved.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ..base import Progress
from .membrane import Array, Membrane


class NoEquilibrium(SolverFailure):
    """No equilibrium was found at a load level, nor on the way there in halved steps."""


@dataclass(frozen=True)
class IncrementProgress:
    """Progress of an analysis.

    Attributes
    ----------
    time : float
        The number of increments that are done.
    """

    time: float


@dataclass(frozen=True, eq=False)
class RunRequest:
    """Hold what is asked of an analysis besides its model.

    Attributes
    ----------
    parameters : sequence of str
        Names of the parameters by which displacements are differentiated.
    guess : (k, nodes, 3) array, mm, or None
        Displacements from which the first k increments start.
    on_progress : callable or None
        Called with the progress after every increment.
    """

    parameters: Sequence[str] = ()
    guess: Array | None = None
    on_progress: Callable[[Progress], None] | None = None

    def report(self, finished: int) -> None:
        """Report how many increments are done."""
        if self.on_progress is not None:
            self.on_progress(IncrementProgress(finished))


class Loading:
    """A kind of loading, whose level is a pressure, an elongation or a deflection."""

    max_halvings = 6  #: how often a step between two levels may be halved

    def equilibrium(self, start: Array, level: float) -> Array | None:
        """Return the displacement (nodes, 3) mm at a level, or None if none is found.

        Parameters
        ----------
        start : array
            Displacement (nodes, 3) mm from which the search starts.
        """
        raise NotImplementedError

    def first_equilibrium(self, level: float) -> Array | None:
        """Return the displacement at the first level, from the unloaded membrane."""
        raise NotImplementedError

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        """Return a start (nodes, 3) mm for the search at the next level.

        Parameters
        ----------
        levels, path
            The levels reached so far and the displacements there.
        """
        raise NotImplementedError

    def start_within_step(
        self,
        u: Array,
        level: float,
        target: float,
        previous: Array | None,
    ) -> Array:
        """Return a start (nodes, 3) mm for the search at `target`, within a halved step.

        Parameters
        ----------
        u : array
            Displacement at `level`.
        previous : array or None
            Displacement at the level as far before `level` as `target` is behind it, or None.
        """
        return u if previous is None else 2.0 * u - previous

    def admissible(self, guess: Array) -> Array:
        """Return a guess (nodes, 3) mm changed so that it fulfils the prescribed displacements."""
        return guess

    def reach(
        self,
        lower: float,
        u: Array,
        level: float,
        start: Array,
        halvings: int,
    ) -> Array | None:
        """Return the equilibrium (nodes, 3) mm at `level`, directly or in halved steps, or None.

        Parameters
        ----------
        lower, u
            The level reached before, and the displacement there.
        start : array
            Where the direct search starts.
        halvings : int
            How often the step may be halved.
        """
        displacement = self.equilibrium(start, level)
        if displacement is None:
            displacement = reach_in_halves(self, lower, u, level, halvings)
        return displacement

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        """Return the message of an error for a level that is not reached.

        Parameters
        ----------
        previous : float
            The last level reached.
        increment : str
            In words, "increment 3 of 7".
        """
        raise NotImplementedError


def march(
    loading: Loading,
    levels: Sequence[float] | Array,
    request: RunRequest,
    origin: tuple[float, Array] | None = None,
    finished: int = 0,
) -> Iterator[Array]:
    """Yield the displacement at each level; the caller accepts each before the next is searched.

    Parameters
    ----------
    loading : Loading
    levels : (k,) sequence of float
        In the loading's unit.
    request : RunRequest
    origin : (float, (nodes, 3) array), optional
        Level and displacement to start from; by default the unloaded membrane.
    finished : int
        Count of the model's increments before these, for the progress.

    Yields
    ------
    (nodes, 3) array, mm

    Raises
    ------
    NoEquilibrium
        If a level is not reached, not even in halved steps.
    """
    passed: list[float] = []
    path: list[Array] = []
    if origin is not None:
        passed.append(origin[0])
        path.append(origin[1])
    for i in range(len(levels)):
        displacement = equilibrium_at(loading, levels, i, i - 1, request, (passed, path))
        yield displacement
        passed.append(float(levels[i]))
        path.append(displacement)
        request.report(finished + i + 1)


def equilibrium_at(
    loading: Loading,
    levels: Sequence[float] | Array,
    i: int,
    previous: int,
    request: RunRequest,
    reached: tuple[Sequence[float], Sequence[Array]],
) -> Array:
    """Return the displacement (nodes, 3) mm at a level; see `march`.

    Parameters
    ----------
    loading : Loading
    levels : (k,) sequence of float
    i : int
        Index of the level.
    previous : int
        Index of the level before it in `reached`, -1 for none.
    request : RunRequest
    reached : (sequence of float, sequence of (nodes, 3) array)
        Levels reached so far, and the displacements there.

    Raises
    ------
    NoEquilibrium
    """
    passed, path = reached
    level = float(levels[i])
    displacement = None
    if request.guess is not None:
        displacement = _guessed_equilibrium(loading, levels, i, previous, request.guess, path)
    if displacement is None and path:
        start = loading.extrapolate(passed, path, level)
        displacement = loading.reach(passed[-1], path[-1], level, start, loading.max_halvings)
    elif displacement is None:
        displacement = loading.first_equilibrium(level)
    if displacement is None:
        increment = f"increment {i + 1} of {len(levels)}"
        last_level = passed[-1] if passed else 0.0
        raise NoEquilibrium(loading.failure_message(last_level, level, increment))
    return displacement


def _guessed_equilibrium(
    loading: Loading,
    levels: Sequence[float] | Array,
    i: int,
    previous: int,
    guess: Array,
    path: Sequence[Array],
) -> Array | None:
    """Return the equilibrium at level i from its guess, or None.

    At the first level, guesses of later levels are tried where its own fails.
    """
    displacement = None
    if i < len(guess):
        start = loading.admissible(guess[i])
        if path and previous >= 0:  # what a guess lacks is much the same at neighbouring levels
            start = start + path[-1] - loading.admissible(guess[previous])
        displacement = loading.equilibrium(start, float(levels[i]))
    if displacement is None and not path:
        displacement = _first_from_later_guess(loading, levels, guess)
    return displacement


def _first_from_later_guess(
    loading: Loading, levels: Sequence[float] | Array, guess: Array
) -> Array | None:
    """Return the equilibrium at the first level by unloading from a later one, or None.

    That is the first later level whose guess leads to an equilibrium. On the way down each start is
    its guess with what the guess lacks at the level above.
    """
    starts = [loading.admissible(start) for start in guess[: len(levels)]]
    for k in range(1, len(starts)):
        u = loading.equilibrium(starts[k], levels[k])
        if u is None:
            continue
        for i in reversed(range(k)):
            start = starts[i] + u - starts[i + 1]
            u = loading.reach(levels[i + 1], u, levels[i], start, loading.max_halvings)
            if u is None:
                break
        return u
    return None


def reach_in_halves(
    loading: Loading,
    lower: float,
    u: Array,
    level: float,
    halvings: int,
) -> Array | None:
    """Return the equilibrium (nodes, 3) mm at `level` in two steps from `lower`, or None.

    Each step may be halved again, `halvings` - 1 times.

    Parameters
    ----------
    u : array
        Displacement at `lower`.
    """
    if halvings == 0:
        return None
    middle = 0.5 * (lower + level)
    start = loading.start_within_step(u, lower, middle, None)
    halfway = Loading.reach(
        loading,
        lower,
        u,
        middle,
        start,
        halvings - 1,
    )
    if halfway is None:
        return None
    start = loading.start_within_step(halfway, middle, level, u)
    return Loading.reach(
        loading,
        middle,
        halfway,
        level,
        start,
        halvings - 1,
    )


class IncrementRecord:
    """Record of a membrane's increments.

    Attributes
    ----------
    path : (increments, nodes, 3) ndarray, mm
        Displacements.
    forces : (increments, nodes, 3) ndarray, N
        Residuals, which are the reactions at unknowns that are held.
    low, high : (3,) ndarray
        Extremes of the log strains eps1, eps2, gamma12 so far, zero included.
    """

    def __init__(self, membrane: Membrane, count: int) -> None:
        self.membrane = membrane
        self.path = np.zeros((count, *membrane.reference.shape))
        self.forces = np.zeros((count, *membrane.reference.shape))
        self.low = np.zeros(3)
        self.high = np.zeros(3)

    def accept(self, i: int, u: NDArray[np.float64]) -> None:
        """Accept the equilibrium u (n, 3) mm as the end of increment i, and record it."""
        self.membrane.accept()
        self.path[i] = u
        self.forces[i] = self.membrane.residual.reshape(u.shape)
        strain = self.membrane.strain_old[..., :3]
        np.minimum(self.low, strain.min(axis=(0, 1)), out=self.low)
        np.maximum(self.high, strain.max(axis=(0, 1)), out=self.high)


def load_labels(levels: NDArray[np.float64], unit: str) -> tuple[str, ...]:
    """Return loads in words, each as its number and the unit.

    Parameters
    ----------
    levels : (n,) array
        Loads in this unit.
    """
    return tuple(f"{level:.4g} {unit}" for level in levels.tolist())


def monotonic_count(levels: Sequence[float], level: float, limit: int) -> int:
    """Return how many of the last levels form a monotonic sequence with the next one.

    Parameters
    ----------
    levels, level
        The loads so far, and the next one.
    limit : int
        The largest count to return.
    """
    steps = np.sign(np.diff([*levels, level]))[::-1]
    reversals = np.flatnonzero(steps != steps[0])
    return min(limit, int(reversals[0]) if len(reversals) else len(steps))


def straight_on(levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
    """Return the linear extrapolation to `level` of the last two displacements of a path.

    Parameters
    ----------
    levels, path
        Loads, and the displacements (n, 3) there; a path of one is not extrapolated.
    """
    if len(path) < 2:
        return path[-1]
    ratio = (level - levels[-1]) / (levels[-1] - levels[-2])
    return path[-1] + ratio * (path[-1] - path[-2])


def lagrange(x: Array, values: Array, position: float) -> Array:
    """Return the value (nodes, 3) at `position` of the polynomial through k values.

    Parameters
    ----------
    x, values : array
        The positions (k,) and the values there, (k, nodes, 3).
    """
    weights = []
    for a in range(len(x)):
        others = [b for b in range(len(x)) if b != a]
        weights.append(math.prod((position - x[b]) / (x[a] - x[b]) for b in others))
    return np.einsum("a,ank->nk", weights, values)
