"""One test of a fit: its model, who runs it, and what it should show."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from ..solvers.base import DifferentiatingSolver, History, Solver

Array = NDArray[np.float64]

#: Largest predicted change of displacement, relative, for a warm start.
NEAR = 0.02


class Objective(Protocol):
    """Residual blocks of one test.

    sizes : length of each block; scale (m,) `unit`s in one unit of each residual; least_noise in
    `unit`s; data: all that was measured.
    """

    sizes: tuple[int, ...]
    unit: str
    least_noise: float

    @property
    def scale(self) -> Array: ...

    @property
    def data(self) -> tuple[Array, ...]: ...

    def residual(self, history: History, offset: Array | None = None) -> Array: ...

    def jacobian(self, history: History, slope: Array) -> Array: ...

    def shifted(self, here: History, there: History) -> Any: ...


@dataclass(eq=False)
class Experiment:
    """A test that a fit matches.

    name : for messages and reports. solver : its own, so that what the solver prepares for the
    model is kept. objective : an `Objective`. offsets : whether the nuisance offsets
    (displacement, pressure) are its.
    """

    name: str
    model: Any
    solver: Solver
    objective: Any
    offsets: bool = True
    _last: tuple[Array, Array, Array] | None = field(default=None, repr=False)

    def by(self, solver: Solver) -> Experiment:
        """The same test run by another solver."""
        return replace(self, solver=solver, _last=None)

    def forget(self) -> None:
        """No warm start from here on, until something was differentiated."""
        self._last = None

    def run(self, law: HypoelasticLaw, pressure: float, steps: Array | None) -> History:
        """Run without derivatives; `pressure` (MPa) is the offset, `steps` as for `differentiate`.

        Raises
        ------
        SolverFailure : it did not end well.
        """
        if isinstance(self.solver, DifferentiatingSolver):
            guess = self._guess(steps)
            return self.solver.run(self.model, law, pressure_offset=pressure, guess=guess)
        model = self.model if pressure == 0.0 else self.model.with_pressure_offset(pressure)
        return self.solver.run(model, law)

    def differentiate(
        self,
        law: HypoelasticLaw,
        names: list[str],
        pressure: float,
        values: Array,
        steps: Array | None,
    ) -> tuple[History, Array]:
        """Run with derivatives by `names`, whose `values` they are, and remember the way.

        steps : the parameters for a warm start from what is remembered; None starts cold.

        Raises
        ------
        SolverFailure : it did not end well, or the solver does not differentiate.
        """
        if not isinstance(self.solver, DifferentiatingSolver):
            raise SolverFailure(f"{self.solver.name} gives no derivatives", self.solver.name)
        history, slope = self.solver.run_with_sensitivity(
            self.model, law, names, pressure, self._guess(steps)
        )
        if history.path is not None and history.path_slope is not None:
            self._last = (values.copy(), history.path, history.path_slope)
        return history, slope

    def _guess(self, values: Array | None) -> Array | None:
        if values is None or self._last is None:
            return None
        before, path, slope = self._last
        change = slope @ (values - before)[: slope.shape[-1]]
        # A far guess can lead to another equilibrium branch (a soft membrane may fold), on which
        # a fit then settles; only near by is the warm start both safe and worth something.
        if np.abs(change).max() > NEAR * np.abs(path).max():
            return None
        return np.asarray(path + change)
