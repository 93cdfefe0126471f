"""One fit as a function of its unknowns: residuals, Jacobian, feasibility, and a count."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from ..solvers.base import History, Solver
from .blocks import Blocks
from .experiment import Experiment
from .parameters import ModuliParameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """An analysis that ended well, seen by the optimiser.

    coefficients (free,) MPa; residual (m,); jacobian (m, unknowns) or None; value: e of Eq. 3.7
    or 4.8; histories: one a test.
    """

    unknowns: Array
    coefficients: Array
    residual: Array
    value: float
    jacobian: Array | None
    histories: tuple[History, ...]

    @property
    def stable(self) -> bool:
        """Not known to be an unstable equilibrium, which no test under load can show."""
        return all(history.stable is not False for history in self.histories)


#: Called after every analysis with unknowns, e (None when it failed), what happened, who ran it.
Watch = Callable[[Array, float | None, str, str], None]


#: Status of an analysis whose equilibrium no test can show.
UNSTABLE = "unstable equilibrium"


@dataclass(eq=False)
class FitProblem:
    """Tests, a law and unknowns of one fit; an analysis runs every test once.

    `law` carries nu12, strain range and thickness option; its beta is replaced. `surrogate`: the
    same problem for a solver that differentiates, where this one's does not. `lead_in`: groups
    of tests, by their numbers, that a fit matches first (see `approach`).
    """

    experiments: tuple[Experiment, ...]
    law: HypoelasticLaw
    parameters: ModuliParameters
    watch: Watch | None = None
    surrogate: FitProblem | None = None
    analyses: int = 0
    unstable: int = 0  # of them, ended in an equilibrium that no test can show
    failure: str = ""  # why the last one that failed did
    warm_starts: bool = True
    lead_in: tuple[tuple[int, ...], ...] = ()
    blocks: Blocks = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.blocks = Blocks([n for e in self.experiments for n in e.objective.sizes])

    @classmethod
    def single(
        cls,
        model: Any,
        solver: Solver,
        law: HypoelasticLaw,
        objective: Any,
        parameters: ModuliParameters,
        **other: Any,
    ) -> FitProblem:
        """A fit to one bubble test."""
        return cls((Experiment("bubble", model, solver, objective),), law, parameters, **other)

    @property
    def solver(self) -> Solver:
        """The solver that counts (each test has one of its own, of the same kind)."""
        return self.experiments[0].solver

    @property
    def scale(self) -> Array:
        """(m,): units of its test (mm, N) in one unit of each residual."""
        return np.concatenate([e.objective.scale for e in self.experiments])

    def rows(self, number: int) -> slice:
        """Rows of the residual that belong to test `number`."""
        sizes = [sum(e.objective.sizes) for e in self.experiments]
        return slice(sum(sizes[:number]), sum(sizes[: number + 1]))

    def led_by(self, solvers: Sequence[Solver]) -> FitProblem:
        """The same problem for other solvers, one a test: a surrogate."""
        led = tuple(e.by(solver) for e, solver in zip(self.experiments, solvers, strict=True))
        return FitProblem(led, self.law, self.parameters, lead_in=self.lead_in)

    def part(self, tests: Sequence[int]) -> FitProblem:
        """The fit to some of the tests, by their numbers; whoever watches hears which."""
        some = tuple(self.experiments[k] for k in tests)
        names = ", ".join(e.name for e in some)

        def watch(y: Array, value: float | None, status: str, solver: str) -> None:
            if self.watch is not None:
                # Of another sum than this problem's e: it must not stand beside that.
                said = status if value is None else f"{status}, e = {value:.6g}"
                self.watch(y, None, f"{names} alone: {said}", solver)

        return FitProblem(some, self.law, self.parameters, watch, analyses=self.analyses)

    def shift(self, here: Sequence[History], there: Sequence[History]) -> None:
        """From now on reckon as if the solver gave `here` where it gives `there`, test by test."""
        for experiment, h, t in zip(self.experiments, here, there, strict=True):
            experiment.objective = experiment.objective.shifted(h, t)

    def reset(self) -> None:
        """Forget the warm start and the count: every start of a study begins alike."""
        self.analyses, self.unstable, self.warm_starts = 0, 0, True
        for experiment in self.experiments:
            experiment.forget()
        if self.surrogate is not None:
            self.surrogate.reset()

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every test at unknowns y; None when one did not end well (Eqs 3.8, 4.9).

        `warm`: start each increment from the last differentiated solution and its slope.
        """
        self.analyses += 1
        beta = self.parameters.beta(y)
        offset, pressure = self.parameters.offsets(y)
        law = self.law.with_beta(beta)
        histories, residuals, jacobians = [], [], []
        for experiment in self.experiments:
            shift, push = (offset, pressure) if experiment.offsets else (None, 0.0)
            values = self._values(y)
            steps = values if warm and self.warm_starts else None
            try:
                if with_jacobian:
                    names = self._names(experiment)
                    history, slope = experiment.differentiate(law, names, push, values, steps)
                    jacobians.append(self._chain(experiment, history, slope))
                else:
                    history = experiment.run(law, push, steps)
            except SolverFailure as failure:
                self._failed(y, experiment, failure.reason)
                return None
            residual = experiment.objective.residual(history, shift)
            if not np.isfinite(residual).all():
                self._failed(y, experiment, "the results are not finite")
                return None
            histories.append(history)
            residuals.append(residual)
        whole = np.concatenate(residuals)
        value = self.blocks.value(whole)
        jacobian = np.concatenate(jacobians) if with_jacobian else None
        coefficients = beta[self.parameters.places]
        point = Evaluation(y.copy(), coefficients, whole, value, jacobian, tuple(histories))
        self.unstable += not point.stable
        self._report(y, value, "ok" if point.stable else UNSTABLE)
        return point

    def _failed(self, y: Array, experiment: Experiment, reason: str) -> None:
        several = f"{experiment.name}: " if len(self.experiments) > 1 else ""
        self.failure = several + reason
        self._report(y, None, self.failure)

    def _report(self, y: Array, value: float | None, status: str) -> None:
        if self.watch is not None:
            self.watch(y, value, status, self.solver.name)

    def _names(self, experiment: Experiment) -> list[str]:
        names = [f"beta_{i}" for i in self.parameters.places]
        wanted = experiment.offsets and self.parameters.pressure_offset
        return [*names, "pressure_offset"] if wanted else names

    def _values(self, y: Array) -> Array:
        """The solver's parameters (coefficients MPa, pressure offset MPa)."""
        values = self.parameters.to_coefficients @ y[: self.parameters.size]
        if self.parameters.pressure_offset:
            values = np.append(values, 1e-3 * y[-1])
        return np.asarray(values)

    def _chain(self, experiment: Experiment, history: History, slope: Array) -> Array:
        """Jacobian of one test by the unknowns from the slope by the solver's parameters."""
        p, objective = self.parameters, experiment.objective
        by_solver = objective.jacobian(history, slope)
        columns = [by_solver[:, : p.size] @ p.to_coefficients]
        if not experiment.offsets:
            columns.append(np.zeros((len(by_solver), len(p.nuisance))))
            return np.concatenate(columns, axis=1)
        if p.displacement_offset:
            columns.append(objective.offset_columns())
        if p.pressure_offset:
            columns.append(1e-3 * by_solver[:, p.size :])
        return np.concatenate(columns, axis=1)
