"""A start of a fit: it draws feasible unknowns, descends to an optimum, and records analyses."""

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
from ..experiments.run_records import strains_of
from ..inference.methods import FitOptions
from ..inference.problem import FitProblem, Optimum
from ..inference.search import feasible_start, fit_from
from ..materials.forms.base import Array

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
