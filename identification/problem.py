"""One fit as a function of its unknowns: residuals, Jacobian, feasibility, and a count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from ..solvers.base import DifferentiatingSolver, History, Solver
from .objective import FieldObjective
from .parameters import ModuliParameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """An analysis that ended well, seen by the optimiser.

    coefficients (free,) MPa; residual (m,); jacobian (m, unknowns) or None; value: e of Eq. 4.8.
    """

    unknowns: Array
    coefficients: Array
    residual: Array
    value: float
    jacobian: Array | None
    history: History

    @property
    def stable(self) -> bool:
        """Not known to be an unstable equilibrium, which no test under pressure can show."""
        return self.history.stable is not False


#: Called after every analysis with unknowns, e (None when it failed), what happened, who ran it.
Watch = Callable[[Array, float | None, str, str], None]


#: Status of an analysis whose equilibrium no test can show.
UNSTABLE = "unstable equilibrium"
#: Largest predicted change of displacement, relative, for a warm start.
NEAR = 0.02


@dataclass(eq=False)
class FieldProblem:
    """Model, solver, measured fields and unknowns of one fit.

    `law` carries nu12, strain range and thickness option; its beta is replaced. `surrogate`: the
    same problem for a solver that differentiates, where this one's does not.
    """

    model: Any
    solver: Solver
    law: HypoelasticLaw
    objective: FieldObjective
    parameters: ModuliParameters
    watch: Watch | None = None
    surrogate: FieldProblem | None = None
    analyses: int = 0
    unstable: int = 0  # of them, ended in an equilibrium that no test can show
    warm_starts: bool = True
    _last: tuple[Array, Array, Array] | None = field(default=None, repr=False)

    def reset(self) -> None:
        """Forget the warm start and the count: every start of a study begins alike."""
        self.analyses, self.unstable, self.warm_starts = 0, 0, True
        self._last = None
        if self.surrogate is not None:
            self.surrogate.reset()

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run the model at unknowns y; None when the analysis did not end well (Eq. 4.9).

        `warm`: start each increment from the last differentiated solution and its slope.
        """
        self.analyses += 1
        guess = self._guess(y, warm)
        beta = self.parameters.beta(y)
        offset, pressure = self.parameters.offsets(y)
        law = self.law.with_beta(beta)
        try:
            if with_jacobian:
                history, slope = self._differentiated(y, law, pressure, guess)
            else:
                history, slope = self._plain(law, pressure, guess), None
        except SolverFailure as failure:
            self._report(y, None, failure.reason)
            return None
        residual = self.objective.residual(history.displacement, offset)
        if not np.isfinite(residual).all():
            self._report(y, None, "displacements are not finite")
            return None
        jacobian = None
        if slope is not None:
            jacobian = self._chain(slope)
        value = self.objective.value(residual)
        coefficients = beta[self.parameters.places]
        point = Evaluation(y.copy(), coefficients, residual, value, jacobian, history)
        self.unstable += not point.stable
        self._report(y, value, "ok" if point.stable else UNSTABLE)
        return point

    def _report(self, y: Array, value: float | None, status: str) -> None:
        if self.watch is not None:
            self.watch(y, value, status, self.solver.name)

    def _names(self) -> list[str]:
        names = [f"beta_{i}" for i in self.parameters.places]
        return [*names, "pressure_offset"] if self.parameters.pressure_offset else names

    def _guess(self, y: Array, warm: bool) -> Array | None:
        if not (warm and self.warm_starts) or self._last is None:
            return None
        before, path, slope = self._last
        change = slope @ self._solver_steps(y - before)
        # A far guess can lead to another equilibrium branch (a soft membrane may fold), on which
        # a fit then settles; only near by is the warm start both safe and worth something.
        if np.abs(change).max() > NEAR * np.abs(path).max():
            return None
        return np.asarray(path + change)

    def _solver_steps(self, dy: Array) -> Array:
        """Step in the solver's parameters (coefficients MPa, pressure offset MPa)."""
        step = self.parameters.to_coefficients @ dy[: self.parameters.size]
        if self.parameters.pressure_offset:
            step = np.append(step, 1e-3 * dy[-1])
        return np.asarray(step)

    def _differentiated(
        self, y: Array, law: HypoelasticLaw, pressure: float, guess: Array | None
    ) -> tuple[History, Array]:
        if not isinstance(self.solver, DifferentiatingSolver):
            raise SolverFailure(f"{self.solver.name} gives no derivatives", self.solver.name)
        history, slope = self.solver.run_with_sensitivity(
            self.model, law, self._names(), pressure, guess
        )
        if history.path is not None and history.path_slope is not None:
            self._last = (y.copy(), history.path, history.path_slope)
        return history, slope

    def _plain(self, law: HypoelasticLaw, pressure: float, guess: Array | None) -> History:
        if isinstance(self.solver, DifferentiatingSolver):
            return self.solver.run(self.model, law, pressure_offset=pressure, guess=guess)
        model = self.model if pressure == 0.0 else self.model.with_pressure_offset(pressure)
        return self.solver.run(model, law)

    def _chain(self, slope: Array) -> Array:
        """Jacobian by the unknowns from the slope by the solver's parameters."""
        p = self.parameters
        by_solver = self.objective.jacobian(slope)
        columns = [by_solver[:, : p.size] @ p.to_coefficients]
        if p.displacement_offset:
            columns.append(self.objective.offset_columns())
        if p.pressure_offset:
            columns.append(1e-3 * by_solver[:, p.size :])
        return np.concatenate(columns, axis=1)
