"""One comparison of a fit: a model, who runs it, and what it should show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.law import HypoelasticLaw
from ..solvers.base import DifferentiatingSolver, History, Solver

# Unknowns beside the moduli: of one comparison (an offset, a pressure), or shared by all of them.
#
# Shared are what the fabric has one of: Poisson's ratio, thickness.

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class Nuisance:
    """An unknown beside the moduli: not wanted for itself, but the data hang on it.

    Parameters
    ----------
    name : as its objective knows it ("offset_z"), or of a parameter of the model or the law.
    lower, upper : its bounds, in `unit`.
    unit : of its values ("mm", "kPa").
    model_parameter : which of the model's `parameters` it is: `with_parameters` of the model takes
        how far it is from `start`, and a solver that differentiates does so by it. None where only
        the objective, or the law, knows of it.
    scale : the model's units in one `unit` (1e-3 from kPa to MPa).
    prior : one standard deviation around `start` of what is known of it before the data, in `unit`;
        None: nothing. weight : residual of a value that far away.
    start : from which a fit starts.
    law_parameter : which number of the law it is, beside its beta: "nu12".
    shared : one for all comparisons of a fit that have it, by its name; else each has its own.
    why : what to say where the data say nothing of it.
    """

    name: str
    lower: float
    upper: float
    unit: str
    model_parameter: str | None = None
    scale: float = 1.0
    prior: float | None = None
    weight: float = 0.0
    start: float = 0.0
    law_parameter: str | None = None
    shared: bool = False
    why: str = ""


@dataclass(frozen=True, eq=False)
class NuisanceOf:
    """The nuisance of all comparisons of a fit: what they share, then laid end to end.

    Parameters
    ----------
    comparisons : by name, in their order; those without nuisance are named too.
    """

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @cached_property
    def shared(self) -> tuple[Nuisance, ...]:
        """What several comparisons may share, each once."""
        every = (n for own in self.comparisons.values() for n in own if n.shared)
        return tuple({n.name: n for n in every}.values())

    @cached_property
    def all(self) -> tuple[Nuisance, ...]:
        """What is shared, then what each comparison has of its own."""
        own = (n for several in self.comparisons.values() for n in several if not n.shared)
        return (*self.shared, *own)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all; one of its own with the comparison's name before it where there are several."""
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
        """Lower and upper bounds of all, in their units."""
        return np.array([n.lower for n in self.all]), np.array([n.upper for n in self.all])

    @property
    def start(self) -> Array:
        """From where a fit starts, of all, in their units."""
        return np.array([n.start for n in self.all])

    @property
    def priors(self) -> tuple[Numbers, Array]:
        """Number of each that has a prior, and residual of one unit of it."""
        known = [(k, n.weight / n.prior) for k, n in enumerate(self.all) if n.prior is not None]
        return np.array([k for k, _ in known], dtype=np.intp), np.array([c for _, c in known])

    def places(self, comparison: str) -> Numbers:
        """Where the nuisance of a comparison lies, in its order."""
        found, first = [], len(self.shared)
        shared = {n.name: k for k, n in enumerate(self.shared)}
        for name, nuisance in self.comparisons.items():
            for n in nuisance:
                if name == comparison:
                    found.append(shared[n.name] if n.shared else first)
                first += not n.shared
        return np.array(found, dtype=np.intp)

    def values(self, comparison: str, all_values: Array) -> dict[str, float]:
        """The nuisance of a comparison by plain name, from the values of all, in their units."""
        own = self.comparisons.get(comparison, ())
        values = all_values[self.places(comparison)].tolist()
        return dict(zip((n.name for n in own), values, strict=True))

    def of_law(self, all_values: Array) -> dict[str, float]:
        """The numbers of the law that are unknown, by its names, from the values of all.

        Within their bounds: a step keeps them but for rounding, and a law may end there.
        """
        return {
            n.law_parameter: float(np.clip(all_values[k], n.lower, n.upper))
            for k, n in enumerate(self.shared)
            if n.law_parameter is not None
        }


#: Largest predicted change of displacement, relative, for a warm start.
NEAR = 0.02


#: Where the noise of an objective's data is from: the project says it, it is the scatter of the
#: specimens, or what such an instrument is good for.
NoiseIs = Literal["given", "specimens' scatter", "assumed"]


class Objective(Protocol):
    """Residual blocks of one comparison.

    sizes : length of each block, together m; scale (m,): `unit`s in one unit of each residual;
    least_noise in `unit`s, to reckon with at least (its `noise_is`, a `NoiseIs`, is "assumed"
    where the objective has none); data: all that was measured. One whose neighbouring values may
    err as one also has `places`, (n, 2) mm on a sheet or (n, 1) along a curve, of each block's
    values; one that knows how many do, whatever is left of them, has `alike`; one
    whose values are of several specimens has `specimens`, (m,) the number of each one's, or None.
    """

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
        """(m,) at nuisance values by name, in their units; it asks for those it knows."""
        ...

    def jacobian(self, history: History, slope: Array) -> Array:
        """(m, parameters) from the solver's slope of the displacements."""
        ...

    def nuisance_columns(self, names: Sequence[str]) -> Array:
        """(m, names): slope of the residual by the nuisance that only the objective knows of."""
        ...

    def shifted(self, here: History, there: History) -> Objective:
        """The objective of a model that shows `here` where this one shows `there`."""
        ...


@dataclass(eq=False)
class Comparison:
    """A model that should show what was measured.

    Parameters
    ----------
    name : of its test ("bubble 1", "strips 1: warp"), for messages and reports; one of its own.
    model : what its solver runs.
    solver : its own, so that what the solver prepares for the model is kept.
    objective : what the model should show.
    nuisance : unknowns beside the moduli, of this comparison alone or shared with others.
    stage : those of lower stages lead into a fit of several (see `approach`).
    contracts : the sheet is free to contract under tension, so that the law has to be positive
        definite there.
    must_be_stable : an unstable equilibrium is no point for a fit to go to: no test under load
        could show it.
    """

    name: str
    model: Any
    solver: Solver
    objective: Objective
    nuisance: tuple[Nuisance, ...] = ()
    stage: int = 0
    contracts: bool = False
    must_be_stable: bool = True
    _last: tuple[Array, Array, Array] | None = field(default=None, repr=False)

    def by(self, solver: Solver) -> Comparison:
        """The same comparison run by another solver."""
        return replace(self, solver=solver, _last=None)

    def forget(self) -> None:
        """No warm start from here on, until something was differentiated."""
        self._last = None

    def run(
        self, law: HypoelasticLaw, free: Sequence[int], nuisance: Mapping[str, float], warm: bool
    ) -> History:
        """Run without derivatives.

        Parameters
        ----------
        free : entries of the law's beta that vary between runs.
        nuisance : values by name, in their units.
        warm : start each increment from the last differentiated solution and its slope.

        Raises
        ------
        SolverFailure : it did not end well.
        """
        values = self._model_values(nuisance)
        model = self._model(values)
        if isinstance(self.solver, DifferentiatingSolver):
            guess = self._guess(self._point(law, free, values)) if warm else None
            return self.solver.run(model, law, guess=guess)
        return self.solver.run(model, law)

    def differentiate(
        self, law: HypoelasticLaw, free: Sequence[int], nuisance: Mapping[str, float], warm: bool
    ) -> tuple[History, Array]:
        """Run with derivatives, and remember the way for a warm start; arguments as for `run`.

        Returns
        -------
        History, and the slope of the residual (m, free + nuisance): by the entries of beta, then
        by the nuisance of this comparison in their units.

        Raises
        ------
        SolverFailure : it did not end well, or the solver does not differentiate.
        """
        if not isinstance(self.solver, DifferentiatingSolver):
            raise SolverFailure(f"{self.solver.name} gives no derivatives", self.solver.name)
        values = self._model_values(nuisance)
        point = self._point(law, free, values)
        history, slope = self.solver.run_with_sensitivity(
            self._model(values),
            law,
            [*(f"beta_{i}" for i in free), *values, *self._of_law],
            guess=self._guess(point) if warm else None,
        )
        if history.path is not None and history.path_slope is not None:
            self._last = (point, history.path, history.path_slope)
        return history, self._chain(self.objective.jacobian(history, slope), len(free))

    def _model_values(self, nuisance: Mapping[str, float]) -> dict[str, float]:
        """What the model knows of, by its names and in its units."""
        return {
            n.model_parameter: n.scale * (nuisance[n.name] - n.start)
            for n in self.nuisance
            if n.model_parameter is not None
        }

    def _model(self, values: Mapping[str, float]) -> Any:
        """The model with its parameters at `values`; one that has none is as it is.

        Raises
        ------
        SolverFailure : there is no such model (a pressure below zero): nothing to go to.
        """
        if not values:
            return self.model
        try:
            return self.model.with_parameters(values)
        except InputError as error:
            raise SolverFailure(f"there is no such model: {error}", self.solver.name) from None

    def _chain(self, by_solver: Array, free: int) -> Array:
        """Columns in the order of the unknowns, from those in the order of the model's names."""
        of_model = [n for n in self.nuisance if n.model_parameter is not None]
        of_law = [n for n in self.nuisance if n.law_parameter is not None]
        by = {n.name: n.scale for n in (*of_model, *of_law)}
        own = [n.name for n in self.nuisance if n.name not in by]
        by_objective = self.objective.nuisance_columns(own).T if own else ()
        columns = dict(zip(own, by_objective, strict=True))
        columns |= {
            name: scale * column
            for (name, scale), column in zip(by.items(), by_solver.T[free:], strict=True)
        }
        return np.column_stack([by_solver[:, :free], *(columns[n.name] for n in self.nuisance)])

    @property
    def _of_law(self) -> list[str]:
        """Numbers of the law beside its beta that are unknown, by its names."""
        return [n.law_parameter for n in self.nuisance if n.law_parameter is not None]

    def _point(
        self, law: HypoelasticLaw, free: Sequence[int], values: Mapping[str, float]
    ) -> Array:
        """The parameters that vary, in the order in which the solver differentiates by them."""
        of_law = [float(getattr(law, name)) for name in self._of_law]
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
    """Where each block of a residual (m,) lies, and what follows from its norm.

    Parameters
    ----------
    sizes : length of each block, in order; together m.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self.starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]]).astype(np.intp)
        #: Block of each residual, (m,).
        self.of = np.repeat(np.arange(len(self.sizes)), self.sizes)

    def norms(self, residual: Array) -> Array:
        """Norm of each block, (blocks,): an RMS error over its scale."""
        return np.sqrt(np.add.reduceat(residual**2, self.starts))

    def value(self, residual: Array) -> float:
        """The objective e."""
        return float(self.norms(residual).sum())

    def gradient(self, residual: Array, jacobian: Array) -> Array:
        """Slope of e, (unknowns,); a block that fits exactly contributes nothing."""
        norms = np.maximum(self.norms(residual), SMALLEST)
        return np.asarray((residual / norms[self.of]) @ jacobian)
