"""A fit: every start of the chosen tests, the best of them once more, and what it means."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

from ..errors import NoFeasibleStart, SolverFailure
from ..experiments.fittable import FittableTest
from ..identification.problem import FitProblem
from .best import BestFit, best_fit
from .budget import with_certainty
from .doubts import judge
from .facts import facts_of, solver_facts
from .failure_page import failure_page
from .logged import log_record, timed
from .project import Project
from .record import Record, data_rows, this_run
from .result import Fit
from .running_files import HISTORY, STARTS, RunningFiles
from .setup import FitSetup, fingerprints, prepare_fit
from .stages import every_start
from .start import EvaluationRecord, Stage, StartRecord
from .store import Store
from .written import settings_of

Event = EvaluationRecord | StartRecord | Stage
#: Is told of every analysis and every start as it ends, of a stage of several as it begins, and of
#: time passing (None).
Progress = Callable[[Event | None], None]


def fit(
    project: Project,
    tests: str | Sequence[str] | None = None,
    *,
    starts: int | None = None,
    seed: int | None = None,
    starts_from: str | None = None,
    earlier: Path | str | None = None,
    method: str | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    command_line: Sequence[str] | None = None,
) -> Fit:
    """Fit the law of a project to its tests, from random feasible starts.

    Parameters
    ----------
    tests : names of tests, or a kind of test; every test that can be fitted unless given.
    starts, seed, method, jobs : instead of the project's own settings; jobs are processes, all
        cores unless the project says otherwise.
    scheduler : address of a Dask scheduler, whose workers run the starts instead of this machine.
    starts_from, earlier : "random", "sobol" (spread evenly) or "proposed", by what the fit in the
        folder `earlier` evaluated.
    trust : names of doubts about the data that stop nothing, beside those of the project.
    out : folder in which every analysis and start is written as it ends, so that an interrupted
        fit can be gone on with (`resume`); nothing is written without it.
    overwrite : replace what the folder holds.
    progress : is told of every record; None now and then while nothing ends. An interrupt
        (Ctrl-C) leaves the folder ready for `resume`.
    command_line : of the command that asks, for the record; None where Python does.

    Returns
    -------
    The result: card, moduli and residuals as tables, `report(folder)` for the page.

    Raises
    ------
    InputError : in the project or its data, or nothing to go on with. OutputError : the folder is
        used or cannot be written. NoFeasibleStart : of all starts. SolverFailure : the solver is
        not there, it failed in every start, or the best fit does not run again or gives another
        objective: then the page in `out` says so, and there is no result.
    """
    begun = time.perf_counter()
    trusted = [*project.fit.trust, *trust]
    project = project.with_fit(starts=starts, seed=seed, method=method, jobs=jobs, trust=trusted)
    project = project.with_fit(
        starts_from=starts_from, earlier=None if earlier is None else str(Path(earlier).absolute())
    )
    project = project.with_scheduler(scheduler)
    project.executor.check()
    chosen = cast(Sequence[FittableTest], project.chosen(tests, fitted=True))
    with timed("tests and their data made ready"):
        setup = prepare_fit(project, chosen)
    problem = setup.problem()
    judgements = judge(setup)
    for judgement in judgements:
        judgement.demand(project.path)
    record = _record(setup, problem, command_line)
    files = None
    done: list[StartRecord] = []
    if out is not None:
        store = Store(Path(out))
        facts = facts_of(setup, problem.solver, record.data)
        parts = fingerprints(setup, problem)
        if store.begin(parts, resume, overwrite, (STARTS, HISTORY), facts):
            record = record.after(store.path)
        record.write(store.path)
        unknowns, scales = problem.unknowns, project.scales
        columns = [f"{label}_{scales.modulus_unit}" for label in unknowns.labels]
        scale = [scales.modulus] * unknowns.size + [1.0] * len(unknowns.nuisance_names)
        files = RunningFiles(store, [*columns, *unknowns.nuisance_names], scale)
        done = files.begin(resume)
    with failure_page(None if out is None else Path(out), project.title):
        with timed("all starts"):
            records = _records(setup, files, done, progress or _nobody)
        with timed("the best fit once more, and how sure it is"):
            best = with_certainty(setup, problem, _best(problem, records, project))
    return Fit(setup, problem, best, time.perf_counter() - begun, record, judgements)


def _record(setup: FitSetup, problem: FitProblem, command_line: Sequence[str] | None) -> Record:
    project, tests = setup.project, [(test.test.name, test) for test in setup.tests]
    return Record(
        project.path,
        None if project.written is None else project.written.text,
        None if project.written is None else settings_of(project, [name for name, _ in tests]),
        data_rows(tests),
        solver_facts(project.fit.solver, problem.solver.identity),
        [this_run(command_line)],
    )


def _best(problem: FitProblem, records: Sequence[StartRecord], project: Project) -> BestFit:
    """The best of the starts, run again; raises NoFeasibleStart, SolverFailure."""
    if any(r.objective is not None for r in records):
        return best_fit(problem, records, project.fit.tolerance)
    failed = next((r for r in records if r.failure), None)
    if failed is None:
        raise NoFeasibleStart(f"{project.path}: no feasible start: {records[0].status}")
    problem_said = f"no start ended with a fit: {failed.failure}"
    raise SolverFailure(f"{problem_said}; --resume tries again", problem.solver.name)


def _records(
    setup: FitSetup,
    files: RunningFiles | None,
    done: Sequence[StartRecord],
    progress: Progress,
) -> list[StartRecord]:
    """Every start: those that are finished already, and the others side by side."""

    def ran(record: EvaluationRecord | StartRecord | None) -> None:
        if record is not None and files is not None:
            files.add(record)
        log_record(record)
        progress(record)

    try:
        records = every_start(setup, done, ran, progress)
    finally:
        if files is not None:
            files.close()
    if files is not None:
        files.finish()
    return records


def _nobody(record: Any) -> None:
    """Nobody wants to know."""
