"""An objective whose residuals a user's own function computes from modelled and measured values."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..materials.forms.base import Array
from ..solvers.base import History
from .blocks import Blocks
from .objective import Objective

DIFFERENCE = 1e-5  # step of a central difference, relative to the largest modelled value
NOISE_PROBES = 4  # random changes of the data that show how the function passes on their noise


class FunctionObjective(Objective):
    """Residuals that a user's function computes from modelled and measured values.

    Parameters
    ----------
    inner : Objective
        The objective that has the values; its `columns` is not 0.
    function : callable
        Function of the modelled and of the measured values, each an array (frames, points, 3) of
        displacements, a list of (points, 3) where frames differ in their points, or loads (points,)
        of a curve. It returns a vector of deviations or a list of them; the objective e is the sum
        of their RMS. Its attribute `derivative`, if it has one, is a function of the same two and
        of a change of the modelled values, and returns the change of the same vectors; without it,
        central differences are taken.
    relative : bool
        Whether each vector is divided by its largest entry for a model that does not move, and by
        the number of vectors, so that e is a mean.
    weight : float
        Factor of all residuals.
    """

    def __init__(
        self, inner: Any, function: Callable[..., Any], relative: bool = False, weight: float = 1.0
    ) -> None:
        self.inner = inner
        self.function = function
        self.derivative = getattr(function, "derivative", None)
        self.shift = np.zeros_like(inner.measured)
        self.unit = inner.unit
        self.least_noise = inner.least_noise
        self.noise_is = inner.noise_is
        with np.errstate(all="ignore"):  # a model that does not move may have no logarithm
            self.sizes = tuple(map(len, self._vectors(function, self.shift)))
            of_still_model = self._values(0.0 * inner.measured)
            close = self._values(0.9 * inner.measured)
        self._data = (*inner.data, of_still_model, close)
        blocks = Blocks(self.sizes)
        largest = np.maximum.reduceat(np.abs(of_still_model), blocks.starts)
        usable = relative & np.isfinite(largest) & (largest > 0)
        unit = np.where(usable, largest, 1.0) * (len(largest) if relative else 1)
        self._unit = (unit * np.sqrt(self.sizes) / weight)[blocks.of]
        self.scale = self._unit / self._noise_gain(blocks)[blocks.of]

    @property
    def data(self) -> tuple[Array, ...]:
        return self._data

    def _noise_gain(self, blocks: Blocks) -> Array:
        """Return the noise of each block's residuals over that of the values; 1 where unknown."""
        measured = self.inner.measured
        size = self.least_noise or DIFFERENCE * np.abs(measured).max()
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (1 + NOISE_PROBES, len(measured)))
        origin = measured + size * signs[0]
        changes = [self._change(origin, probe) for probe in signs[1:]]
        rms = np.sqrt(np.mean(np.square(changes), axis=0))
        gain = blocks.norms(rms) / np.sqrt(self.sizes)
        return np.where(np.isfinite(gain) & (gain > 0), gain, 1.0)

    def _vectors(self, function: Any, *values: Array) -> list[Array]:
        """Return the vectors that a function returns for modelled values (and a change of them)."""
        modelled, *change = map(self._arranged, values)
        result = function(modelled, self._arranged(self.inner.measured), *change)
        is_list = isinstance(result, (list, tuple)) and all(map(np.ndim, result))
        vectors = result if is_list else [result]
        return [np.ravel(np.asarray(vector, dtype=float)) for vector in vectors]

    def _arranged(self, flat: Array) -> Any:
        """Return values (m,) as the function takes them: loads, or frames (points, columns)."""
        parts = np.split(flat, np.cumsum(self.inner.sizes)[:-1])
        columns = self.inner.columns
        if columns == 1:
            return parts[0]
        starts = range(0, len(parts), columns)
        frames = [np.stack(parts[k : k + columns], axis=1) for k in starts]
        has_equal_frames = len(set(map(len, frames))) == 1
        return np.stack(frames) if has_equal_frames else frames

    def _values(self, *values: Array) -> Array:
        """Return all vectors in one, (m,), or its change if a change of the values is given."""
        vectors = self._vectors(self.derivative if values[1:] else self.function, *values)
        sizes = tuple(map(len, vectors))
        if sizes != self.sizes or 0 in self.sizes:
            problem = f"expected vectors of {self.sizes} residuals, got {[*sizes]}"
            raise InputError(None, "objective", problem)
        return np.concatenate(vectors)

    def _change(self, modelled: Array, change: Array) -> Array:
        """Return the change (m,) of the residuals by a change of the modelled values."""
        if self.derivative is not None:
            return self._values(modelled, change)
        step = DIFFERENCE * np.abs(modelled).max() / max(float(np.abs(change).max()), 1e-300)
        change = step * change
        difference = self._values(modelled + change) - self._values(modelled - change)
        return np.asarray(difference / (2 * step))

    def _modelled(self, history: History) -> Array:
        """Return the modelled values (m,), in the unit of the data."""
        deviation = self.inner.residual(history, {}) * self.inner.scale
        return np.asarray(self.inner.measured + deviation + self.shift)

    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        return self._values(self._modelled(history)) / self._unit

    def jacobian(self, history: History, slope: Array) -> Array:
        modelled = self._modelled(history)
        changes = self.inner.jacobian(history, slope).T
        columns = [self._change(modelled, self.inner.scale * change) for change in changes]
        return np.column_stack(columns) / self._unit[:, None]

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        problem = f"leave out {', '.join(names)}: a function of one's own has to allow for them"
        raise InputError(None, "objective", problem)

    def shifted(self, external: History, surrogate: History) -> FunctionObjective:
        objective = copy.copy(self)
        objective.shift = self.shift + self._modelled(external) - self._modelled(surrogate)
        return objective
