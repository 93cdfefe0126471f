"""Objectives of comparisons: residuals between model and data in blocks, and the data's noise.

A block holds the residuals of one quantity, as one displacement component in one frame of a test.
Also here: an objective whose residuals a user's own function computes from modelled and measured
values.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials.forms.base import Array
from ..solvers.base import History

#: How the noise of an objective's data is known: given by the project, from the scatter of the
#: specimens, or assumed as usual for such an instrument.
NoiseIs = Literal["given", "specimens' scatter", "assumed"]


class Objective(ABC):
    """The residuals of one comparison in blocks, with the unit and noise of its data.

    A subclass has to define the first four attributes and the abstract methods; all other members
    have a default for data of which they are not known.

    Attributes
    ----------
    unit : str
        Unit of the data: "mm", "N", "%".
    least_noise : float
        Standard deviation of the noise of one measured value, in `unit`.
    sizes : tuple of int
        Number of residuals of each block; m is their sum.
    scale : (m,) array
        Deviation of a value, in `unit`, that makes a residual of one.
    noise_is : str
        How `least_noise` is known, see `NoiseIs`.
    correlated_count : float
        Least number of values that err together, as those of one specimen do.
    specimens : (m,) int array, optional
        Number of the specimen that each value belongs to.
    columns : int
        Number of successive blocks that a user's function (`FunctionObjective`) takes as columns of
        one array: 3 for the components of displacements, 1 for loads; 0 where there is no such
        array.
    quantities : sequence of str
        Names of the quantities of successive blocks, again and again; empty for a single one.
    is_exchangeable : bool
        Whether the data do not tell warp from fill, as heights at the centre of a circular sheet.
    is_curved_in_shear : bool
        Whether E1 and E2 depend on an unknown G12 along a curve, as those of a few gauges.
    weighs_by_noise : bool
        Whether blocks have so few values that norms say little of their noise: a fit of such data
        and of curves weighs squares by the stated noise, up to ten times of it.
    """

    unit: str
    least_noise: float
    sizes: tuple[int, ...]
    scale: Array
    noise_is: NoiseIs = "assumed"
    correlated_count: float = 1.0
    specimens: NDArray[Any] | None = None
    columns: int = 0
    quantities: Sequence[str] = ()
    is_exchangeable: bool = False
    is_curved_in_shear: bool = False
    weighs_by_noise: bool = False

    @property
    @abstractmethod
    def data(self) -> tuple[Array, ...]:
        """Return all measured arrays, by which a stored result is recognised as one of them."""

    @abstractmethod
    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        """Return the residuals of a run, block after block.

        Parameters
        ----------
        history : History
            Run of the model.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.

        Returns
        -------
        (m,) array
        """

    @abstractmethod
    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives of the residuals by the parameters of a run.

        Parameters
        ----------
        history : History
            Run of the model, which may contain derivatives of its loads.
        slope : (frames, nodes, 3, parameters) array
            Derivatives of the model's displacements, mm per unit of each parameter.

        Returns
        -------
        (m, parameters) array
        """

    @abstractmethod
    def shifted(self, external: History, surrogate: History) -> Objective:
        """Return the objective for a surrogate that takes the place of an external solver.

        Parameters
        ----------
        external, surrogate : History
            Runs of both solvers at the same unknowns; the data are shifted by their difference.
        """

    @property
    def measured(self) -> Array:
        """Return the measured values in `unit`; empty where they are not compared themselves."""
        return np.zeros(0)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return where the values of each block were measured, for the correlation of their errors.

        (n, 2) in mm on a sheet, or (n, 1) along a curve; empty where this is not known.
        """
        return ()

    def at(self, nuisance: Mapping[str, float]) -> Self:
        """Return the objective with its data where values of nuisance parameters put them.

        Where they do not say where data lie, it is the same objective.

        Parameters
        ----------
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.
        """
        return self

    def rounding(self, history: History) -> float:
        """Return the part of e that the digits of a run's results make; 0 where not known."""
        return 0.0

    def causes(self, history: History) -> dict[str, Array]:
        """Return what may be wrong in such a test, as `discrepancy.ranked_causes` takes it.

        The keys describe a cause with a `{}` for each of its k amounts, the values (m, k) are the
        change of the residuals by one unit of each amount.
        """
        return {}

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        """Return derivatives of the residuals by nuisance parameters of the data, as an offset.

        Parameters
        ----------
        names : sequence of str
            Those parameters, which neither the model nor the law has.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.
        history : History
            Run of the model with these.

        Returns
        -------
        (m, names) array
        """
        raise NotImplementedError(f"{type(self).__name__} has no nuisance")

    def split(self, values: Array) -> list[Array]:
        """Return values (m, ...) of the residuals, block by block."""
        return np.split(values, np.cumsum(self.sizes)[:-1])

    def spread_over_residuals(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Spread a value of each measured point over the residuals that belong to the point.

        Parameters
        ----------
        values : (points,) array
            A number or flag for each point.

        Returns
        -------
        (m,) array or None
            None where it is not known which residual belongs to which point.
        """
        return None


MIN_NORM = 1e-14  # a block with a smaller norm counts as fitted exactly, and has no slope


class Blocks:
    """Where each block lies in a residual vector, and the norms of the blocks.

    Parameters
    ----------
    sizes : sequence of int
        Number of residuals of each block; m is their sum.
    least_norms : (blocks,) array, optional
        Norm of each block below which only its square counts; zero by default.
    columns : sequence of (k,) int arrays, optional
        The unknowns on which the residuals of each block depend; all by default.

    Attributes
    ----------
    starts : (blocks,) int array
        Index of the first residual of each block.
    block_of : (m,) int array
        Index of the block that each residual belongs to.
    """

    def __init__(
        self,
        sizes: Sequence[int],
        least_norms: Array | None = None,
        columns: Sequence[NDArray[np.intp]] | None = None,
    ) -> None:
        self.columns = columns
        self.sizes = tuple(int(size) for size in sizes)
        self.least_norms = np.zeros(len(self.sizes)) if least_norms is None else least_norms
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        self.block_of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Return the norm of each block, (blocks,), of a residual (m,).

        With the scale of an objective it is an RMS error relative to what was measured.
        """
        return np.sqrt(np.add.reduceat(residual**2, self.starts))

    def value(self, residual: Array) -> float:
        """Return the objective e, the sum of the norms of the blocks of a residual (m,)."""
        return float(self.norms(residual).sum())

    def merit(self, residual: Array) -> float:
        """Return what is minimised: e, but with the square of a norm that is below its least."""
        norms = self.norms(residual)
        limited = np.maximum(np.maximum(norms, self.least_norms), MIN_NORM)
        return float(0.5 * (norms**2 / limited + limited).sum())

    def gradient(self, residual: Array, jacobian: Array) -> Array:
        """Return the slope of e, (unknowns,); a block that fits exactly contributes nothing.

        Parameters
        ----------
        residual : (m,) array
        jacobian : (m, unknowns) array
        """
        norms = np.maximum(self.norms(residual), MIN_NORM)
        return (residual / norms[self.block_of]) @ jacobian

    def gradients(self, residual: Array, jacobian: Array) -> Array:
        """Return half of the slope of the squared norm of each block, (blocks, unknowns).

        Parameters
        ----------
        residual : (m,) array
        jacobian : (m, unknowns) array
        """
        return np.array([residual[rows] @ jacobian[rows] for rows in self._rows])

    def gram(self, jacobian: Array, weights: Array) -> Array:
        """Return the weighted sum of J'J over the blocks, (unknowns, unknowns).

        Parameters
        ----------
        jacobian : (m, unknowns) array
            J of all blocks.
        weights : (blocks,) array
        """
        count = jacobian.shape[1]
        total = np.zeros((count, count))
        columns = self.columns or [np.arange(count)] * len(self.sizes)
        for rows, columns_of_block, weight in zip(self._rows, columns, weights, strict=True):
            part = jacobian[rows, columns_of_block]
            total[np.ix_(columns_of_block, columns_of_block)] += weight * (part.T @ part)
        return total

    @cached_property
    def _rows(self) -> list[slice]:
        """Return where the residuals of each block lie."""
        return [
            slice(start, start + size) for start, size in zip(self.starts, self.sizes, strict=True)
        ]


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
        self,
        inner: Any,
        function: Callable[..., Any],
        relative: bool,
        weight: float,
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
            of_close_model = self._values(0.9 * inner.measured)
        # What the function returns for two models tells it from another one (`data`).
        self._data = (*inner.data, of_still_model, of_close_model)
        blocks = Blocks(self.sizes)
        divisor = np.ones(len(self.sizes))
        if relative:
            largest = np.maximum.reduceat(np.abs(of_still_model), blocks.starts)
            is_usable = np.isfinite(largest) & (largest > 0)
            divisor = np.where(is_usable, largest, 1.0) * len(largest)
        self._divisor = (divisor * np.sqrt(self.sizes) / weight)[blocks.block_of]
        self.scale = self._divisor / self._noise_gain(blocks)[blocks.block_of]

    @property
    def data(self) -> tuple[Array, ...]:
        return self._data

    def _noise_gain(self, blocks: Blocks) -> Array:
        """Return the noise of each block's residuals over that of the values; 1 where unknown."""
        measured = self.inner.measured
        noise = self.least_noise or DIFFERENCE * np.abs(measured).max()
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (1 + NOISE_PROBES, len(measured)))
        # Not at the measured values themselves, where a norm has no slope.
        modelled = measured + noise * signs[0]
        changes = [self._change(modelled, probe) for probe in signs[1:]]
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
        """Return values `flat` (m,) as the function takes them: loads, or frames (n, columns)."""
        parts = self.inner.split(flat)
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
        return difference / (2 * step)

    def _modelled(self, history: History) -> Array:
        """Return the modelled values (m,), in the unit of the data."""
        deviation = self.inner.residual(history, {}) * self.inner.scale
        return self.inner.measured + deviation + self.shift

    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        return self._values(self._modelled(history)) / self._divisor

    def jacobian(self, history: History, slope: Array) -> Array:
        modelled = self._modelled(history)
        changes = self.inner.jacobian(history, slope).T
        columns = [self._change(modelled, self.inner.scale * change) for change in changes]
        return np.column_stack(columns) / self._divisor[:, None]

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        problem = f"leave out {', '.join(names)}: a function of one's own has to allow for them"
        raise InputError(None, "objective", problem)

    def shifted(self, external: History, surrogate: History) -> FunctionObjective:
        objective = copy.copy(self)
        objective.shift = self.shift + self._modelled(external) - self._modelled(surrogate)
        return objective
