"""A fit: every start of the chosen tests, the best of them once more, and what it means."""

from __future__ import annotations

import functools
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, NoFeasibleStart, Note, SolverFailure, checked
from ..experiments.kinds import (
    Expected,
    Fabric,
    Judgement,
    files_of,
    notes_of_states,
)
from ..experiments.own import OwnTest
from ..experiments.registry import kinds
from ..files import __version__, html_table, one_blas_thread
from ..inference.assessment import moduli_error
from ..inference.problem import ANALYSES_USED_UP, FitProblem
from ..materials.forms.base import COMPONENTS
from ..project.objects import Definition, Law, plain
from ..project.project import Project, settings_of
from ..solvers.base import Solver
from .best import BestFit, best_fit, ranking, with_certainty
from .estimate import Estimate, estimate_of, with_start
from .executor import Task, executor_of
from .folder import (
    DIGITS,
    NAMES,
    Record,
    Reported,
    Store,
    check_asked,
    failure_page,
    finished,
    solver_facts,
)
from .progress import Listener, listener
from .result import Fit
from .setup import UNCOUNTED, FitSetup, Saw, coarse_problem, fingerprints, prepare_fit
from .starts import (
    HISTORY,
    STARTS,
    Event,
    MeshName,
    RunningFiles,
    Stage,
    StartRecord,
    log_record,
    run_start,
    timed,
)

#: Optima are one where no modulus differs by more over the strains reached, relative: starts that
#: end in one and the same optimum of a real test differ by up to 0.7 % ...
SAME_MODULI = 0.02
#: ... and the objectives by no more, relative, beside the fit's tolerance.
SAME_OBJECTIVE = 0.01
#: Strains at which moduli are compared.
POINTS = 31


def distinct(
    problem: FitProblem, records: Sequence[StartRecord], tolerance: float
) -> list[list[StartRecord]]:
    """Return the starts grouped by optimum, in the order of their numbers.
    Each is compared with the first of a group, by objective (beyond `tolerance`) and by moduli up
    to the strains that either reached: so groups do not depend on starts of higher numbers. A start
    without an optimum is a group of its own."""
    groups: list[list[StartRecord]] = []
    for record in sorted(records, key=lambda r: r.number):
        alike = (own for own in groups if _are_one(problem, own[0], record, tolerance))
        if (group := next(alike, None)) is None:
            groups.append(group := [])
        group.append(record)
    return groups


def _are_one(problem: FitProblem, a: StartRecord, b: StartRecord, tolerance: float) -> bool:
    if a.objective is None or b.objective is None:
        return False
    room = tolerance + SAME_OBJECTIVE * min(a.objective, b.objective)
    near = abs(a.objective - b.objective) <= room
    return near and moduli_apart(problem, a, b) <= SAME_MODULI


def moduli_apart(problem: FitProblem, a: StartRecord, b: StartRecord) -> float:
    """Return the largest relative difference of a modulus of two optima over their strains."""
    one, other = (problem.unknowns.law(problem.law, np.array(record.unknowns)) for record in (a, b))
    ends = np.maximum(a.reached, b.reached)
    return max(moduli_error(one, other, ends, POINTS).values())


#: So many starts run coarse to fine by default; of fewer each is evidence of its own.
MANY_STARTS = 10
#: Times as many starts are wanted where the best optimum was found once.
MORE = 5
#: Relative difference of objectives that are as good as each other.
AS_GOOD = 1e-4


def agreement(problem: FitProblem, records: Sequence[StartRecord], project: Project) -> str:
    """Describe in how many optima starts end, and whether more are wanted; "" for one start.
    Starts that took the fit of another are said to be compared on the coarse mesh only."""
    ended = [record for record in ranking(records) if record.objective is not None]
    if len(ended) < 2:
        return ""
    room = project.fit.tolerance
    groups = distinct(problem, ended, room)
    alike = next(group for group in groups if ended[0] in group)
    # Moduli that no test determines may differ where nothing else does.
    least = (ended[0].objective or 0.0) * (1 + AS_GOOD) + room
    best = sum(one in alike or (one.objective or 0.0) <= least for one in ended)
    first = " (the first begins at the estimate)"
    said = f"starts{first if project.fit.starts_from == 'estimate' else ''} end in"
    shared = sum(one.same_as is not None for one in ended)
    only = f"; {shared} of all {len(ended)} are compared on the coarse mesh only" if shared else ""
    if best == len(ended):
        return f"all {best} {said} the same optimum{only}"
    optima = f"{len(groups)} distinct optima"
    if unfinished := sum(one.status == ANALYSES_USED_UP for one in ended):
        optima += f", {unfinished} starts not converged"
    if best > 1:
        return f"{best} of {len(ended)} {said} the best of {optima}{only}"
    return (
        f"only one of {len(ended)} {said} the best of {optima} (objective "
        f"{ended[0].objective:.4g}, the next {ended[1].objective:.4g}): there may be a better one, "
        f"and more starts are wanted (--starts {MORE * len(ended)} --starts-from random)"
    )


def every_start(
    setup: FitSetup, done: Sequence[StartRecord], ran: Callable[[Event | None], None],
    told: Callable[[StartRecord | Stage], None],
) -> list[StartRecord]:  # fmt: skip
    """Return how every start of a fit ended, by number.
    Coarse to fine, all starts run on quads of twice the edge, as most analyses only come near an
    optimum; one start of each distinct optimum is continued on the full mesh, the others take its
    fit. Unless the project says which, `MANY_STARTS` do so, or what a folder began goes on.
    done : starts that ended before. ran : receives every record as it ends, None now and then.
    told : receives a stage as it begins, and its earlier records."""
    fit, executor = setup.project.fit, executor_of(setup.project)
    full, coarse = ({r.number: r for r in done if r.mesh == mesh and r.number < fit.starts}
                    for mesh in ("full", "coarse"))  # fmt: skip

    def every(
        what: str, known: dict[int, StartRecord], build: Any, mesh: MeshName
    ) -> dict[int, StartRecord]:
        told(Stage(what, fit.starts))
        for record in known.values():
            told(record)
        missing = [n for n in range(fit.starts) if n not in known]
        made = executor.run_starts(build, setup.options, fit.seed, missing, mesh)
        return known | _ended(made, ran)

    if (wanted := fit.coarse_to_fine) is None:
        wanted = any(r.mesh == "coarse" for r in done) if done else fit.starts >= MANY_STARTS
    if not wanted or coarse_problem(setup) is None:
        full = every("starts", full, setup.problem, "full")
        return [full[n] for n in sorted(full)]
    build = functools.partial(coarse_problem, setup)
    coarse = every("starts on the coarse mesh", coarse, build, "coarse")
    groups = distinct(setup.problem(), list(coarse.values()), fit.tolerance)
    told(Stage("distinct optima on the full mesh", len(groups)))
    for group in groups:
        if (fitted := _fit_of(group, full)) is not None:
            told(fitted)
    open_groups = [g for g in groups if _fit_of(g, full) is None]
    prepare = functools.partial(_continuation, setup, open_groups)

    def lost(number: int, why: str) -> StartRecord:
        coarse = open_groups[number][-1]
        return replace(coarse, objective=None, status=why, failure=why, mesh="full")

    numbers = range(len(open_groups))
    full |= _ended(executor.run_tasks(prepare, numbers, "optima", lost), ran)
    ended = [record for group in groups for record in one_fit(group, full)]
    return sorted(ended, key=lambda record: record.number)


def _ended(
    records: Iterable[Event | None], ran: Callable[[Event | None], None]
) -> dict[int, StartRecord]:
    ended = {}
    for record in records:
        ran(record)
        if isinstance(record, StartRecord):
            ended[record.number] = record
    return ended


def _continuation(setup: FitSetup, groups: Sequence[Sequence[StartRecord]]) -> Task:
    """Return the task that fits a group on the full mesh, from its first good optimum.
    A start without an optimum on the coarse mesh begins where it was drawn."""
    problem, seed = setup.problem(), setup.project.fit.seed

    def fit(number: int, tell: Callable[[Event], None]) -> StartRecord:
        *others, last = groups[number]
        for coarse in others:
            record = run_start(problem, setup.options, seed, coarse.number, tell, coarse=coarse)
            if record.objective is not None:
                return record
            tell(record)
        return run_start(problem, setup.options, seed, last.number, tell, coarse=last)

    return fit


def _fit_of(group: Sequence[StartRecord], full: Mapping[int, StartRecord]) -> StartRecord | None:
    """Return the fit of a group on the full mesh."""
    own = (full[record.number] for record in group if record.number in full)
    return next((record for record in own if record.objective is not None), None)


def one_fit(group: Sequence[StartRecord], full: Mapping[int, StartRecord]) -> Iterator[StartRecord]:
    """Yield each start of a group with its fit on the full mesh: its own, or the group's."""
    fit = _fit_of(group, full)
    for coarse in group:
        own = full.get(coarse.number)
        if own is not None:
            yield own
            continue
        assert fit is not None  # where none has a fit, each was tried
        yield replace(
            coarse, objective=fit.objective, status=f"as start {fit.number}",
            unknowns=fit.unknowns, coefficients=fit.coefficients, reached=fit.reached,
            mesh=fit.mesh, failure="", coarse_objective=coarse.objective,
            coarse_analyses=coarse.analyses, same_as=fit.number,
        )  # fmt: skip


@checked
def fit(
    project: Project | Definition | OwnTest | Sequence[Definition | OwnTest],
    tests: str | Sequence[str] | Law | None = None, *, law: Law | None = None,
    fabric: Fabric | None = None, weights: Mapping[str, float] | None = None,
    solver_options: Mapping[str, Mapping[str, Any]] | None = None, starts: int | None = None,
    seed: int | None = None, starts_from: str | None = None,
    method: str | None = None, jobs: int | None = None, scheduler: str | None = None,
    trust: Sequence[str] = (), out: Path | str | None = None, resume: bool = False,
    overwrite: bool = False, progress: Listener = None,
    command_line: Sequence[str] | None = None, **settings: Any,
) -> Fit:  # fmt: skip
    """Fit the law of a project to its tests, from random feasible starts.

    project : one that was read; or tests as objects (`OwnTest` among them), and then the law
        follows, and `fabric` and `solver_options` are given by name. tests : names of tests, or a
        kind of test; by default all that can be fitted. weights : by name or kind of test, in place
        of their own.
    starts, seed, method, jobs : instead of the project's; jobs are processes, all cores by default.
    scheduler : address of a Dask scheduler, whose workers run the starts.
    starts_from : "random", "sobol" (spread evenly), or "estimate" (the first at the moduli by
        virtual work, the others drawn).
    trust : names of doubts about the data to ignore, beside those of the project.
    out : folder in which analyses and starts are written as they end, for `resume`. overwrite : its
        content. progress : receives analyses and starts as they end,
        stages as they begin, None now and then; unless given a bar in
        notebooks, False for none. command_line : for the record. settings : any other key of [fit].
    InputError : in the project or its data, or nothing to resume. OutputError. NoFeasibleStart : of
        all starts. SolverFailure : the solver is not there, failed in every start, or the best fit
        does not run again or gives another objective: then the page in `out` says so.
    """
    begun = time.perf_counter()
    check_asked(out, resume, overwrite)
    if not isinstance(project, Project):
        law = law or (tests if isinstance(tests, Law) else None)
        if law is None or fabric is None:
            name, such = ("law", "Law()") if law is None else ("fabric", "Fabric('', 0.8)")
            raise InputError(None, name, f"is needed beside tests as objects, such as {such}")
        project = Project.of(project, law, fabric=fabric, solver_options=solver_options, folder=out)
        tests = None
    elif law or fabric or solver_options or isinstance(tests, Law):
        why = "law, fabric and solver_options go with tests as objects; a project has its own"
        raise InputError(None, "project", why)
    assert not isinstance(tests, Law)
    project = project.with_weights(weights or {}).with_fit(
        **settings, starts=starts, seed=seed, method=method, jobs=jobs,
        trust=[*project.fit.trust, *trust],
        starts_from=starts_from,
    ).with_scheduler(scheduler)  # fmt: skip
    executor_of(project).check()
    chosen = project.chosen(tests, fitted=True)
    tell = listener(progress)
    tell(Stage("tests to read", len(chosen)))
    with timed("tests and their data made ready"):
        setup = with_start(prepare_fit(project, chosen))
    problem = setup.problem()
    judgements = judge(setup)
    for judgement in judgements:
        judgement.demand(project.path)
    named = [(test.test.name, test) for test in setup.tests]
    said = project.written is not None and not project.own_parts  # else no file says it
    as_run = settings_of(project, [n for n, _ in named]) if said else None
    record = Record.of(project, as_run, named, problem.solver, command_line)
    files = None
    done: list[StartRecord] = []
    if out is not None:
        store = Store(Path(out))
        facts = facts_of(setup, problem.solver, record.data)
        parts = fingerprints(setup, problem)
        resume = store.begin(parts, resume, overwrite, (STARTS, HISTORY), facts)
        if resume:
            record = record.after(store.path)
        record.write(store.path)
        unknowns, scales = problem.unknowns, project.scales
        columns = [f"{label}_{scales.modulus_unit}" for label in unknowns.labels]
        scale = [scales.modulus] * unknowns.size + [1.0] * len(unknowns.nuisance.names)
        files = RunningFiles(store, [*columns, *unknowns.nuisance.names], scale)
        done = files.begin(resume)

    def ran(record: Event | None) -> None:
        if record is not None and files is not None:
            files.add(record)
        log_record(record)
        tell(record)

    setup.law.increment(*np.zeros((3, 3)))  # processes that are forked find the kernels loaded
    with failure_page(None if out is None else Path(out), project.title):
        with timed("all starts"), files or nullcontext():
            records = every_start(setup, done, ran, tell)
        with one_blas_thread(), timed("the best fit once more, and how sure it is"):
            best = with_certainty(setup, problem, _best(problem, records, project))
    seconds, agreed = time.perf_counter() - begun, agreement(problem, best.records, project)
    return Fit(setup, problem, best, seconds, record, judgements, agreed)


def _best(problem: FitProblem, records: Sequence[StartRecord], project: Project) -> BestFit:
    """Run the best of the starts again; raises NoFeasibleStart, SolverFailure."""
    if any(r.objective is not None for r in records):
        return best_fit(problem, records, project.fit.tolerance)
    failed = next((r for r in records if r.failure), None)
    if failed is None:
        raise NoFeasibleStart(f"{project.path}: no feasible start: {records[0].status}")
    problem_said = f"no start ended with a fit: {failed.failure}"
    raise SolverFailure(f"{problem_said}; --resume tries again", problem.solver.name)


def stored_fit(
    project: Project, tests: Sequence[str], words: str, name: str, *, folder: Path | None,
    resume: bool, overwrite: bool, progress: Callable[[Any], None],
    command_line: Sequence[str] | None,
) -> Fit:  # fmt: skip
    """Fit one of a series, announced by `words`, and write its page into `name` of the folder.
    resume : continue what it holds there, if anything. Raises the errors of `fit`."""
    progress(words)
    place = None if folder is None else folder / name
    found = fit(
        project, tests, out=place, resume=resume and place is not None and Store(place).used,
        overwrite=overwrite, progress=progress, command_line=command_line,
    )  # fmt: skip
    if place is not None:
        found.report(place)
    return found


def expected_of(setup: FitSetup) -> Expected:
    """Return the moduli at rest within the bounds of the law, MPa."""
    bounds, law = setup.bounds, setup.law
    if bounds.largest is not None:
        return Expected({n: (bounds.least[n], bounds.largest[n]) for n in COMPONENTS})
    assert bounds.lower is not None and bounds.upper is not None
    free = list(law.form.free)
    ends = []
    for entries in (bounds.lower, bounds.upper):
        beta = np.zeros(len(law.form.labels))
        beta[free] = entries
        ends.append({name: float(law.with_beta(beta).modulus(name, 0.0)) for name in COMPONENTS})
    low, high = ends
    least = {name: max(low[name], bounds.least[name]) for name in COMPONENTS}
    return Expected({n: (least[n], max(high[n], least[n])) for n in COMPONENTS})


def judge(setup: FitSetup, saw: Saw = lambda words: None) -> tuple[Judgement, ...]:
    """Return the doubts of each test; raises InputError if the project trusts an unknown one."""
    trust = setup.project.fit.trust
    known = sorted({name for kind in kinds().values() for name in getattr(kind, "doubts", ())})
    for name in trust:
        if name not in known:
            problem = f"there is no doubt {name!r}; there are: {', '.join(known)}"
            raise InputError(setup.project.path, "fit.trust", problem)
    expected, judgements = expected_of(setup), []
    for one in setup.tests:
        name = one.test.name
        saw(f"looking at {name}")
        if (look := getattr(one, "doubts", None)) is not None:
            with one_blas_thread(), timed(f"{name}, looked at for doubts"):
                doubts = sorted(look(expected), key=lambda doubt: not doubt.sure)
                judgements.append(Judgement(name, tuple(doubts), trust))
    return tuple(judgements)


NOTHING = "nothing doubtful"


@dataclass(frozen=True, eq=False, repr=False)
class Check(Reported):
    """A look at the data of tests, with their doubts.
    estimate : by virtual work; None where there is none, and `not_estimated` why."""

    setup: FitSetup
    judgements: tuple[Judgement, ...]
    estimate: Estimate | None = None
    not_estimated: str = ""

    @property
    def sound(self) -> bool:
        return not any(judgement.errors for judgement in self.judgements)

    @property
    def result(self) -> dict[str, Any]:
        tests = {
            j.test: [
                {"name": d.name, "severity": "error" if d.sure else "warning",
                 "trusted": d.name in j.trusted, "text": d.text}
                for d in j.doubts
            ]
            for j in self.judgements
        }  # fmt: skip
        return {"command": "check", "version": __version__, "sound": self.sound, "tests": tests,
                "joined": [str(note) for note in self.joined], "choices": self.choices,
                "estimate": None if self.estimate is None else self.estimate.result}  # fmt: skip

    @property
    def choices(self) -> dict[str, list[str]]:
        """Return choices in reading the files of each test, and rows left out, in words."""
        choices = {}
        for one in self.setup.tests:
            files, dropped = files_of(one), Counter[str]()
            for file in files:
                dropped.update(file.dropped)
            gone = ", ".join(f"{count} {why}" for why, count in dropped.items() if count)
            said = list(dict.fromkeys(note for file in files for note in file.source.notes))
            left_out = [f"rows of the files left out: {gone}"] if gone else []
            choices[one.test.name] = [*said, *left_out, *getattr(one, "seen", ())]
        return choices

    @property
    def joined(self) -> list[Note]:
        """Return notes on tests that differ in state, rate or hold."""
        return notes_of_states(one.test for one in self.setup.tests)

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return (test, severity, doubt, text): a row a doubt, one for none; choices as notes."""
        rows, choices = [], self.choices
        for judgement in self.judgements:
            for doubt in judgement.doubts:
                severity = "error" if doubt.sure else "warning"
                if doubt.name in judgement.trusted:
                    severity = f"trusted {severity}"
                rows.append((judgement.test, severity, doubt.name, doubt.text))
            if not judgement.doubts:
                rows.append((judgement.test, "fine", "", NOTHING))
            rows += [(judgement.test, "note", "", words) for words in choices[judgement.test]]
        rows += [("all tests", "warning", "", str(note)) for note in self.joined]
        return rows

    def lines(self) -> list[str]:
        return [f"{test}: {severity}" + (f" [{name}]: {text}" if name else f": {text}")
                for test, severity, name, text in self.rows()]  # fmt: skip

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        return html_table(self.setup.project.title, ["test", "", "doubt", ""], self.rows())


@checked
def check(
    project: Project, tests: str | Sequence[str] | None = None, trust: Sequence[str] = (),
    *, out: Path | str | None = None,
    progress: Listener = None,
) -> Check:  # fmt: skip
    """Look at the data of tests, by default of all that can be fitted.

    trust : names of doubts to ignore, beside those of the project. out : folder of the report.
    progress : receives steps done, their number, and the one that begins, as of `fit`.
    InputError : unreadable data, an unknown doubt.
    SolverFailure : a known solution does not run.
    """
    project = project.with_fit(trust=[*project.fit.trust, *trust])
    chosen, done = project.chosen(tests, fitted=True), count()
    tell = listener(progress)

    def saw(words: str) -> None:
        tell(next(done), 2 * len(chosen) + 2, words)

    setup = prepare_fit(project, chosen, saw)
    found = Check(setup, judge(setup, saw))
    if found.sound:
        saw("estimating moduli by virtual work")
        try:
            found = replace(found, estimate=estimate_of(setup))
        except (InputError, SolverFailure) as error:
            found = replace(found, not_estimated=str(error).splitlines()[0])
    saw("writing the page")
    with timed("tables and figures"):
        return finished(found, out)


def facts_of(setup: FitSetup, solver: Solver, data: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return all that a fit's starts depend on, as `folder.Facts`; data : of `data_rows`."""
    project, names = setup.project, [test.test.name for test in setup.tests]
    whole = {} if project.written is None else settings_of(project, names)
    said = {} if project.written is None else project.written.whole
    others = {"fabric": NAMES, "units": (), "law": (), "fit": UNCOUNTED}
    return {
        "version of bubblefit": __version__,
        "solver": solver_facts(project.fit.solver, solver.identity),
        **{part: {key: value for key, value in whole.get(part, {}).items() if key not in left_out}
           for part, left_out in others.items()},
        "tests": {name: _without(said.get(name, {})) for name in names},
        "data files": {name: [f"{row['name']}, sha256 {row['sha256'][:DIGITS]}" for row in data
                              if row["test"] == name] for name in names},
    }  # fmt: skip


def _without(section: Mapping[str, Any]) -> dict[str, Any]:
    return {key: _without(value) if isinstance(value, Mapping) else plain(value)
            for key, value in section.items() if key not in NAMES}  # fmt: skip
