"""Run tests that are not fitted with material cards, side by side, and resume them."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..arguments import NotNegative, Positive, checked_arguments
from ..errors import InputError, SolverFailure
from ..experiments.base import Test
from ..experiments.predicted import Predicted, PredictedOutcome, PredictedRun, band_of, record_of
from ..experiments.registry import kind_named
from ..experiments.run_records import RunRecord, notes_of, other_thickness
from ..experiments.sampling import laws_around
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..notes import Note, as_note, marks_of, note_lines, note_records
from ..project.project import Project, card_sources, chosen_cards, settings_of
from ..project.schema import Cards
from ..solvers.base import BandedSolver, BandEnd, Solver, check_carries
from ..solvers.registry import usable_solver
from ..solvers.run_cache import digest_of
from .executor import executor_of
from .folder import (
    PROVENANCE,
    OutputSettings,
    Provenance,
    Reported,
    RunRecords,
    failure_page,
    versions,
)
from .in_use import alone_in_folder
from .log import log_run
from .process_pool import Task
from .progress import Listener, listener
from .setup import make_solver
from .simulation import attempt


def predicted_kind(name: str) -> Predicted:
    """Return the interface of a kind of test that is predicted."""
    kind = kind_named(name).predicted
    assert kind is not None
    return kind


@dataclass(frozen=True, eq=False)
class Predictions(Reported):
    """The runs of tests with cards, in this order in every table."""

    project: Project
    each: tuple[PredictedRun, ...]
    wall_s: float
    record: Provenance

    @cached_property
    def outcomes(self) -> Mapping[str, tuple[PredictedOutcome, tuple[int, ...]]]:
        """Return the outcome of each kind of test, and the numbers of its runs."""
        numbers: dict[str, list[int]] = {}
        for i, run in enumerate(self.each):
            numbers.setdefault(run.test.kind, []).append(i)
        outcomes = {}
        for name, own in numbers.items():
            outcome = predicted_kind(name).outcome([self.each[i] for i in own])
            outcomes[name] = outcome, tuple(own)
        return outcomes

    @property
    def result(self) -> dict[str, Any]:
        tests: dict[str, Any] = {}
        for outcome, numbers in self.outcomes.values():
            for i in numbers:
                test = self.each[i].test
                tests[test.name] = {"kind": test.kind, **outcome.test_numbers(test)}
        return {
            "command": "predict",
            "title": self.project.title,
            "solver": self.project.fit.solver,
            "tests": tests,
            "cards": list(dict.fromkeys(run.card for run in self.each)),
            "walls": [
                {"name": end.name, "meaning": end.meaning, "predicted": end.predicted}
                for end in self.band
            ],
            "runs": [self._numbers(i) for i in range(len(self.each))],
            "notes": note_records(self.notes),
            "worst_relative_error": self.worst,
            "cached_runs": self.cached,
            "wall_s": self.wall_s,
            "versions": versions(),
            "provenance": PROVENANCE,
        }

    @property
    def notes(self) -> list[Note]:
        """Return the notes, of "TEST with CARD" or "TEST with CARD, WALL"."""
        return [as_note(note).about(run.title) for run in self.each for note in run.notes]

    @property
    def band(self) -> list[BandEnd]:
        """Return the ends of the solver's band, the predicted one first; empty without one."""
        return band_of(self.each)

    @property
    def worst(self) -> float | None:
        """Return the largest `error` of a prediction; None if none is compared."""
        errors = [self.error(i) for i, run in enumerate(self.each) if run.predicted]
        return max((e for e in errors if e is not None), default=None)

    def ended(self, number: int) -> str:
        """Return how a run ended: "finished", how far it came, or why it failed."""
        outcome, own = self._own(number)
        return outcome.ended(own)

    def error(self, number: int) -> float | None:
        """Return the RMS error of a run over the largest measured value."""
        outcome, own = self._own(number)
        return outcome.error(own)

    def failed(self) -> list[int]:
        """Return the numbers of the runs that failed."""
        return [i for i, run in enumerate(self.each) if run.record.failure]

    @property
    def cached(self) -> int:
        """Return the number of runs from the cache of another program's."""
        return sum(run.record.from_cache for run in self.each)

    def silent(self) -> list[int]:
        """Return the numbers of the runs of measured tests that gave nothing to compare."""
        each = [(i, run.test) for i, run in enumerate(self.each) if run.predicted]
        measured = [i for i, test in each if predicted_kind(test.kind).measured(test)]
        return [i for i in measured if self.error(i) is None]

    def runs(self) -> pd.DataFrame:
        """Return a row a run: test, card, wall, numbers, how it ended, marks, notes, seconds."""
        rows = []
        for i, run in enumerate(self.each):
            outcome, own = self._own(i)
            tail = {
                "ended": self.ended(i),
                "marks": "; ".join(marks_of(run.notes)),
                "notes": "; ".join(run.notes),
                "seconds": run.record.seconds,
            }
            head = {"test": run.test.name, "card": run.card, "wall": run.wall}
            rows.append({**head, **outcome.columns(own), **tail})
        columns = list(dict.fromkeys(name for row in rows for name in row))
        last = [name for name in columns if name not in tail]
        return pd.DataFrame(rows, columns=[*last, *tail])

    def curves(self) -> pd.DataFrame:
        """Return every run frame by frame, with its test, card and wall."""
        curves = []
        for i, run in enumerate(self.each):
            outcome, own = self._own(i)
            curve = outcome.curve(own)
            for name, value in ("wall", run.wall), ("card", run.card), ("test", run.test.name):
                curve.insert(0, name, value)
            curves.append(curve)
        return pd.concat(curves, ignore_index=True)

    def lines(self) -> list[str]:
        """Return for the terminal a table of each kind of test, then the notes."""
        lines = [line for outcome, _ in self.outcomes.values() for line in outcome.lines()]
        return [*lines, *note_lines(self.notes)]

    def _own(self, number: int) -> tuple[PredictedOutcome, int]:
        """Return the outcome that a run belongs to, and its number there."""
        outcome, numbers = self.outcomes[self.each[number].test.kind]
        return outcome, numbers.index(number)

    def _numbers(self, number: int) -> dict[str, Any]:
        run = self.each[number]
        outcome, own = self._own(number)
        head: dict[str, Any] = {
            "test": run.test.name,
            "card": run.card,
            "wall": run.wall,
            "predicted": run.predicted,
            "ended": self.ended(number),
            "marks": marks_of(run.notes),
            "seconds": run.record.seconds,
        }
        if run.record.failure:
            return head
        tail = {"iterations": run.record.iterations, "warnings": list(run.notes)}
        return {**head, **outcome.numbers(own), **tail}


@dataclass(frozen=True)
class RunEvent:
    """The end of a run, `done` of `total`; without one they begin. again : kept from before."""

    run: PredictedRun | None
    done: int
    total: int
    again: bool = False


@checked_arguments
@alone_in_folder
def predict(
    project: Project,
    tests: str | Sequence[str] | None = None,
    cards: Cards = None,
    *,
    samples: NotNegative | None = None,
    jobs: Positive | None = None,
    scheduler: str | None = None,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> Predictions:
    """Run every chosen test that is predicted with every chosen card.

    Both ends of a solver's band are run (`PredictedRun.end`), and laws around that of a card with a
    certainty, for the spread (`PredictedRun.around`).

    tests : names of tests, or a kind of test; by default all that are not fitted.
    cards : by name; or names of the project's cards and files of others; by default the project's,
        else the one that its fit left in the usual folder.
    samples : laws drawn from the certainty of each card; 0 for no spread; by default steps along
        its few least certain directions, but not by another program.
    jobs : processes; by default the project's, else all cores. scheduler : address of a Dask
        scheduler, whose workers do the runs.
    out : folder in which runs are written as they end, for `resume`. overwrite : its content.
    progress : receives every run that ended, None now and then. command_line : for the record.
    InputError : no such test or card, no model of a card's thickness, nothing to resume.
        OutputError. SolverFailure : the solver is not there, or no run ended well."""
    begun = time.perf_counter()
    output = OutputSettings.of(out, resume, overwrite, command_line)
    project = project.with_scheduler(scheduler)
    executor_of(project).check()
    chosen = predicted_tests(project, tests)
    name = project.fit.solver
    options = project.options_of(name)
    solver = usable_solver(name, options, project.path, cache=project.run_cache)
    # A test that brings its own material needs no card.
    alone = not cards and not project.cards and all(test.own_card for test in chosen)
    pairs = _pairs(chosen, {} if alone else chosen_cards(project, cards), solver)
    sources = [] if alone else card_sources(project, cards)
    settings = None
    if project.written is not None and sources is not None:
        settings = settings_of(project, [test.name for test in chosen], sources)
    named = [(test.name, test) for test in chosen]
    record = Provenance.of(project, settings, named, solver, command_line)
    records = None
    if output.path is not None:
        records = RunRecords(output.path)
        if records.begin(resume, overwrite):
            record = record.after(output.path)
        record.write(output.path)
    with failure_page(output.path, project.title) as said:
        # Runs of another program, minutes each, are not made unasked.
        some = 0 if samples is None and solver.external else samples
        others = _around(project, pairs, some)
        every = [*pairs, *(run for _, run in others)]
        ended = _run(project, every, records, jobs, listener(progress))
        numbers = [number for number, _ in others]
        count = len(ended) - len(numbers)
        runs = list(ended[:count])
        for place in dict.fromkeys(numbers):
            own = [run for n, run in zip(numbers, ended[count:], strict=True) if n == place]
            assert own[0].around is not None
            around = replace(own[0].around, records=tuple(run.record for run in own))
            runs[place] = replace(runs[place], around=around)
        if all(run.record.failure for run in runs):
            said += [f"{r.title}: failed: {r.record.failure}" for r in runs]
            failure = f"no run ended well: {runs[0].record.failure}"
            raise SolverFailure(failure, project.fit.solver)
    return Predictions(project, tuple(runs), time.perf_counter() - begun, record)


def predicted_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """Return the tests that `predict` runs, as `Project.chosen`; InputError: there is none."""
    chosen = project.chosen(tests, fitted=False)
    able = [test for test in chosen if kind_named(test.kind).predicted is not None]
    if not able:
        problem = f"no card is judged on these tests: {', '.join(test.name for test in chosen)}"
        raise InputError(project.path, "", problem)
    return able


def measured_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """Return the tests of `predicted_tests` that are measured."""
    every = predicted_tests(project, tests)
    return [test for test in every if predicted_kind(test.kind).measured(test)]


def run_card(kind: Predicted, solver: Solver, model: Any, card: MaterialCard) -> RunRecord:
    """Run one test with one card; a failure is a record too."""
    check_carries(solver, card.law)
    begun = time.perf_counter()
    ended = attempt(solver.run, model, card.law)
    return record_of(kind, model, ended, time.perf_counter() - begun)


def mark_of(kind: Predicted, model: Any, law: HypoelasticLaw, solver: Solver) -> str:
    """Return a mark of all that a run's result depends on, by content."""
    material = (law.pieces, law.coupling, law.thickness_change)
    return digest_of(kind.depends_on(model), material, solver.identity)


def _pairs(
    tests: Sequence[Test], cards: Mapping[str, MaterialCard], solver: Solver
) -> list[PredictedRun]:
    """Return runs to be made: test by test, card by card, end by end of the solver's band."""
    pairs: list[PredictedRun] = []
    for test in tests:
        models: dict[float, Mapping[str, Any]] = {}
        own = test.own_card
        for name, card in cards.items() if own is None else [(own.name, own)]:
            if card.thickness not in models:
                models[card.thickness] = test.models(card.thickness)
            (model,) = models[card.thickness].values()
            waiting = PredictedRun(test, name, card, model, RunRecord(0.0, "was not run"))
            band = tuple(solver.band(model)) if isinstance(solver, BandedSolver) else ()
            pairs += [replace(waiting, end=end) for end in band or (None,)]
    return pairs


def _around(
    project: Project, pairs: Sequence[PredictedRun], samples: int | None
) -> list[tuple[int, PredictedRun]]:
    others = []
    for number, pair in enumerate(pairs):
        if not pair.predicted:
            continue
        try:
            around, laws = laws_around(pair.material, samples)
        except ValueError as error:
            raise InputError(project.path, f"card {pair.card!r}", str(error)) from None
        for k, law in enumerate(laws):
            card = replace(pair.material, law=law)
            own = f"{pair.card}, law {k + 1} around it"
            others.append((number, replace(pair, card=own, material=card, around=around)))
    return others


def _run(
    project: Project,
    pairs: Sequence[PredictedRun],
    records: RunRecords | None,
    jobs: int | None,
    progress: Callable[..., None],
) -> list[PredictedRun]:
    """Return every pair with its record: from the folder, or run side by side."""
    kinds = [predicted_kind(pair.test.kind) for pair in pairs]
    solver_of = _solvers(project)
    marks = [
        mark_of(kind, pair.model, pair.material.law, solver_of(pair.end))
        for kind, pair in zip(kinds, pairs, strict=True)
    ]
    ended: dict[int, PredictedRun] = {}

    def end(number: int, record: RunRecord, again: bool) -> None:
        pair = pairs[number]
        thick = other_thickness(pair.material, project.fabric.thickness)
        notes = [*notes_of(record, pair.material), *thick]
        ended[number] = replace(pair, record=record, notes=notes)
        log_run(pair.title, record, again)
        progress(RunEvent(ended[number], len(ended), len(pairs), again))

    progress(RunEvent(None, 0, len(pairs)))
    for number, mark in enumerate(marks):
        record = None if records is None else records.read(mark)
        if record is not None:
            end(number, record, True)
    missing = [number for number in range(len(pairs)) if number not in ended]
    prepare = functools.partial(_runner, project, pairs)
    executor = executor_of(project.with_fit(jobs=jobs))
    lost = lambda number, why: (number, RunRecord(0.0, why))  # noqa: E731
    for item in executor.run_tasks(prepare, missing, "runs", lost) if missing else ():
        if item is None:
            progress(None)
            continue
        number, record = item
        if records is not None:
            records.write(marks[number], record)
        end(number, record, False)
    return [ended[number] for number in range(len(pairs))]


def _runner(project: Project, pairs: Sequence[PredictedRun]) -> Task:
    solver_of = _solvers(project)

    def run(number: int, tell: Callable[[Any], None]) -> tuple[int, RunRecord]:
        pair = pairs[number]
        kind = predicted_kind(pair.test.kind)
        solver = solver_of(pair.end)
        return number, run_card(kind, solver, pair.model, pair.material)

    return run


def _solvers(project: Project) -> Callable[[BandEnd | None], Solver]:
    """Return what makes the project's solver for an end of its band, once each."""
    made: dict[str, Solver] = {}

    def solver_of(end: BandEnd | None) -> Solver:
        key = "" if end is None else end.name
        if key not in made:
            made[key] = make_solver(project, **({} if end is None else end.options))
        return made[key]

    return solver_of
