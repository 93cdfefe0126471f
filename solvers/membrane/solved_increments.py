"""Choice of the increments that are solved, and reading of results at those between them."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...materials.cubic_curves import hermite_slope_weights, hermite_weights, spline_slopes

Array = NDArray[np.float64]
#: Largest value, over the step, of a cubic that is zero at its ends and has slopes 0 and 1 there.
CUBIC_BOUND = 4 / 27


class SolvedIncrements:
    """Increments that are solved, chosen by the curvature of the response as it is computed.

    A step spans several increments where the cubic that is read between its ends, from values and
    slopes there, differs little from that of the step before. The first three have no step between.

    Parameters
    ----------
    levels : (n,) array
        Increasing load levels of all increments.
    smallest_count : int
        Of increments that are solved: in how many steps the law has to follow the path of strain.
    error : float
        Of a response that is read, as a share of the largest so far.
    """

    def __init__(self, levels: Array, smallest_count: int = 10, error: float = 1e-4) -> None:
        self.levels = levels
        self.allowed_error = error
        self.longest_step = max(1, len(levels) // smallest_count)
        self.step = 1
        self.solved: list[int] = []
        self._responses = list[float]()
        self._slopes = list[float]()
        self._is_stable = list[bool]()

    @property
    def previous(self) -> int:
        """Return the index of the last solved increment, -1 for none."""
        return self.solved[-1] if self.solved else -1

    @property
    def current(self) -> int:
        """Return the index of the increment to solve."""
        return min(self.previous + self.step, len(self.levels) - 1)

    @property
    def are_complete(self) -> bool:
        """Return whether the last increment is solved."""
        return self.previous == len(self.levels) - 1

    @property
    def unstable(self) -> NDArray[np.intp]:
        """Return the indices of unstable increments, as stability does not change within a step."""
        step_ends = np.searchsorted(self.solved, np.arange(len(self.levels)))
        return np.flatnonzero(~np.array(self._is_stable)[step_ends])

    def accept(self, response: float, slope: float, is_stable: bool = True) -> bool:
        """Accept the current increment by its response; return whether it ends a step.

        If not, the step is too long, and a nearer increment becomes the current one.

        Parameters
        ----------
        response, slope : float
            The response, such as a load, and its derivative by the level.
        is_stable : bool
            Whether the equilibrium is stable; a step ends where that changes.
        """
        i = self.current
        span = i - self.previous
        error = self._reading_error(i, response, slope)
        is_change = bool(self.solved) and is_stable != self._is_stable[-1]
        if (error > 1.0 or is_change) and span > 1:
            self.step = span // 2
            return False
        self.solved.append(i)
        self._responses.append(response)
        self._slopes.append(slope)
        self._is_stable.append(is_stable)
        # The error grows with the fourth power of the step.
        if len(self.solved) > 2 and 2**4 * error < 1.0:
            self.step = min(2 * span, self.longest_step)
        return True

    def _reading_error(self, i: int, response: float, slope: float) -> float:
        """Return the error of a reading within the step to i, over that which is allowed."""
        if len(self.solved) < 2 or self.longest_step == 1:
            return 0.0
        knots = self.levels[self.solved[-2:]]
        by_value, by_slope = hermite_slope_weights(knots, self.levels[[i]])
        cubic_slope = by_value @ self._responses[-2:] + by_slope @ self._slopes[-2:]
        step = self.levels[i] - knots[-1]
        deviation = CUBIC_BOUND * step * abs(slope - float(cubic_slope[0]))
        largest = np.abs([*self._responses, response]).max()
        return float(deviation / (self.allowed_error * largest))

    def read(self, values: Array, slopes: Array | None = None) -> Array:
        """Return values at all increments (n, ...) from those at solved ones.

        Parameters
        ----------
        values : (solved, ...) array
        slopes : (solved, ...) array, optional
            Derivatives by the level; those of a cubic spline unless given.
        """
        if len(values) == len(self.levels):
            return values
        by_value, by_slope = self._weights
        if slopes is None:
            by_value = by_value + by_slope @ spline_slopes(self.levels[self.solved])
        reading = np.tensordot(by_value, values, 1)
        if slopes is not None:
            reading += np.tensordot(by_slope, slopes, 1)
        reading[self.solved] = values
        return reading

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        return hermite_weights(self.levels[self.solved], self.levels)
