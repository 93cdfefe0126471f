"""A comparison of a fit: the model of a test, its solver, and what was measured in the test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
import scipy

from ..errors import InputError, SolverFailure
from ..light_dataclasses import dataclass
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..processes import run_side_by_side
from ..solvers.base import DifferentiatingSolver, History, Solver
from .nuisance import Nuisance
from .objective import Objective

V = TypeVar("V")
SparseArray = Any  # scipy.sparse.csc_array, which has no types
#: Largest predicted change of the displacements, relative to the largest, for a warm start. A far
#: guess can lead to another equilibrium branch (a soft membrane may fold), on which a fit then
#: settles; only near by is the warm start both safe and worth something.
MAX_WARM_CHANGE = 0.02


@dataclass(frozen=True, eq=False)
class WarmStart:
    """The last run with derivatives, from which runs at nearby parameters may start.

    Before the first one it is the last run without, from which a run at the same may start.

    Attributes
    ----------
    parameters : (p,) array
        Values of the run.
    path : array
        Solution of every increment, as in `History.path`.
    slope : array or None
        Derivative of the path by the parameters.
    """

    parameters: Array
    path: Array
    slope: Array | None

    def guess(self, parameters: Array) -> Array | None:
        """Return the path predicted for other parameters (p,); None where it changes too much."""
        if self.slope is None:
            return self.path if np.array_equal(parameters, self.parameters) else None
        change = np.tensordot(self.slope, parameters - self.parameters, 1)
        if np.abs(change).max() > MAX_WARM_CHANGE * np.abs(self.path).max():
            return None
        return self.path + change


@dataclass(frozen=True, eq=False)
class ErrorColumns:
    """Changes of m residuals by k random errors that are independent of each other.

    Attributes
    ----------
    changes : (m, k) sparse array
        Changes of the residuals by one standard deviation of each error, the model's or the data's,
        without that of the values that are compared.
    sources : (m, k) sparse array
        Where noise of the compared values makes an error: the orthonormal combination of their
        noises, each in its standard deviations, that is the error in standard deviations. Zero
        where the error is independent of them.
    """

    changes: SparseArray
    sources: SparseArray

    @classmethod
    def independent(cls, changes: Array | SparseArray) -> ErrorColumns:
        """Return errors that are independent of the compared values."""
        columns = scipy.sparse.csc_array(changes)
        return cls(columns, scipy.sparse.csc_array(columns.shape))

    @classmethod
    def joined(cls, parts: Sequence[ErrorColumns]) -> ErrorColumns:
        """Return the errors of all parts."""
        changes, sources = (
            scipy.sparse.hstack(columns, format="csc")
            for columns in zip(*((part.changes, part.sources) for part in parts), strict=True)
        )
        return cls(changes, sources)

    def principal(self, sigma: Array, *, max_columns: int = 1000) -> tuple[SparseArray, Array]:
        """Return orthonormal directions of the changes over `sigma` (m,), and sizes along them.

        More than `max_columns` errors, which are those of single places, are taken as orthogonal.
        """
        columns = scipy.sparse.diags_array(1.0 / sigma) @ self.changes
        if columns.shape[1] <= max_columns:
            directions, sizes, _ = np.linalg.svd(columns.toarray(), full_matrices=False)
            return directions, sizes
        sizes = np.sqrt(np.asarray(columns.power(2).sum(axis=0)))
        return columns @ scipy.sparse.diags_array(1.0 / np.maximum(sizes, 1e-300)), sizes

    def at_rows(self, rows: slice, count: int) -> ErrorColumns:
        """Return the errors as those of `count` residuals, of which `rows` are these."""
        width = self.changes.shape[1]
        upper = scipy.sparse.csc_array((rows.start, width))
        lower = scipy.sparse.csc_array((count - rows.stop, width))
        changes, sources = (
            scipy.sparse.vstack([upper, columns, lower], format="csc")
            for columns in (self.changes, self.sources)
        )
        return ErrorColumns(changes, sources)


class SharedErrors(Protocol):
    """Random errors of what was measured beside the compared values, as the shape of a sheet."""

    def __call__(
        self,
        comparison: Comparison,
        law: HypoelasticLaw,
        nuisance: Mapping[str, float],
        history: History,
    ) -> ErrorColumns:
        """Return the changes of the residuals by these errors.

        Parameters
        ----------
        comparison : Comparison
        law : HypoelasticLaw
            The law of the best fit.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.
        history : History
            Run of the comparison with both.
        """


@runtime_checkable
class LearningSolver(Protocol):
    """A solver that learns derivatives from runs of a program, which it counts.

    Attributes
    ----------
    runs, cached : int
        Numbers of runs so far, and of those that came from the cache.
    """

    runs: int
    cached: int

    def forget(self) -> None:
        """Drop what was learnt."""


class ComparisonState(NamedTuple):
    """Hold what analyses change of a comparison."""

    warm_start: WarmStart | None
    objective: Objective

    def is_same(self, other: ComparisonState) -> bool:
        """Return whether both have the same objects."""
        return self.warm_start is other.warm_start and self.objective is other.objective


@dataclass(eq=False)
class Comparison:
    """A model that should show what was measured, with the solver that runs it.

    Attributes
    ----------
    name : str
        Name of the test ("bubble 1", "strips 1: warp"), different from all others of a fit.
    model : object
        Plain data that describe the test to the solver.
    solver : Solver
    objective : Objective
        What was measured, and how the model is compared with it.
    nuisance : tuple of Nuisance
        Unknowns of this test beside the law, as an offset of its load.
    stage : int
        A fit of several comparisons begins with those of the lowest stages alone, see
        `search.approach`.
    contracts : bool
        Whether the sheet contracts freely under tension, so that the law has to be positive
        definite.
    must_be_stable : bool
        Whether an unstable equilibrium is refused.
    prolong : callable, optional
        Function that makes of the path of a coarser model the start of a run of this finer one.
    surrogate : Solver, optional
        What leads the fit by its derivatives in place of the solver.
    shared_errors : callable, optional
        See `SharedErrors`; None where each value errs alone, or with its neighbours.
    weight : float
        Factor that a project gives all residuals, 1 by default; the objective has them with it.
    warm_start : WarmStart, optional
        The last solution with derivatives.
    seconds : float
        Processor time of the last run; 0 before the first.
    """

    name: str
    model: Any
    solver: Solver
    objective: Objective
    nuisance: tuple[Nuisance, ...] = ()
    stage: int = 0
    contracts: bool = False
    must_be_stable: bool = True
    prolong: Callable[[Array], Array] | None = None
    shared_errors: SharedErrors | None = None
    surrogate: Solver | None = None
    weight: float = 1.0
    warm_start: WarmStart | None = field(default=None, repr=False)
    seconds: float = 0.0

    @property
    def state(self) -> ComparisonState:
        """Return what analyses change of it."""
        return ComparisonState(self.warm_start, self.objective)

    @state.setter
    def state(self, state: ComparisonState) -> None:
        self.warm_start, self.objective = state

    @property
    def may_run_aside(self) -> bool:
        """Return whether a copy of this process may run the model: its solver learns nothing."""
        return not (self.solver.external or isinstance(self.solver, LearningSolver))

    def forget(self) -> None:
        """Drop the warm start until the next differentiated run."""
        self.warm_start = None
        if isinstance(self.solver, LearningSolver):
            self.solver.forget()

    def run(
        self,
        law: HypoelasticLaw,
        free: Sequence[int],
        nuisance: Mapping[str, float],
        warm: bool,
        coarse_run: History | None = None,
    ) -> History:
        """Run the model without derivatives.

        Parameters
        ----------
        law : HypoelasticLaw
        free : sequence of int
            Entries of the law's beta that vary between runs.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.
        warm : bool
            Whether each increment starts from the last solution with derivatives (`WarmStart`).
        coarse_run : History, optional
            Run of the comparison that this one refines, from which this one then starts.

        Raises
        ------
        SolverFailure
            The run did not end well.
        """
        values = self._model_values(nuisance)
        model = self.model_at(nuisance)
        if not isinstance(self.solver, DifferentiatingSolver):
            return self.solver.run(model, law)
        parameters = self._parameters(law, free, values)
        guess = self._guess(parameters) if warm else None
        if coarse_run is not None and coarse_run.path is not None and self.prolong is not None:
            guess = self.prolong(coarse_run.path)
        history = self.solver.run(model, law, guess=guess)
        if history.path is not None and (self.warm_start is None or self.warm_start.slope is None):
            self.warm_start = WarmStart(parameters, history.path, None)
        return history

    def differentiate(
        self,
        law: HypoelasticLaw,
        free: Sequence[int],
        nuisance: Mapping[str, float],
        warm: bool,
    ) -> tuple[History, Array]:
        """Run the model with derivatives, and keep the path for a warm start.

        Parameters
        ----------
        law, free, nuisance, warm
            See `run`.

        Returns
        -------
        History
            The run.
        (m, free + nuisance) array
            Derivatives of the residuals by the free coefficients (1/MPa), then by the nuisance
            parameters in their units.

        Raises
        ------
        SolverFailure
            The run did not end well, or the solver gives no derivatives.
        """
        if not isinstance(self.solver, DifferentiatingSolver):
            raise SolverFailure(f"{self.solver.name} gives no derivatives", self.solver.name)
        values = self._model_values(nuisance)
        parameters = self._parameters(law, free, values)
        history, slope = self.solver.run_with_sensitivity(
            self.model_at(nuisance),
            law,
            [*(f"beta_{i}" for i in free), *values, *self._law_parameters],
            guess=self._guess(parameters) if warm else None,
        )
        if history.path is not None and history.path_slope is not None:
            self.warm_start = WarmStart(parameters, history.path, history.path_slope)
        by_parameter = self.objective.at(nuisance).jacobian(history, slope)
        if all(n.model_parameter is not None and n.scale == 1.0 for n in self.nuisance):
            return history, by_parameter
        by_nuisance = self._nuisance_columns(by_parameter[:, len(free) :], nuisance, history)
        return history, np.column_stack([by_parameter[:, : len(free)], *by_nuisance])

    def _nuisance_columns(
        self, by_solver: Array, nuisance: Mapping[str, float], history: History
    ) -> list[Array]:
        """Return the derivatives (m,) of the residuals by each nuisance parameter, in their order.

        Parameters
        ----------
        by_solver : (m, k) array
            Derivatives by the parameters of the model, then by those of the law.
        nuisance : mapping of str to float
            Values of the nuisance parameters by name.
        history : History
        """
        # In the order in which `differentiate` names the parameters to the solver.
        scales = {n.name: n.scale for n in self.nuisance if n.model_parameter is not None}
        scales |= {n.name: n.scale for n in self.nuisance if n.law_parameter is not None}
        columns: dict[str, Array] = {}
        objective_names = [n.name for n in self.nuisance if n.name not in scales]
        if objective_names:
            by_objective = self.objective.nuisance_columns(objective_names, nuisance, history)
            columns.update(zip(objective_names, by_objective.T, strict=True))
        for (name, scale), column in zip(scales.items(), by_solver.T, strict=True):
            columns[name] = scale * column
        return [columns[n.name] for n in self.nuisance]

    def _model_values(self, nuisance: Mapping[str, float]) -> dict[str, float]:
        """Return the changes of the model's parameters by the nuisance, in units of the model."""
        return {
            n.model_parameter: n.scale * (nuisance[n.name] - n.start)
            for n in self.nuisance
            if n.model_parameter is not None
        }

    def model_at(self, nuisance: Mapping[str, float]) -> Any:
        """Return the model at nuisance values by name; raise SolverFailure where there is none."""
        values = self._model_values(nuisance)
        if not values:
            return self.model
        try:
            return self.model.with_parameters(values)
        except InputError as error:
            raise SolverFailure(f"there is no such model: {error}", self.solver.name) from None

    @property
    def _law_parameters(self) -> list[str]:
        """Return the law's parameters that are nuisance parameters of the comparison."""
        return [n.law_parameter for n in self.nuisance if n.law_parameter is not None]

    def _parameters(
        self, law: HypoelasticLaw, free: Sequence[int], values: Mapping[str, float]
    ) -> Array:
        """Return the varying parameters in the order in which the solver differentiates by them."""
        law_values = [law.number(name) for name in self._law_parameters]
        return np.concatenate([law.beta[list(free)], list(values.values()), law_values])

    def _guess(self, parameters: Array) -> Array | None:
        """Return the path that the last run suggests at parameters (p,); None if there was none."""
        return None if self.warm_start is None else self.warm_start.guess(parameters)


def run_tasks_of(comparisons: Sequence[Comparison], do: Callable[[int], V], count: int) -> list[V]:
    """Return the results of tasks on comparisons, done by copies of this process where it may.

    The tasks are numbered from 0 to `count` - 1, and count as equally long.
    """
    if all(comparison.may_run_aside for comparison in comparisons):
        return run_side_by_side(do, count)
    return [do(number) for number in range(count)]
