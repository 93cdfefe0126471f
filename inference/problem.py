"""One fit as a function of its unknowns: residuals, Jacobian, feasibility, and a count."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..solvers.base import DifferentiatingSolver, History, Solver, instability
from .comparison import Blocks, Comparison
from .unknowns import RandomStarts, Starts, Unknowns


@dataclass(frozen=True, eq=False)
class Evaluation:
    """An analysis that ended well, as the optimiser sees it.
    coefficients : (free,) MPa. residual : (m,). value : e of Eq. 3.7 or 4.8. jacobian : (m,
    unknowns). histories : one a comparison. stable : every equilibrium that has to be, as far as
    was looked."""

    unknowns: Array
    coefficients: Array
    residual: Array
    value: float
    jacobian: Array | None
    histories: tuple[History, ...]
    stable: bool = True

    @property
    def from_cache(self) -> bool:
        """Return whether every run of it was in the cache."""
        return bool(self.histories) and all(h.from_cache for h in self.histories)

    @property
    def status(self) -> str:
        if self.stable:
            return "ok, from the cache" if self.from_cache else "ok"
        return next(filter(None, (instability(h.unstable) for h in self.histories)))


#: Called after every analysis with unknowns, e (None when it failed), what happened, who ran it.
Watch = Callable[[Array, float | None, str, str], None]


@dataclass(eq=False)
class FitProblem:
    """Comparisons, a law and unknowns of one fit; an analysis runs every comparison once.
    A last block is of the nuisance with a prior. law : gives nu12, strain range and thickness
    option. surrogate : the problem for a solver that differentiates, where this one's does not.
    Raises InputError for comparisons of one name, or nuisance that is not among the unknowns."""

    comparisons: tuple[Comparison, ...]
    law: HypoelasticLaw
    unknowns: Unknowns
    watch: Watch | None = None
    surrogate: FitProblem | None = None
    starts: Starts = field(default_factory=RandomStarts)
    analyses: int = 0
    last_unstable: int = 0  # the last of them that ended in an equilibrium that no test can show
    cached: int = 0  # of them, from the cache of runs
    failure: str = ""  # why the last one that failed did
    warm_starts: bool = True
    blocks: Blocks = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = [c.name for c in self.comparisons]
        if not names or len(set(names)) < len(names):
            problem = f"expected comparisons with a name of their own each, got {names}"
            raise InputError(None, "comparisons", problem)
        for comparison in self.comparisons:
            if comparison.nuisance != self.unknowns.nuisance.comparisons.get(comparison.name, ()):
                problem = f"the nuisance of {comparison.name} is not among the unknowns"
                raise InputError(None, "unknowns", problem)
        sizes = [n for c in self.comparisons for n in c.objective.sizes]
        priors = len(self.unknowns.nuisance.priors[0])
        self.blocks = Blocks([*sizes, priors] if priors else sizes)

    @property
    def solver(self) -> Solver:
        """Return the solver that counts: the first that runs a model (each comparison has one)."""
        solvers = [comparison.solver for comparison in self.comparisons]
        return next((one for one in solvers if not getattr(one, "closed", False)), solvers[0])

    @property
    def differentiates(self) -> bool:
        return isinstance(self.solver, DifferentiatingSolver)

    @property
    def scale(self) -> Array:
        """Return (m,) units of the data (mm, N), or of the unknown, per unit of residual."""
        own = [c.objective.scale for c in self.comparisons]
        return np.concatenate([*own, 1.0 / self.unknowns.nuisance.priors[1]])

    def rows(self, number: int) -> slice:
        """Return the rows of the residual of comparison `number`."""
        sizes = [sum(c.objective.sizes) for c in self.comparisons]
        return slice(sum(sizes[:number]), sum(sizes[: number + 1]))

    def norms(self, residual: Array) -> dict[str, Array]:
        """Return the norms of the blocks of each comparison by name; those of priors left out."""
        ends = np.cumsum([len(c.objective.sizes) for c in self.comparisons])
        each = np.split(self.blocks.norms(residual), ends)
        return {c.name: own for c, own in zip(self.comparisons, each, strict=False)}

    def with_solvers(self, solvers: Sequence[Solver]) -> FitProblem:
        """Return the same problem for other solvers, one a comparison: a surrogate."""
        pairs = zip(self.comparisons, solvers, strict=True)
        others = tuple(replace(one, solver=solver, _last=None) for one, solver in pairs)
        return FitProblem(others, self.law, self.unknowns)

    def part(self, numbers: Sequence[int]) -> FitProblem:
        """Return the fit to some comparisons, by number; `watch` gets their names."""
        some = tuple(self.comparisons[k] for k in numbers)
        names = ", ".join(c.name for c in some)

        def watch(y: Array, value: float | None, status: str, solver: str) -> None:
            if self.watch is not None:
                # Of another sum than this problem's e: it must not stand beside that.
                end = status if value is None else f"{status}, e = {value:.6g}"
                self.watch(y, None, f"{names} alone: {end}", solver)

        return FitProblem(some, self.law, self.unknowns, watch, analyses=self.analyses)

    def shift(self, here: Sequence[History], there: Sequence[History]) -> None:
        """Shift the objectives as if the solver gave `here` where it gives `there`."""
        for comparison, h, t in zip(self.comparisons, here, there, strict=True):
            comparison.objective = comparison.objective.shifted(h, t)

    def reset(self) -> None:
        """Reset warm start and counts: every start of a study begins alike."""
        self.analyses = 0
        self.last_unstable = 0
        self.cached = 0
        self.failure = ""
        self.warm_starts = True
        for comparison in self.comparisons:
            comparison.forget()
        if self.surrogate is not None:
            self.surrogate.reset()

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every comparison at unknowns y; None when one did not end well (Eqs 3.8, 4.9).
        warm : start each increment from the last differentiated solution and its slope."""
        self.analyses += 1
        law = self.unknowns.law(self.law, y)
        free = self.unknowns.free
        warm = warm and self.warm_starts
        histories = []
        residuals = []
        jacobians = []
        for comparison in self.comparisons:
            nuisance = self.unknowns.nuisance_values(comparison.name, y)
            try:
                if with_jacobian:
                    history, slope = comparison.differentiate(law, free, nuisance, warm)
                    p = self.unknowns
                    rows = np.zeros((len(slope), p.count))
                    rows[:, : p.size] = slope[:, : p.size] @ p.to_coefficients
                    rows[:, p.nuisance_places(comparison.name)] = slope[:, p.size :]
                    jacobians.append(rows)
                else:
                    history = comparison.run(law, free, nuisance, warm)
                residual = comparison.objective.residual(history, nuisance)
                if not np.isfinite(residual).all():
                    raise SolverFailure("the results are not finite")
            except SolverFailure as failure:
                several = f"{comparison.name}: " if len(self.comparisons) > 1 else ""
                self.failure = several + failure.line
                self._report(y, None, self.failure)
                return None
            histories.append(history)
            residuals.append(residual)
        places, cost = self.unknowns.nuisance.priors
        away = y[self.unknowns.size :] - self.unknowns.nuisance.start
        whole = np.concatenate([*residuals, cost * away[places]])
        places = self.unknowns.size + places
        value = self.blocks.value(whole)
        jacobian = None
        if with_jacobian:
            of_priors = cost[:, None] * np.eye(self.unknowns.count)[places]
            jacobian = np.concatenate([*jacobians, of_priors])
        pairs = zip(self.comparisons, histories, strict=True)
        stable = all(h.stable is not False for c, h in pairs if c.must_be_stable)
        coefficients = law.beta[list(free)]
        point = Evaluation(y.copy(), coefficients, whole, value, jacobian, tuple(histories), stable)
        self.last_unstable = self.last_unstable if point.stable else self.analyses
        self.cached += point.from_cache
        self._report(y, value, point.status)
        return point

    def _report(self, y: Array, value: float | None, status: str) -> None:
        if self.watch is not None:
            self.watch(y, value, status, self.solver.name)


@dataclass(eq=False)
class WeightedProblem(FitProblem):
    """Comparisons and unknowns of a problem, with every residual multiplied by a factor, (m,)."""

    factors: Array = field(default_factory=lambda: np.empty(0))

    @property
    def scale(self) -> Array:
        """Return (m,) units of the data per unit of the multiplied residual."""
        return super().scale / np.where(self.factors > 0, self.factors, 1.0)

    @classmethod
    def of(cls, problem: FitProblem, factors: Array) -> WeightedProblem:
        """Return the fit to a problem's data, weighted anew, with the problem's warm start."""
        comparisons = tuple(replace(comparison) for comparison in problem.comparisons)
        return cls(comparisons, problem.law, problem.unknowns, factors=factors)

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        point = super().evaluate(y, with_jacobian, warm)
        return None if point is None else self.weighted(point)

    def weighted(self, point: Evaluation) -> Evaluation:
        """Return an analysis of the problem without factors as this one sees it: nothing is run."""
        residual = self.factors * point.residual
        slope = point.jacobian
        return replace(
            point,
            residual=residual,
            value=self.blocks.value(residual),
            jacobian=None if slope is None else self.factors[:, None] * slope,
        )


# How a fit ends, as a user reads it.
CONVERGED = "converged"
LEVEL = "settled"
ANALYSES_USED_UP = "analyses used up"
RUNS_USED_UP = "runs used up"


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best feasible point of one start.
    runs : by the solver that counts while a surrogate led; failure : why that ended the fit, if it
    did."""

    best: Evaluation
    status: str
    analyses: int
    runs: int = 0
    failure: str = ""

    @property
    def value(self) -> float:
        return self.best.value

    @property
    def coefficients(self) -> Array:
        return self.best.coefficients


@dataclass(frozen=True, eq=False)
class ResamplingUnit:
    """A part of the data that is drawn as a whole; rows : (m,) bool, its residuals."""

    name: str
    rows: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ResamplingGroup:
    """Units that are drawn among each other."""

    name: str
    units: Sequence[ResamplingUnit]


def draw_counts(groups: Sequence[ResamplingGroup], random: np.random.Generator) -> list[list[int]]:
    """Return the number of draws of each unit of each group: as many as there are units."""
    return [
        random.multinomial(len(group.units), [1 / len(group.units)] * len(group.units)).tolist()
        for group in groups
    ]


def factors_of(
    problem: FitProblem, groups: Sequence[ResamplingGroup], counts: Sequence[Sequence[int]]
) -> Array:
    """Return (m,) factors of the residuals for counts of the units; all else counts once."""
    times = np.ones(len(problem.blocks.of))
    for group, own in zip(groups, counts, strict=True):
        for unit, often in zip(group.units, own, strict=True):
            times[unit.rows] = often
    factors = np.empty_like(times)
    for rows in np.split(np.arange(len(times)), problem.blocks.starts[1:]):
        block = times[rows]
        same = bool((block == block[0]).all())
        factors[rows] = block if same else np.sqrt(block / block.mean())
    return factors


def rows_of(problem: FitProblem, points: Mapping[str, NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Return (m,) which residuals are of points, by comparison; InputError if one cannot say."""
    found = np.zeros(len(problem.blocks.of), dtype=bool)
    for k, comparison in enumerate(problem.comparisons):
        mask = points.get(comparison.name)
        if mask is None:
            continue
        of_points = getattr(comparison.objective, "of_points", None)
        if of_points is None:
            said = f"{comparison.name} does not tell which of its values are of which part"
            raise InputError(None, "--over", said)
        found[problem.rows(k)] = of_points(mask)
    return found


Fold = Mapping[str, NDArray[np.bool_]]  # points given to the fit, by comparison


def folds_of(specimens: Mapping[str, Sequence[int]], count: int, seed: int) -> list[Fold]:
    """Return the points that each of `count` folds gives to the fit, by comparison.
    A comparison of several specimens loses whole specimens, because the points of one err together;
    one of a single specimen loses points drawn at random; each point is left out once. specimens :
    (n,) number of the specimen of each point, by comparison; others lose nothing."""
    random = np.random.default_rng(seed)
    place = {}
    for name, whose in specimens.items():
        numbers = np.unique(np.asarray(whose))
        if len(numbers) > 1:
            of = dict(zip(numbers.tolist(), random.permutation(len(numbers)) % count, strict=True))
            place[name] = np.array([of[int(w)] for w in whose])
        else:
            place[name] = random.permutation(len(whose)) % count
    return [{name: where != fold for name, where in place.items()} for fold in range(count)]
