"""One comparison of a fit: a model, its solver, measured data, and unknowns beside the moduli."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..solvers.base import DifferentiatingSolver, History, Solver

Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class Nuisance:
    """An unknown beside the moduli, of one comparison (an offset, a pressure) or shared by all.
    name : as its objective knows it, or of a parameter of model or law. lower, upper, prior, start
    : in `unit`; prior is one standard deviation around `start`. begin : where a fit begins, `start`
    unless given. weight : residual of a value one
    prior away. model_parameter : the one of the model's `parameters` that takes the difference from
    `start`. scale : the model's units in one `unit`. law_parameter : number of the law beside beta:
    "nu12". hint : words for data that say nothing of it."""

    name: str
    lower: float
    upper: float
    unit: str
    model_parameter: str | None = None
    scale: float = 1.0
    prior: float | None = None
    weight: float = 0.0
    start: float = 0.0
    begin: float | None = None
    law_parameter: str | None = None
    shared: bool = False
    hint: str = ""


@dataclass(frozen=True, eq=False)
class NuisanceUnknowns:
    """The nuisance of all comparisons, by name: shared unknowns, then comparison by comparison."""

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @cached_property
    def shared(self) -> tuple[Nuisance, ...]:
        every = (n for own in self.comparisons.values() for n in own if n.shared)
        return tuple({n.name: n for n in every}.values())

    @cached_property
    def all(self) -> tuple[Nuisance, ...]:
        own = (n for several in self.comparisons.values() for n in several if not n.shared)
        return (*self.shared, *own)

    @property
    def names(self) -> tuple[str, ...]:
        """Return all names, with the comparison's before its own ones where there are several."""
        several = len(self.comparisons) > 1
        own = tuple(
            f"{comparison}: {n.name}" if several else n.name
            for comparison, nuisance in self.comparisons.items()
            for n in nuisance
            if not n.shared
        )
        return (*(n.name for n in self.shared), *own)

    @property
    def bounds(self) -> tuple[Array, Array]:
        return np.array([n.lower for n in self.all]), np.array([n.upper for n in self.all])

    @property
    def start(self) -> Array:
        return np.array([n.start for n in self.all])

    @property
    def begin(self) -> Array:
        return np.array([n.start if n.begin is None else n.begin for n in self.all])

    @property
    def priors(self) -> tuple[Numbers, Array]:
        """Return the number of each that has a prior, and the residual of one unit of it."""
        known = [(k, n.weight / n.prior) for k, n in enumerate(self.all) if n.prior is not None]
        return np.array([k for k, _ in known], dtype=np.intp), np.array([c for _, c in known])

    def positions(self, comparison: str) -> Numbers:
        """Return the positions of a comparison's nuisance, in its order."""
        found = []
        first = len(self.shared)
        shared = {n.name: k for k, n in enumerate(self.shared)}
        for name, nuisance in self.comparisons.items():
            for n in nuisance:
                if name == comparison:
                    found.append(shared[n.name] if n.shared else first)
                first += not n.shared
        return np.array(found, dtype=np.intp)

    def values(self, comparison: str, all_values: Array) -> dict[str, float]:
        """Return the nuisance of a comparison by plain name from the values of all."""
        own = self.comparisons.get(comparison, ())
        values = all_values[self.positions(comparison)].tolist()
        return dict(zip((n.name for n in own), values, strict=True))

    def of_law(self, all_values: Array) -> dict[str, float]:
        """Return the unknown numbers of the law by name, clipped to their bounds (steps round)."""
        return {
            n.law_parameter: float(np.clip(all_values[k], n.lower, n.upper))
            for k, n in enumerate(self.shared)
            if n.law_parameter is not None
        }


NEAR = 0.02  # largest predicted change of displacement, relative, for a warm start
#: Where the noise of an objective's data is from: the project says it, it is the scatter of the
#: specimens, or what such an instrument is good for.
NoiseIs = Literal["given", "specimens' scatter", "assumed"]


class Objective(Protocol):
    """Residual blocks of one comparison.
    sizes : of the blocks, together m. scale : (m,) `unit`s in one unit of residual. data : all that
    was measured. Optional: `noise_is` (else "assumed"); `positions`, (n, 2) mm on a sheet or (n,
    1) along a curve, of each block, where neighbours may err as one; `correlated_count`, how many;
    `specimens`, (m,) numbers, or None; `nuisance_columns(names, nuisance)`, (m, names), slopes by
    nuisance of its own, at its values."""

    @property
    def sizes(self) -> tuple[int, ...]: ...

    @property
    def unit(self) -> str: ...

    @property
    def least_noise(self) -> float: ...

    @property
    def scale(self) -> Array: ...

    @property
    def data(self) -> tuple[Array, ...]: ...

    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        """Return (m,) at nuisance values by name, in their units."""

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return (m, parameters) from the solver's slope of the displacements."""

    def shifted(self, external: History, surrogate: History) -> Objective:
        """Return the objective for a model that shows `surrogate`, not `external`."""


#: Relative step of a central difference; probes of what noise makes of a function's values.
STEP, PROBES = 1e-5, 4


class FunctionObjective:
    """Residuals that a function of one's own makes of what an objective with `columns` compares.
    function : of modelled and measured values, a list of frames (m, 3) or (frames, m, 3) of a
    field, (m,) loads; returns a vector, or several in a list: e adds up their RMS. derivative : of
    both and of a change of what is modelled, the change of the same; None: differences. relative :
    a vector counts by its largest value for a model that does not move, and as one of so many."""

    def __init__(
        self, inner: Any, function: Callable[..., Any], relative: bool = False, weight: float = 1.0
    ) -> None:
        self.inner = inner
        self.function = function
        self.by = np.zeros_like(inner.measured)
        self.derivative = getattr(function, "derivative", None)
        self.unit = inner.unit
        self.least_noise = inner.least_noise
        self.noise_is = inner.noise_is
        with np.errstate(all="ignore"):  # a model that does not move may have no logarithm
            self.sizes = tuple(map(len, self._vectors(function, self.by)))
            still, near = (self._values(share * inner.measured) for share in (0.0, 0.9))
        self.data, blocks = (*inner.data, still, near), Blocks(self.sizes)
        largest = np.maximum.reduceat(np.abs(still), blocks.starts)
        usable = relative & np.isfinite(largest) & (largest > 0)
        unit = np.where(usable, largest, 1.0) * (len(largest) if relative else 1)
        self._unit = (unit * np.sqrt(self.sizes) / weight)[blocks.of]
        # What the function makes of the noise of the values says how much a residual has of it.
        size = self.least_noise or STEP * np.abs(inner.measured).max()
        noise = np.random.default_rng(0).choice([-1.0, 1.0], (1 + PROBES, len(self.by)))
        made = [self._along(inner.measured + size * noise[0], one) for one in noise[1:]]
        gain = blocks.norms(np.sqrt(np.mean(np.square(made), axis=0))) / np.sqrt(self.sizes)
        self.scale = self._unit / np.where(np.isfinite(gain) & (gain > 0), gain, 1.0)[blocks.of]

    def _vectors(self, function: Any, *values: Array) -> list[Array]:
        def arranged(flat: Array) -> Any:
            parts = np.split(flat, np.cumsum(self.inner.sizes)[:-1])
            columns = self.inner.columns
            if columns == 1:
                return parts[0]
            starts = range(0, len(parts), columns)
            frames = [np.stack(parts[k : k + columns], axis=1) for k in starts]
            return np.stack(frames) if len(set(map(len, frames))) == 1 else frames

        modelled, *change = map(arranged, values)
        found = function(modelled, arranged(self.inner.measured), *change)
        several = isinstance(found, (list, tuple)) and all(map(np.ndim, found))
        return [np.ravel(np.asarray(one, dtype=float)) for one in (found if several else [found])]

    def _values(self, *values: Array) -> Array:
        """Return the residuals (m,) of modelled values; by their change as well, its own."""
        found = self._vectors(self.derivative if values[1:] else self.function, *values)
        if tuple(map(len, found)) != self.sizes or 0 in self.sizes:
            problem = f"expected vectors of {self.sizes} residuals, got {[*map(len, found)]}"
            raise InputError(None, "objective", problem)
        return np.concatenate(found)

    def _along(self, at: Array, change: Array) -> Array:
        if self.derivative is not None:
            return self._values(at, change)
        step = STEP * np.abs(at).max() / max(float(np.abs(change).max()), 1e-300)
        change = step * change
        return np.asarray((self._values(at + change) - self._values(at - change)) / (2 * step))

    def _modelled(self, history: History) -> Array:
        off = self.inner.residual(history, {}) * self.inner.scale
        return np.asarray(self.inner.measured + off + self.by)

    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        return self._values(self._modelled(history)) / self._unit

    def jacobian(self, history: History, slope: Array) -> Array:
        at = self._modelled(history)
        changes = self.inner.jacobian(history, slope).T
        columns = [self._along(at, self.inner.scale * change) for change in changes]
        return np.column_stack(columns) / self._unit[:, None]

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        problem = f"leave out {', '.join(names)}: a function of one's own has to allow for them"
        raise InputError(None, "objective", problem)

    def shifted(self, external: History, surrogate: History) -> FunctionObjective:
        objective = copy.copy(self)
        objective.by = self.by + self._modelled(external) - self._modelled(surrogate)
        return objective


@dataclass(eq=False)
class Comparison:
    """A model that should show what was measured, by a solver of its own.
    name : of its test ("bubble 1", "strips 1: warp"). stage : those of lower stages lead into a fit
    of several (see `approach`). contracts : the sheet contracts freely under tension, so that the
    law has to be positive definite. must_be_stable : an unstable equilibrium is refused. prolong :
    returns a start for this finer model from the path of a coarser one."""

    name: str
    model: Any
    solver: Solver
    objective: Objective
    nuisance: tuple[Nuisance, ...] = ()
    stage: int = 0
    contracts: bool = False
    must_be_stable: bool = True
    prolong: Callable[[Array], Array] | None = None
    _last: tuple[Array, Array, Array] | None = field(default=None, repr=False)

    def forget(self) -> None:
        """Drop the warm start until the next differentiated run."""
        self._last = None

    def run(
        self,
        law: HypoelasticLaw,
        free: Sequence[int],
        nuisance: Mapping[str, float],
        warm: bool,
        beside: History | None = None,
    ) -> History:
        """Run without derivatives.
        free : entries of the law's beta that vary between runs. nuisance : values by name, in their
        units. warm : start each increment from the last differentiated solution and its slope.
        beside : of the comparison that this one refines, to start from. Raises SolverFailure."""
        values = self._model_values(nuisance)
        model = self.model_at(nuisance)
        if isinstance(self.solver, DifferentiatingSolver):
            guess = self._guess(self._point(law, free, values)) if warm else None
            if beside is not None and beside.path is not None and self.prolong is not None:
                guess = self.prolong(beside.path)
            return self.solver.run(model, law, guess=guess)
        return self.solver.run(model, law)

    def differentiate(
        self, law: HypoelasticLaw, free: Sequence[int], nuisance: Mapping[str, float], warm: bool
    ) -> tuple[History, Array]:
        """Run as `run`, keep the path for a warm start; also return slopes (m, free + nuisance)."""
        if not isinstance(self.solver, DifferentiatingSolver):
            raise SolverFailure(f"{self.solver.name} gives no derivatives", self.solver.name)
        values = self._model_values(nuisance)
        point = self._point(law, free, values)
        history, slope = self.solver.run_with_sensitivity(
            self.model_at(nuisance),
            law,
            [*(f"beta_{i}" for i in free), *values, *self._of_law],
            guess=self._guess(point) if warm else None,
        )
        if history.path is not None and history.path_slope is not None:
            self._last = (point, history.path, history.path_slope)
        by_solver = self.objective.jacobian(history, slope)
        # From the model's order to that of the unknowns.
        by = {n.name: n.scale for n in self.nuisance if n.model_parameter is not None}
        by |= {n.name: n.scale for n in self.nuisance if n.law_parameter is not None}
        own = [n.name for n in self.nuisance if n.name not in by]
        objective: Any = self.objective
        by_objective = objective.nuisance_columns(own, nuisance).T if own else ()
        columns = dict(zip(own, by_objective, strict=True))
        scaled = zip(by.items(), by_solver.T[len(free) :], strict=True)
        columns |= {name: scale * column for (name, scale), column in scaled}
        every = by_solver[:, : len(free)], *(columns[n.name] for n in self.nuisance)
        return history, np.column_stack(every)

    def _model_values(self, nuisance: Mapping[str, float]) -> dict[str, float]:
        return {
            n.model_parameter: n.scale * (nuisance[n.name] - n.start)
            for n in self.nuisance
            if n.model_parameter is not None
        }

    def model_at(self, nuisance: Mapping[str, float]) -> Any:
        """Return the model at nuisance values by name; SolverFailure where there is none."""
        if not (values := self._model_values(nuisance)):
            return self.model
        try:
            return self.model.with_parameters(values)
        except InputError as error:
            raise SolverFailure(f"there is no such model: {error}", self.solver.name) from None

    @property
    def _of_law(self) -> list[str]:
        return [n.law_parameter for n in self.nuisance if n.law_parameter is not None]

    def _point(
        self, law: HypoelasticLaw, free: Sequence[int], values: Mapping[str, float]
    ) -> Array:
        """Return the varying parameters in the order in which the solver differentiates by them."""
        of_law = [law.number(name) for name in self._of_law]
        return np.concatenate([law.beta[list(free)], list(values.values()), of_law])

    def _guess(self, point: Array) -> Array | None:
        if self._last is None:
            return None
        before, path, slope = self._last
        change = slope @ (point - before)
        # A far guess can lead to another equilibrium branch (a soft membrane may fold), on which
        # a fit then settles; only near by is the warm start both safe and worth something.
        if np.abs(change).max() > NEAR * np.abs(path).max():
            return None
        return np.asarray(path + change)


#: Norm below which a block counts as fitted exactly: the slope of its norm does not exist.
SMALLEST = 1e-14


class Blocks:
    """Positions of the blocks of a residual (m,) and their norms; sizes : lengths, together m."""

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        #: Block of each residual, (m,).
        self.of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Return the norm of each block, (blocks,): an RMS error over its scale."""
        return np.sqrt(np.add.reduceat(residual**2, self.starts))

    def value(self, residual: Array) -> float:
        return float(self.norms(residual).sum())

    def gradient(self, residual: Array, jacobian: Array) -> Array:
        """Return the slope of e, (unknowns,); a block that fits exactly contributes nothing."""
        norms = np.maximum(self.norms(residual), SMALLEST)
        return np.asarray((residual / norms[self.of]) @ jacobian)
