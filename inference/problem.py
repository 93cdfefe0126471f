"""One fit as a function of its unknowns: residual, Jacobian, weights, count of analyses, end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from ..errors import InputError, SolverFailure
from ..materials.forms.base import SHEAR, Array
from ..materials.law import HypoelasticLaw
from ..processes import Copies, copies_for
from ..solvers.base import DifferentiatingSolver, History, Solver, instability
from .comparison import Comparison, ComparisonState, LearningSolver, WarmStart
from .objective import Blocks
from .unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class Evaluation:
    """An analysis that ended well, as the optimiser sees it.

    Attributes
    ----------
    unknowns : (unknowns,) array
    coefficients : (free,) array, MPa
    residual : (m,) array
    value : float
        The objective e, the sum of the norms of the blocks (Eq. 3.7 or 4.8).
    jacobian : (m, unknowns) array, optional
    histories : tuple of History
        Run of each comparison.
    stable : bool
        Whether every equilibrium that has to be stable was found so, as far as it was checked.
    rounding : float
        The part of e that the digits of the results make, as far as they are known.
    """

    unknowns: Array
    coefficients: Array
    residual: Array
    value: float
    jacobian: Array | None
    histories: tuple[History, ...]
    stable: bool = True
    rounding: float = 0.0

    def is_fitted(self, tolerance: float) -> bool:
        """Return whether e is below a tolerance, or below what the digits of results make."""
        return self.value < max(tolerance, self.rounding)

    @property
    def from_cache(self) -> bool:
        """Return whether the runs of all comparisons were taken from the cache."""
        return bool(self.histories) and all(history.from_cache for history in self.histories)

    @property
    def status(self) -> str:
        """Return how the analysis ended, in words."""
        if self.stable:
            return "ok, from the cache" if self.from_cache else "ok"
        reasons = (instability(history.unstable) for history in self.histories)
        return next(reason for reason in reasons if reason)


#: Components of a displacement, as many as an objective of fields has columns.
COMPONENTS_OF_FIELDS = 3
#: Norm of a block over that of its noise up to which its squares weigh by the noise.
WEIGHED_BY_NOISE = 10.0
#: Called after every analysis with unknowns, e (None when it failed), its status, and the solver.
Watch = Callable[[Array, float | None, str, str], None]


@dataclass(frozen=True, eq=False)
class _Run:
    """A run of one comparison: residual (m,), and its slopes if it was differentiated.

    These are by the unknowns of the comparison (`Unknowns.columns_of`) only. With where the next
    run may start, if that is new, and the processor time that this one took.
    """

    history: History
    residual: Array
    jacobian: Array | None
    warm_start: WarmStart | None = None
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class _Analysis:
    """Hold what a process needs to run a comparison.

    Attributes
    ----------
    unknowns : (unknowns,) array
    with_jacobian, warm : bool
        See `FitProblem.evaluate`.
    state : ComparisonState, optional
        State of the comparison to take before the run; None where the copy has it already.
    """

    unknowns: Array
    with_jacobian: bool
    warm: bool
    state: ComparisonState | None = None


class _Team:
    """Copies of this process that run comparisons of a problem beside it.

    Each process has the warm starts and objectives of its comparisons; where these are others in
    this process by now, a copy is sent them with its next analysis.
    """

    def __init__(
        self,
        comparisons: Sequence[Comparison],
        copies: Copies[_Analysis, _Run | SolverFailure],
    ) -> None:
        self.comparisons = comparisons
        self.copies = copies
        self.states = [comparison.state for comparison in comparisons]

    @classmethod
    def of(
        cls,
        comparisons: Sequence[Comparison],
        run: Callable[[int, _Analysis], _Run | SolverFailure],
    ) -> _Team | None:
        """Return copies for comparisons; None where they are not allowed."""
        if not all(comparison.may_run_aside for comparison in comparisons):
            return None
        seconds = [comparison.seconds for comparison in comparisons]
        if not all(seconds):  # as long as they have not run, all count alike
            seconds = [1.0] * len(comparisons)
        copies = copies_for(run, seconds)
        return None if copies is None else cls(comparisons, copies)

    def run(self, analysis: _Analysis) -> list[_Run | SolverFailure]:
        """Run all comparisons; one behind a failure is left as if it had not run."""
        before = [comparison.state for comparison in self.comparisons]
        messages = [
            replace(analysis, state=None if state.is_same(state_of_copy) else state)
            for state, state_of_copy in zip(before, self.states, strict=True)
        ]
        runs = self.copies.run(messages)
        has_failed = False
        for k, (comparison, run) in enumerate(zip(self.comparisons, runs, strict=True)):
            comparison.state = self.states[k] = before[k]
            if isinstance(run, SolverFailure):
                has_failed = True
                continue
            if run.warm_start is not None:
                self.states[k] = before[k]._replace(warm_start=run.warm_start)
            if not has_failed:
                comparison.state = self.states[k]
                comparison.seconds = run.seconds
        if not self.copies.is_balanced([comparison.seconds for comparison in self.comparisons]):
            self.copies.end()  # the next analysis makes others
        return runs


class Starts(Protocol):
    """A way to choose starts by their number alone, the same on any machine."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield laws whose moduli keep the bounds, in the order in which they are to be tried.

        Parameters
        ----------
        unknowns : Unknowns
        seed : int
            Seed of the study.
        number : int
            Index of the start, from 0.

        Yields
        ------
        (size,) array, MPa
            Free coefficients.
        """


@dataclass(eq=False)
class FitProblem:
    """The comparisons, law and unknowns of one fit; an analysis runs every comparison once.

    Where nuisance parameters have priors, their deviations are the last block of the residual.

    Attributes
    ----------
    comparisons : tuple of Comparison
        With different names.
    law : HypoelasticLaw
        Law from which all is taken that is no unknown: nu12, strain range, thickness option.
    unknowns : Unknowns
    watch : callable, optional
        See `Watch`.
    surrogate : FitProblem, optional
        The same fit with a solver that gives derivatives, where this one's solver gives none.
    starts : Starts, optional
        How starting points are chosen, at random by default.
    analyses : int
        Number of analyses up to now.
    last_unstable : int
        Value of `analyses` at the last analysis that ended in an unstable equilibrium; 0 if none.
    cached : int
        Number of analyses that came from the cache of runs.
    failure : str
        Reason for which the last failed analysis failed.
    warm_starts : bool
        Whether analyses may start from the last solution with derivatives.
    blocks : Blocks
        Blocks of the residual.

    Raises
    ------
    InputError
        Comparisons have one name, or nuisance is not among the unknowns.
    """

    comparisons: tuple[Comparison, ...]
    law: HypoelasticLaw
    unknowns: Unknowns
    watch: Watch | None = None
    surrogate: FitProblem | None = None
    starts: Starts | None = None
    analyses: int = 0
    last_unstable: int = 0
    cached: int = 0
    failure: str = ""
    warm_starts: bool = True
    blocks: Blocks = field(init=False, repr=False)
    _team: _Team | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        names = [comparison.name for comparison in self.comparisons]
        if not names or len(set(names)) < len(names):
            problem = f"expected comparisons with a name of their own each, got {names}"
            raise InputError(None, "comparisons", problem)
        for comparison in self.comparisons:
            if comparison.nuisance != self.unknowns.nuisance.comparisons.get(comparison.name, ()):
                problem = f"the nuisance of {comparison.name} is not among the unknowns"
                raise InputError(None, "unknowns", problem)
        # Numbers of residuals of each block: comparisons in turn, and the priors last.
        sizes = [size for comparison in self.comparisons for size in comparison.objective.sizes]
        prior_count = len(self.unknowns.nuisance.priors[0])
        sizes += [prior_count] if prior_count else []
        columns = [
            self.unknowns.columns_of(c.name) for c in self.comparisons for _ in c.objective.sizes
        ]
        columns += [np.arange(self.unknowns.count)] if prior_count else []
        self.blocks = Blocks(sizes, columns=columns)
        # `_least_norms` needs the blocks, first without those norms.
        if self._weighs_by_noise:
            self.blocks = Blocks(sizes, self._least_norms, columns)

    @property
    def solver(self) -> Solver:
        """Return the solver proper of the fit: that of the first comparison that runs a model.

        Comparisons in closed form (`closed` of their solver) are passed over if there are others.
        """
        solvers = [comparison.solver for comparison in self.comparisons]
        for solver in solvers:
            if not getattr(solver, "closed", False):
                return solver
        return solvers[0]

    @property
    def is_exchangeable(self) -> bool:
        """Return whether other moduli fit the data as well, with warp and fill exchanged."""
        has_two = {"E1", "E2"} <= {*self.unknowns.form.modulus_of}
        return has_two and all(c.objective.is_exchangeable for c in self.comparisons)

    @property
    def is_curved_in_shear(self) -> bool:
        """Return whether E1 and E2 depend on an unknown G12 along a curve."""
        has_shear = SHEAR in self.unknowns.form.modulus_of
        return has_shear and any(c.objective.is_curved_in_shear for c in self.comparisons)

    @property
    def differentiates(self) -> bool:
        """Return whether that solver gives derivatives."""
        return isinstance(self.solver, DifferentiatingSolver)

    @property
    def differentiating(self) -> FitProblem:
        """Return the problem whose derivatives say how certain a fit is: the surrogate without."""
        return self if self.differentiates else self.surrogate or self

    @property
    def program_runs(self) -> Array:
        """Return the numbers (2,) of runs, and of those from the cache, that solvers counted."""
        solvers = {id(c.solver): c.solver for c in self.comparisons}.values()
        counts = [(s.runs, s.cached) for s in solvers if isinstance(s, LearningSolver)]
        return np.sum([(0, 0), *counts], axis=0)

    @property
    def scale(self) -> Array:
        """Return the deviation (m,) that makes a residual of one, in the unit of data or prior."""
        scales = [comparison.objective.scale for comparison in self.comparisons]
        return np.concatenate([*scales, 1.0 / self.unknowns.nuisance.priors[1]])

    @property
    def _weighs_by_noise(self) -> bool:
        """Return whether squares weigh by their noise: few values beside curves, and no fields."""
        objectives = [comparison.objective for comparison in self.comparisons]
        if len(objectives) == 1:
            return False
        has_fields = any(objective.columns == COMPONENTS_OF_FIELDS for objective in objectives)
        return not has_fields and any(objective.weighs_by_noise for objective in objectives)

    @property
    def _least_norms(self) -> Array:
        """Return the `Blocks.least_norms` (blocks,) of a fit that weighs its data by their noise.

        They are proportional to the mean squared noise of each block, so that all squared
        residuals weigh by it and by the weight of the comparison, and `WEIGHED_BY_NOISE` times the
        norm of its noise at least.
        """
        noise = [
            np.full(sum(comparison.objective.sizes), comparison.objective.least_noise)
            for comparison in self.comparisons
        ]
        priors = [n.prior for n in self.unknowns.nuisance.all if n.prior is not None]
        weights = np.ones(len(self.blocks.sizes))
        block_counts = [len(comparison.objective.sizes) for comparison in self.comparisons]
        of_data = np.repeat([comparison.weight for comparison in self.comparisons], block_counts)
        weights[: len(of_data)] = of_data
        norms = self.blocks.norms(np.concatenate([*noise, priors]) / self.scale) / weights
        variances = norms**2 / self.blocks.sizes
        return WEIGHED_BY_NOISE * weights * variances * float((norms / variances).max())

    def rows(self, number: int) -> slice:
        """Return where the residuals of comparison `number` (from 0) lie in the residual."""
        sizes = [sum(comparison.objective.sizes) for comparison in self.comparisons]
        return slice(sum(sizes[:number]), sum(sizes[: number + 1]))

    def norms(self, residual: Array) -> dict[str, Array]:
        """Return the norms (blocks,) of each comparison's blocks by its name; priors are left out.

        Parameters
        ----------
        residual : (m,) array
            Values of all comparisons, then of the priors.
        """
        counts = [len(comparison.objective.sizes) for comparison in self.comparisons]
        norms = np.split(self.blocks.norms(residual), np.cumsum(counts))
        names = [comparison.name for comparison in self.comparisons]
        return dict(zip(names, norms, strict=False))

    def value_of_data(self, residual: Array) -> float:
        """Return the objective e of a residual (m,) without the priors."""
        return float(np.concatenate([*self.norms(residual).values()]).sum())

    def with_solvers(self, solvers: Sequence[Solver]) -> FitProblem:
        """Return the same problem with other solvers, one for each comparison, as a surrogate."""
        comparisons = tuple(
            replace(comparison, solver=solver, warm_start=None)
            for comparison, solver in zip(self.comparisons, solvers, strict=True)
        )
        return FitProblem(comparisons, self.law, self.unknowns)

    def part(self, numbers: Sequence[int]) -> FitProblem:
        """Return the fit to the comparisons of these numbers (from 0); `watch` gets their names."""
        comparisons = tuple(self.comparisons[k] for k in numbers)
        names = ", ".join(comparison.name for comparison in comparisons)

        def watch(
            y: Array,
            value: float | None,
            status: str,
            solver: str,
        ) -> None:
            if self.watch is not None:
                # Of another sum than this problem's e: it must not stand beside that.
                end = status if value is None else f"{status}, e = {value:.6g}"
                self.watch(y, None, f"{names} alone: {end}", solver)

        return FitProblem(comparisons, self.law, self.unknowns, watch, analyses=self.analyses)

    def shift(self, external: Sequence[History], surrogate: Sequence[History]) -> None:
        """Shift the objectives as if the solver gave `external` where it gives `surrogate`."""
        pairs = zip(external, surrogate, strict=True)
        for comparison, (result, modelled) in zip(self.comparisons, pairs, strict=True):
            comparison.objective = comparison.objective.shifted(result, modelled)

    def reset(self) -> None:
        """Reset warm starts and counts, so that every start of a study begins alike."""
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
        """Run every comparison; None when one did not end well (Eqs 3.8, 4.9).

        Parameters
        ----------
        y : (unknowns,) array
        with_jacobian : bool
            Whether to compute the Jacobian of the residual as well.
        warm : bool
            Whether increments may start from the last solution with derivatives (`WarmStart`).
        """
        self.analyses += 1
        law = self.unknowns.law(self.law, y)
        runs = []
        for comparison, run in zip(
            self.comparisons,
            self._results(y, with_jacobian, warm and self.warm_starts),
            strict=False,
        ):
            if isinstance(run, SolverFailure):
                prefix = f"{comparison.name}: " if len(self.comparisons) > 1 else ""
                self.failure = prefix + run.line
                self._report(y, None, self.failure)
                return None
            runs.append(run)
        evaluation = self._evaluation(y, law, runs)
        if not evaluation.stable:
            self.last_unstable = self.analyses
        self.cached += evaluation.from_cache
        self._report(y, evaluation.value, evaluation.status)
        return evaluation

    def _results(self, y: Array, with_jacobian: bool, warm: bool) -> Iterable[_Run | SolverFailure]:
        """Return the runs of the comparisons, side by side where they may be."""
        analysis = _Analysis(y, with_jacobian, warm)
        if self._team is None or not self._team.copies.exist:
            self._team = _Team.of(self.comparisons, self._run_of)
        if self._team is None:
            return (self._run_of(k, analysis) for k in range(len(self.comparisons)))
        return self._team.run(analysis)

    def _run_of(self, number: int, analysis: _Analysis) -> _Run | SolverFailure:
        """Run the comparison `number` (from 0), in this process or in a copy of it."""
        comparison = self.comparisons[number]
        if analysis.state is not None:
            comparison.state = analysis.state
        y = analysis.unknowns
        law = self.unknowns.law(self.law, y)
        previous = comparison.warm_start
        start = time.process_time()
        try:
            run = self._run(comparison, law, y, analysis.with_jacobian, analysis.warm)
        except SolverFailure as failure:
            return failure
        comparison.seconds = time.process_time() - start
        warm_start = None if comparison.warm_start is previous else comparison.warm_start
        return replace(run, warm_start=warm_start, seconds=comparison.seconds)

    def _run(
        self,
        comparison: Comparison,
        law: HypoelasticLaw,
        y: Array,
        with_jacobian: bool,
        warm: bool,
    ) -> _Run:
        """Run a comparison at unknowns y; raise SolverFailure when it does not end well."""
        unknowns = self.unknowns
        nuisance = unknowns.nuisance_values(comparison.name, y)
        jacobian = None
        if with_jacobian:
            history, slope = comparison.differentiate(law, unknowns.free, nuisance, warm)
            by_law = slope[:, : unknowns.size] @ unknowns.to_coefficients
            jacobian = np.hstack([by_law, slope[:, unknowns.size :]])
        else:
            history = comparison.run(law, unknowns.free, nuisance, warm)
        residual = comparison.objective.residual(history, nuisance)
        if not np.isfinite(residual).all():
            raise SolverFailure("the results are not finite")
        return _Run(history, residual, jacobian)

    def _evaluation(self, y: Array, law: HypoelasticLaw, runs: Sequence[_Run]) -> Evaluation:
        """Return runs of all comparisons, and the priors of the nuisance, as an evaluation.

        Parameters
        ----------
        y : (unknowns,) array
            Unknowns of the runs.
        law : HypoelasticLaw
            The law that they make.
        runs : sequence of _Run
            One for each comparison.
        """
        positions, prior_slopes = self.unknowns.nuisance.priors
        deviation = y[self.unknowns.size :] - self.unknowns.nuisance.start
        prior_residual = prior_slopes * deviation[positions]
        residual = np.concatenate([*(run.residual for run in runs), prior_residual])
        jacobian = None
        if all(run.jacobian is not None for run in runs):
            jacobian = np.zeros((len(residual), self.unknowns.count))
            for k, (comparison, run) in enumerate(zip(self.comparisons, runs, strict=True)):
                columns = self.unknowns.columns_of(comparison.name)
                jacobian[self.rows(k), columns] = run.jacobian
            prior_rows = len(residual) - len(positions) + np.arange(len(positions))
            jacobian[prior_rows, self.unknowns.size + positions] = prior_slopes
        histories = tuple(run.history for run in runs)
        is_stable = all(
            history.stable is not False
            for comparison, history in zip(self.comparisons, histories, strict=True)
            if comparison.must_be_stable
        )
        coefficients = law.beta[list(self.unknowns.free)]
        value = self.blocks.value(residual)
        return Evaluation(
            y.copy(),
            coefficients,
            residual,
            value,
            jacobian,
            histories,
            is_stable,
            sum(
                comparison.objective.rounding(history)
                for comparison, history in zip(self.comparisons, histories, strict=True)
            ),
        )

    def _report(self, y: Array, value: float | None, status: str) -> None:
        """Tell the watcher of an evaluation at y (unknowns,) with its objective, if it has one."""
        if self.watch is not None:
            self.watch(y, value, status, self.solver.name)


@dataclass(eq=False)
class WeightedProblem(FitProblem):
    """A fit problem whose residuals are multiplied by factors.

    Attributes
    ----------
    factors : (m,) array
        Factor of each residual.
    """

    factors: Array = field(default_factory=lambda: np.empty(0))

    @property
    def scale(self) -> Array:
        """Return (m,) units of the data per unit of the multiplied residual."""
        return super().scale / np.where(self.factors > 0, self.factors, 1.0)

    @classmethod
    def of(cls, problem: FitProblem, factors: Array) -> WeightedProblem:
        """Return a new problem with factors on the residuals of another.

        Its comparisons are copies that begin with the last solutions of the originals, which its
        runs leave alone.

        Parameters
        ----------
        problem : FitProblem
        factors : (m,) array
            Factor of each residual.
        """
        comparisons = tuple(replace(comparison) for comparison in problem.comparisons)
        weighted = cls(comparisons, problem.law, problem.unknowns, factors=factors)
        # What is minimised of a block is then multiplied by its factor on both sides of its least.
        blocks = problem.blocks
        of_blocks = blocks.norms(factors) / np.sqrt(blocks.sizes)
        of_blocks[of_blocks == 0] = 1.0
        weighted.blocks = Blocks(blocks.sizes, of_blocks * blocks.least_norms, blocks.columns)
        return weighted

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every comparison as `FitProblem.evaluate` at y (unknowns,), and weight the result."""
        evaluation = super().evaluate(y, with_jacobian, warm)
        return None if evaluation is None else self.weighted(evaluation)

    def weighted(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation of the problem without factors with them, without a run."""
        residual = self.factors * evaluation.residual
        slope = evaluation.jacobian
        return replace(
            evaluation,
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

    Attributes
    ----------
    best : Evaluation
    status : str
        How the fit ended: CONVERGED, LEVEL, ANALYSES_USED_UP, RUNS_USED_UP, or a failure.
    analyses : int
        Number of analyses by all solvers, surrogates included.
    runs : int
        Number of runs of the solver proper, in a fit that a surrogate led; 0 without a surrogate.
    failure : str
        Failure of the solver proper, if it ended such a fit.
    """

    best: Evaluation
    status: str
    analyses: int
    runs: int = 0
    failure: str = ""

    @property
    def value(self) -> float:
        """Return the objective e."""
        return self.best.value

    @property
    def coefficients(self) -> Array:
        """Return the free coefficients, MPa."""
        return self.best.coefficients
