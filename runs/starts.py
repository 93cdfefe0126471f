"""One start of a fit, from its number to its optimum, and the records of what happens."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from pydantic import TypeAdapter

from ..errors import NoFeasibleStart
from ..experiments.strains import strains_of
from ..inference.feasible_start import feasible_start
from ..inference.methods import FitOptions
from ..inference.optimum import Optimum
from ..inference.problem import FitProblem
from ..inference.search import fit_from
from ..materials.forms.base import Array

#: Mesh of a record: that of the project, or the coarse one that leads to it.
MeshName = Literal["full", "coarse"]


@dataclass(frozen=True)
class Stage:
    """The begin of a stage of a fit: what is counted in it, in words, and how many there are."""

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
        Of the law (MPa), and in the units of the nuisance unknowns.
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
        Seed of the fit, and the number.
    objective : float or None
        None without a fit.
    status : str
    analyses : int
        All, those by an earlier run and on the coarse mesh included.
    unknowns : tuple of float
        Those of the optimiser at the optimum.
    coefficients : tuple of float
        Of the law, MPa.
    wall_s : float
        Seconds.
    external_runs, cached_runs : int
        Analyses by an external solver, and those that it had run earlier.
    failure : str
        Of the solver, if that ended the start, which is run again on resuming.
    reached : tuple of float
        Largest (eps1, eps2, gamma12) at the optimum.
    mesh : str
        That of the objective.
    coarse_objective, coarse_analyses
        Those on the coarse mesh, if it ran there.
    same_as : int or None
        The start with the same optimum on the coarse mesh, which alone was fitted on the full one.
    """

    number: int
    seed: tuple[int, int]
    objective: float | None
    status: str
    analyses: int
    unknowns: tuple[float, ...]
    coefficients: tuple[float, ...]
    wall_s: float
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
        """Return the record of a line; raises ValueError if it is none."""
        return TypeAdapter(cls).validate_json(text)


#: What a start reports while it runs, and at its end.
Event = EvaluationRecord | StartRecord


class EvaluationCounter:
    """Count the analyses of one start, and report each of them.

    Parameters
    ----------
    problem : FitProblem
    number : int
        Of the start.
    mesh : str
    on_event : callable
        Receives an EvaluationRecord after each analysis.
    analyses : int
        Those of the start so far, on the coarse mesh.
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
            tuple(np.asarray(y[size:]).tolist()),
            solver,
            self.mesh,
        )
        self.on_event(record)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Count what the problem, and the surrogate that leads it, evaluate within the block."""
        watched = problems_of(self.problem)
        for problem in watched:
            problem.watch = self
        try:
            yield
        finally:
            for problem in watched:
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
        Which start it is.
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
    cached_runs = problem.cached if problem.solver.external else 0
    record = StartRecord(
        number=number,
        seed=(seed, number),
        objective=None,
        status=status,
        analyses=counter.analyses,
        unknowns=(),
        coefficients=(),
        wall_s=time.perf_counter() - start_time,
        external_runs=counter.external_runs - cached_runs,
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
    """Fit from the optimum on the coarse mesh, or from a start that is drawn; None: it failed."""
    if coarse is not None and coarse.objective is not None:
        return fit_from(problem, np.array(coarse.unknowns), options, without_lead_in=True)
    return fit_from(problem, feasible_start(problem, seed, number), options)


def failure_of(problem: FitProblem) -> str:
    """Return why the project's solver failed, or else the one that leads it."""
    for failed in problems_of(problem):
        if failed.failure:
            return failed.failure
    return "the first analysis failed"


def at_optimum(record: StartRecord, optimum: Optimum) -> StartRecord:
    """Return the record of a start that ended at an optimum."""
    reached = np.max([strains_of(history) for history in optimum.best.histories], axis=0)
    return replace(
        record,
        objective=optimum.value,
        status=optimum.status,
        reached=tuple(reached.tolist()),
        unknowns=tuple(optimum.best.unknowns.tolist()),
        coefficients=tuple(optimum.coefficients.tolist()),
    )
