"""The starts of a fit, each from feasible unknowns to an optimum; the best is run once more."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from pydantic import TypeAdapter

from ..errors import NoFeasibleStart, SolverFailure
from ..experiments.forward import strains_of
from ..inference.assessment import Certainty
from ..inference.methods import FitOptions
from ..inference.objective import Blocks
from ..inference.problem import Evaluation, FitProblem, Optimum
from ..inference.search import feasible_start, fit_from
from ..materials.forms.base import Array
from ..materials.forms.symmetry import pooled_ends
from ..materials.law import HypoelasticLaw
from ..notes import Note

#: The mesh that a start ran on: the project's own, or the coarse one that precedes it.
MeshName = Literal["full", "coarse"]


@dataclass(frozen=True)
class Stage:
    """An event: a stage of a fit begins, in which `total` of `counted` ("starts") are to end."""

    counted: str
    total: int


@dataclass(frozen=True)
class EvaluationRecord:
    """One analysis of a start, a row of history.csv.

    Attributes
    ----------
    start, analysis : int
        Numbers of the start and, from 1, of its analysis.
    objective : float or None
        None if the analysis failed.
    status : str
    coefficients, nuisance : tuple of float
        Coefficients of the law (MPa), and nuisance unknowns in their units.
    solver : str
        Name of the solver that ran it.
    mesh : str
    """

    start: int
    analysis: int
    objective: float | None
    status: str
    coefficients: tuple[float, ...]
    nuisance: tuple[float, ...]
    solver: str = "membrane"
    mesh: MeshName = "full"


@dataclass(frozen=True)
class StartRecord:
    """The end of one start, a line of starts.jsonl.

    Attributes
    ----------
    number : int
    seed : tuple of int
        Seed of the fit and number of the start, which together seed its random draws.
    objective : float or None
        Objective at the optimum; None if the start found none.
    status : str
        Why the start ended.
    analyses : int
        Number of all its analyses, including those on the coarse mesh.
    unknowns : tuple of float
        The optimiser's unknowns at the optimum.
    coefficients : tuple of float
        Coefficients of the law at the optimum, MPa.
    wall_s : float
        Wall-clock time in seconds.
    external_runs, cached_runs : int
        Analyses by an external solver, and those that it had run earlier.
    failure : str
        Why the solver failed, if that ended the start. Such a start is run again if the fit is
        resumed.
    reached : tuple of float
        Largest (eps1, eps2, gamma12) at the optimum.
    mesh : str
        Mesh on which `objective` was computed, "full" or "coarse".
    coarse_objective, coarse_analyses
        Objective, and number of analyses, on the coarse mesh if the start ran there.
    same_as : int or None
        Number of the start whose fit on the full mesh this one took, as both ended in the same
        optimum on the coarse mesh; None for a start with a fit of its own.
    """

    number: int
    seed: tuple[int, int]
    objective: float | None
    status: str
    analyses: int = 0
    unknowns: tuple[float, ...] = ()
    coefficients: tuple[float, ...] = ()
    wall_s: float = 0.0
    external_runs: int = 0
    failure: str = ""
    reached: tuple[float, ...] = ()
    mesh: MeshName = "full"
    coarse_objective: float | None = None
    coarse_analyses: int = 0
    same_as: int | None = None
    cached_runs: int = 0

    @property
    def text(self) -> str:
        """Return the record as a line of JSON, every number in full."""
        return json.dumps(asdict(self)) + "\n"

    @classmethod
    def read(cls, text: str) -> StartRecord:
        """Return the record in a line of starts.jsonl; raise ValueError if it is damaged."""
        return TypeAdapter(cls).validate_json(text)


#: What a start reports while it runs, and at its end.
Event = EvaluationRecord | StartRecord


class EvaluationCounter:
    """Count the analyses of one start, and report each of them.

    Parameters
    ----------
    problem : FitProblem
    number : int
        Number of the start.
    mesh : str
        Mesh of the problem.
    on_event : callable
        Receives an EvaluationRecord after each analysis.
    analyses : int
        Number of analyses of this start so far, on the coarse mesh.
    """

    def __init__(
        self,
        problem: FitProblem,
        number: int,
        mesh: MeshName,
        on_event: Callable[[EvaluationRecord], None],
        analyses: int,
    ) -> None:
        self.problem = problem
        self.number = number
        self.mesh = mesh
        self.on_event = on_event
        self.analyses = analyses
        self.external_runs = 0

    def __call__(self, y: Array, objective: float | None, status: str, solver: str) -> None:
        """Count an analysis with the unknowns y, and report it."""
        self.analyses += 1
        if self.problem.solver.external and solver == self.problem.solver.name:
            self.external_runs += 1
        size = self.problem.unknowns.size
        coefficients = self.problem.unknowns.to_coefficients @ y[:size]
        record = EvaluationRecord(
            self.number,
            self.analyses,
            objective,
            status,
            tuple(coefficients.tolist()),
            tuple(y[size:].tolist()),
            solver,
            self.mesh,
        )
        self.on_event(record)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Count the evaluations of the problem and of its surrogate within the block."""
        problems = problems_of(self.problem)
        for problem in problems:
            problem.watch = self
        try:
            yield
        finally:
            for problem in problems:
                problem.watch = None


def run_start(
    problem: FitProblem,
    options: FitOptions,
    seed: int,
    number: int,
    on_event: Callable[[EvaluationRecord], None],
    mesh: MeshName = "full",
    coarse: StartRecord | None = None,
) -> StartRecord:
    """Draw a feasible start and fit from it.

    Parameters
    ----------
    problem : FitProblem
    options : FitOptions
    seed, number : int
        Seed of the fit and number of the start.
    on_event : callable
        Receives an EvaluationRecord after each analysis.
    mesh : str
        Mesh of the problem.
    coarse : StartRecord or None
        The end of this start on the coarse mesh, at whose optimum the fit begins; its analyses are
        included in the record.
    """
    start_time = time.perf_counter()
    problem.reset()
    earlier_runs = problem.program_runs
    earlier_analyses = 0 if coarse is None else coarse.analyses
    counter = EvaluationCounter(problem, number, mesh, on_event, earlier_analyses)
    optimum: Optimum | None = None
    failure = ""
    try:
        with counter.watching():
            optimum = optimum_from(problem, options, seed, number, coarse)
    except NoFeasibleStart as error:
        status = str(error)
    else:
        failure = failure_of(problem) if optimum is None else optimum.failure
        status = f"{problem.solver.name} failed: {failure}"
    external_runs = counter.external_runs
    cached_runs = problem.cached if problem.solver.external else 0
    program_runs, program_runs_cached = (problem.program_runs - earlier_runs).tolist()
    if program_runs:  # those of derivatives among them
        external_runs = program_runs
        cached_runs = program_runs_cached
    record = StartRecord(
        number=number,
        seed=(seed, number),
        objective=None,
        status=status,
        analyses=counter.analyses,
        wall_s=time.perf_counter() - start_time,
        external_runs=external_runs - cached_runs,
        failure=failure,
        mesh=mesh,
        cached_runs=cached_runs,
    )
    if coarse is not None:
        record = replace(
            record,
            wall_s=record.wall_s + coarse.wall_s,
            coarse_objective=coarse.objective,
            coarse_analyses=coarse.analyses,
        )
    return record if optimum is None else at_optimum(record, optimum)


def problems_of(problem: FitProblem) -> list[FitProblem]:
    """Return the problem and its surrogate, if it has one."""
    return [problem] if problem.surrogate is None else [problem, problem.surrogate]


def optimum_from(
    problem: FitProblem, options: FitOptions, seed: int, number: int, coarse: StartRecord | None
) -> Optimum | None:
    """Fit from the optimum on the coarse mesh or a random start; return None if it failed."""
    if coarse is not None and coarse.objective is not None:
        return fit_from(problem, np.array(coarse.unknowns), options, without_lead_in=True)
    return fit_from(problem, feasible_start(problem, seed, number), options)


def failure_of(problem: FitProblem) -> str:
    """Return why the project's solver failed, or else why its surrogate did."""
    for failed in problems_of(problem):
        if failed.failure:
            return failed.failure
    return "the first analysis failed"


def at_optimum(record: StartRecord, optimum: Optimum) -> StartRecord:
    """Return the record of a start completed with the optimum that it found."""
    reached = np.max([strains_of(history) for history in optimum.best.histories], axis=0)
    return replace(
        record,
        objective=optimum.value,
        status=optimum.status,
        reached=tuple(reached.tolist()),
        unknowns=tuple(optimum.best.unknowns.tolist()),
        coefficients=tuple(optimum.coefficients.tolist()),
    )


#: Differences of a repeated objective that count as rounding, relative to the objective and to the
#: share of the noise of the data in it.
OBJECTIVE_ROUNDING = 1e-5
NOISE_ROUNDING = 1e-6
#: Least strain that counts as reached, so that no range of strains is empty.
LEAST_STRAIN = 1e-6


@dataclass(frozen=True, eq=False)
class BestFit:
    """The best fit of all starts, with its optimum run once more.

    Attributes
    ----------
    point : Evaluation
        The analysis of the tests at the optimum, by the project's solver.
    with_derivatives : Evaluation or None
        The same analysis with derivatives, which may be those of a surrogate, as its histories then
        are; None if no solver could give them.
    law : HypoelasticLaw
        The law at the optimum.
    ranked : sequence of StartRecord
        The starts that ended with a fit, best first.
    records : sequence of StartRecord
        All starts, by number.
    reached : (3,) array
        Largest strains (eps1, eps2, gamma12) along warp, along fill and in shear over all tests.
    certainty : Certainty or None
        The uncertainty of the fit; None without derivatives.
    notes : tuple of Note
        Which other assumptions on the tests were tried.
    """

    point: Evaluation
    with_derivatives: Evaluation | None
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None = None
    notes: tuple[Note, ...] = ()

    @property
    def valid(self) -> Array:
        """Return the strains (3,) up to which moduli are fitted; beyond, they are held constant."""
        return np.minimum(pooled_ends(self.law.form, self.reached), self.law.strain_range)

    @property
    def analyses(self) -> int:
        """Return the number of analyses of the tests in all starts, on any mesh."""
        return sum(record.analyses + record.coarse_analyses for record in self.records)


def best_fit(problem: FitProblem, records: Sequence[StartRecord], tolerance: float) -> BestFit:
    """Run the optimum of the best start again from the unloaded state, and return the best fit.

    An analysis by another program that fails is tried a second time.

    Parameters
    ----------
    problem : FitProblem
    records : sequence of StartRecord
        At least one of them with a fit.
    tolerance : float
        Absolute difference up to which two objectives are the same.

    Raises
    ------
    SolverFailure
        The optimum cannot be run again, or gives another objective.
    """
    ranked = ranking(records)
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # Without derivatives of the solver, uncertainty follows from those of its surrogate.
    differentiating = problem.differentiating
    gives_derivatives = differentiating is problem
    point = problem.evaluate(unknowns, gives_derivatives, warm=False)
    if point is None and problem.solver.external:
        point = problem.evaluate(unknowns, gives_derivatives, warm=False)
    if point is None:
        message = f"the best fit does not run again: {problem.failure}"
        raise SolverFailure(
            f"{message}; its starts are kept, --resume goes on", problem.solver.name
        )
    check_objective(problem, ranked[0], point, tolerance)
    first = replace(ranked[0], objective=point.value)
    differentiated: Evaluation | None = point
    if not gives_derivatives:
        differentiated = differentiating.evaluate(unknowns, True, warm=False)
        if differentiated is not None:
            # What the solver leaves is the fit's residual, not its difference to the surrogate.
            differentiated = replace(differentiated, residual=point.residual, value=point.value)
    return BestFit(
        point,
        differentiated,
        problem.unknowns.law(problem.law, unknowns),
        [_like(record, first) for record in ranked],
        [_like(record, first) for record in records],
        reached_by(point),
    )


def check_objective(
    problem: FitProblem, record: StartRecord, point: Evaluation, tolerance: float
) -> None:
    """Raise SolverFailure if the analysis `point` does not give the objective of its start."""
    assert record.objective is not None
    noise = sum(noise_of(problem).values())
    largest = max(point.value, record.objective)
    limit = OBJECTIVE_ROUNDING * largest + NOISE_ROUNDING * noise + tolerance
    if abs(point.value - record.objective) > limit:
        raise SolverFailure(
            f"start {record.number} ended with an objective of {record.objective:.6g}, and the "
            f"same moduli give {point.value:.6g} from the unloaded state: the fit hangs on the way "
            "it was reached; more increments usually help",
            problem.solver.name,
        )


def reached_by(point: Evaluation) -> Array:
    """Return the largest strains (eps1, eps2, gamma12) of all analyses, at least `LEAST_STRAIN`."""
    strains = [strains_of(history) for history in point.histories]
    return np.maximum(np.max(strains, axis=0), LEAST_STRAIN)


def _like(record: StartRecord, first: StartRecord) -> StartRecord:
    """Return a record with the objective of `first`, the best start, if it has the same fit."""
    if record.number == first.number:
        return first
    return replace(record, objective=first.objective) if record.same_as == first.number else record


def ranking(records: Sequence[StartRecord]) -> list[StartRecord]:
    """Return the starts that ended with a fit, best first."""
    fitted = [record for record in records if record.objective is not None]
    return sorted(fitted, key=lambda record: (record.objective, record.number))


def noise_of(problem: FitProblem) -> dict[str, float]:
    """Return the share of noise (scatter or instrument) in the objective, by comparison."""
    return {
        c.name: Blocks(c.objective.sizes).value(c.objective.least_noise / c.objective.scale)
        for c in problem.comparisons
    }


log = logging.getLogger(__name__)


def log_record(record: Event | None) -> None:
    """Log an analysis or the end of a start; nothing for None."""
    if isinstance(record, EvaluationRecord):
        result = "failed" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d, analysis %d by %s%s: %s, %s",
            record.start,
            record.analysis,
            record.solver,
            ", coarse mesh" if record.mesh == "coarse" else "",
            result,
            record.status,
        )
    elif isinstance(record, StartRecord):
        result = "no fit" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d ended: %s, %s; %d analyses in %.2f s",
            record.number,
            record.status,
            result,
            record.analyses,
            record.wall_s,
        )
