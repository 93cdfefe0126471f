"""Predictions: runs of tests that are not fitted with material cards, in parallel, resumable."""

from __future__ import annotations

import functools
import logging
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..arguments import NotNegative, Positive, checked_arguments
from ..errors import InputError, SolverFailure
from ..experiments.base import Test
from ..experiments.forward import RunRecord, notes_of, other_thickness
from ..experiments.predicted import (
    Predicted,
    PredictedOutcome,
    PredictedRun,
    band_of,
    laws_around,
    record_of,
)
from ..experiments.registry import kind_named
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..notes import Note, Verdict, as_note, marks_of, note_lines, note_records
from ..project.project import Project, card_sources, chosen_cards, settings_of
from ..project.schema import Cards
from ..solvers.base import BandedSolver, BandEnd, Solver, check_carries
from ..solvers.registry import usable_solver
from ..solvers.run_cache import digest_of
from ..wording import percent
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
from .progress import Listener, listener
from .setup import make_solver
from .simulation import attempt
from .verdict import COMPARE_CURVES, large_errors, largest_error, state_of_predictions

log = logging.getLogger(__name__)


def predicted_kind(name: str) -> Predicted:
    """Return the interface of a kind of test that is predicted."""
    kind = kind_named(name).predicted
    assert kind is not None
    return kind


@dataclass(frozen=True, eq=False)
class Predictions(Reported):
    """Hold the predictions of tests with material cards.

    Attributes
    ----------
    project : Project
    predicted_runs : tuple of PredictedRun
        The runs, in the order of all tables; methods take the index of a run in it.
    wall_s : float
        Wall-clock time of all runs in seconds.
    record : Provenance
    """

    project: Project
    predicted_runs: tuple[PredictedRun, ...]
    wall_s: float
    record: Provenance

    @cached_property
    def outcomes(self) -> Mapping[str, tuple[PredictedOutcome, tuple[int, ...]]]:
        """Return the outcome of each kind of test, and the numbers of its runs."""
        numbers_by_kind: dict[str, list[int]] = {}
        for number, run in enumerate(self.predicted_runs):
            numbers_by_kind.setdefault(run.test.kind, []).append(number)
        outcomes = {}
        for kind, numbers in numbers_by_kind.items():
            runs = [self.predicted_runs[number] for number in numbers]
            outcomes[kind] = predicted_kind(kind).outcome(runs), tuple(numbers)
        return outcomes

    @property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json."""
        tests: dict[str, Any] = {}
        for outcome, numbers in self.outcomes.values():
            for number in numbers:
                test = self.predicted_runs[number].test
                tests[test.name] = {"kind": test.kind, **outcome.test_numbers(test)}
        return {
            "command": "predict",
            "title": self.project.title,
            "solver": self.project.fit.solver,
            "tests": tests,
            "cards": [*dict.fromkeys(run.card for run in self.predicted_runs)],
            "walls": [
                {"name": end.name, "meaning": end.meaning, "predicted": end.predicted}
                for end in self.band
            ],
            "runs": [self._numbers(number) for number in range(len(self.predicted_runs))],
            "verdict": self.verdict.numbers,
            "notes": note_records(self.notes),
            "worst_relative_error": self.worst,
            "cached_runs": self.cached,
            "wall_s": self.wall_s,
            "versions": versions(),
            "provenance": PROVENANCE,
        }

    @property
    def errors(self) -> dict[str, float]:
        """Return the relative error of each prediction that has measured values, by its title."""
        runs = enumerate(self.predicted_runs)
        errors = {run.title: self.error(number) for number, run in runs if run.predicted}
        return {title: error for title, error in errors.items() if error is not None}

    @property
    def verdict(self) -> Verdict:
        """Return how many runs finished, and how far they are from measured values."""
        runs = self.predicted_runs
        unfinished = [
            run.title for number, run in enumerate(runs) if self.ended(number) != "finished"
        ]
        count = len(runs) - len(unfinished)
        sentence = f"{count} of {len(runs)} runs finished"
        if self.worst is not None:
            sentence += (
                f", with errors of at most {percent(self.worst)} of the largest measured value"
            )
        marks = self._marks_in_words()
        state = state_of_predictions(self.errors, [*marks, *unfinished])
        large = large_errors(self.errors)
        step = COMPARE_CURVES if large else ""
        if unfinished:
            step = "see why they ended, and correct card or model"
        return Verdict(
            state if count else "not to be used",
            sentence,
            (*large, *marks),
            unknown=f"what follows the end of {', '.join(unfinished)}" if unfinished else "",
            next_step=step,
        )

    def _marks_in_words(self) -> tuple[str, ...]:
        """Return how many runs have each of the marks of notes."""
        marks = Counter(mark for run in self.predicted_runs for mark in marks_of(run.notes))
        return tuple(
            f"{number} run{'s are' if number > 1 else ' is'} marked {str(mark)!r}"
            for mark, number in sorted(marks.items(), key=lambda item: item[0].mark)
        )

    @property
    def notes(self) -> list[Note]:
        """Return the notes of all runs, each about "TEST with CARD" or "TEST with CARD, WALL"."""
        return [as_note(note).about(run.title) for run in self.predicted_runs for note in run.notes]

    @property
    def band(self) -> list[BandEnd]:
        """Return the ends of the solver's band, the predicted one first; empty without one."""
        return band_of(self.predicted_runs)

    @property
    def worst(self) -> float | None:
        """Return the largest `error` of a prediction; None if none is compared."""
        return largest_error(self.errors)

    def ended(self, number: int) -> str:
        """Return how a run ended: "finished", how far it came, or why it failed."""
        outcome, position = self._outcome_of(number)
        return outcome.ended(position)

    def error(self, number: int) -> float | None:
        """Return the RMS error of a run divided by the largest measured value; None if unknown."""
        outcome, position = self._outcome_of(number)
        return outcome.error(position)

    def failed(self) -> list[int]:
        """Return the numbers of the runs that failed."""
        return [number for number, run in enumerate(self.predicted_runs) if run.record.failure]

    @property
    def cached(self) -> int:
        """Return the number of runs that were taken from the cache of another program's runs."""
        return sum(run.record.from_cache for run in self.predicted_runs)

    def silent(self) -> list[int]:
        """Return the numbers of the runs of measured tests that gave nothing to compare."""
        return [
            number
            for number, run in enumerate(self.predicted_runs)
            if run.predicted and is_measured(run.test) and self.error(number) is None
        ]

    def runs(self) -> pd.DataFrame:
        """Return the runs.

        Returns
        -------
        DataFrame
            One row per run: `test`, `card`, `wall`, the numbers of its kind of test, how it
            `ended`, `marks`, `notes`, `seconds`.
        """
        rows = []
        ends = []
        for number, run in enumerate(self.predicted_runs):
            outcome, position = self._outcome_of(number)
            # Kinds of test have columns of their own, which come before these of every run.
            names = {"test": run.test.name, "card": run.card, "wall": run.wall}
            rows.append({**names, **outcome.columns(position)})
            ends.append(
                {
                    "ended": self.ended(number),
                    "marks": "; ".join(marks_of(run.notes)),
                    "notes": "; ".join(run.notes),
                    "seconds": run.record.seconds,
                }
            )
        return pd.DataFrame(rows).join(pd.DataFrame(ends))

    def curves(self) -> pd.DataFrame:
        """Return the curves of the runs.

        Returns
        -------
        DataFrame
            One row per run and frame: `test`, `card`, `wall`, and the columns of its kind of test.
        """
        curves = []
        for number, run in enumerate(self.predicted_runs):
            outcome, position = self._outcome_of(number)
            curve = outcome.curve(position)
            curve.insert(0, "wall", run.wall)
            curve.insert(0, "card", run.card)
            curve.insert(0, "test", run.test.name)
            curves.append(curve)
        return pd.concat(curves, ignore_index=True)

    def lines(self) -> list[str]:
        """Return for the terminal a table of each kind of test, then the notes."""
        lines = [line for outcome, _ in self.outcomes.values() for line in outcome.lines()]
        return [*lines, *note_lines(self.notes), *self.verdict.lines]

    def _outcome_of(self, number: int) -> tuple[PredictedOutcome, int]:
        """Return the outcome of the kind of test of a run, and the position of the run in it."""
        outcome, numbers = self.outcomes[self.predicted_runs[number].test.kind]
        return outcome, numbers.index(number)

    def _numbers(self, number: int) -> dict[str, Any]:
        """Return a run as plain values."""
        run = self.predicted_runs[number]
        outcome, position = self._outcome_of(number)
        numbers = {
            "test": run.test.name,
            "card": run.card,
            "wall": run.wall,
            "predicted": run.predicted,
            "ended": self.ended(number),
            "marks": marks_of(run.notes),
            "seconds": run.record.seconds,
        }
        if not run.record.failure:
            numbers |= outcome.numbers(position)
            numbers |= {"iterations": run.record.iterations, "warnings": run.notes}
        return numbers


@dataclass(frozen=True)
class RunEvent:
    """Tell that a run ended, or, without a run, that the runs begin.

    Attributes
    ----------
    run : PredictedRun or None
        The run that ended.
    done, total : int
        Number of runs that ended, and of all runs.
    from_folder : bool
        Whether the run was kept there by an earlier run.
    """

    run: PredictedRun | None
    done: int
    total: int
    from_folder: bool = False


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
    """Predict tests: run every chosen test that is not fitted with every chosen card.

    If a solver predicts a band, both of its ends are run (`PredictedRun.end`). For the spread of a
    prediction, laws around that of a card with uncertainty are run too (`PredictedRun.around`).

    Parameters
    ----------
    project : Project
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that are not fitted.
    cards : sequence of str, or mapping of str to MaterialCard, optional
        Cards by name; or names of the project's cards and files of others. By default the project's
        cards, or else the one that its fit left in the usual folder.
    samples : int, optional
        Number of laws drawn from the uncertainty of each card; 0 for no spread. By default the
        spread follows from steps along the few least certain directions of the law, but is left
        out if another program solves.
    jobs : int, optional
        Number of processes; by default the project's, or else all cores.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers do the runs.
    out : path, optional
        Folder in which runs are written as they end, for `resume`.
    resume, overwrite : bool
        Go on with what the folder holds, or replace it.
    progress : callable or bool, optional
        Receives a `RunEvent` of every run that ended, None now and then.
    command_line : sequence of str, optional
        For the record.

    Returns
    -------
    Predictions

    Raises
    ------
    InputError
        There is no such test or card, no model of a card's thickness, or nothing to resume.
    OutputError
        The folder is used.
    SolverFailure
        The solver is not there, or no run ended well.
    """
    start_time = time.perf_counter()
    output = OutputSettings.of(out, resume, overwrite, command_line)
    project = project.with_scheduler(scheduler)
    executor_of(project).check()
    chosen = predicted_tests(project, tests)
    options = project.options_of(project.fit.solver)
    solver = usable_solver(project.fit.solver, options, project.path, cache=project.run_cache)
    material_cards, sources = _cards_and_sources(project, cards, chosen)
    runs = _planned_runs(chosen, material_cards, solver)
    record = _provenance(project, chosen, sources, solver, command_line)
    records, record = _begin_records(output, record)
    # Another program takes minutes for each run: none is made for the spread unless asked for.
    if samples is None and solver.external:
        samples = 0
    with failure_page(output.path, project.title) as lines:
        neighbours = _runs_around(project, runs, samples)
        series = RunSeries(project, records, listener(progress))
        planned = [*runs, *(run for group in neighbours.values() for run in group)]
        runs = _with_spread(series.run(planned, jobs), neighbours)
        if all(run.record.failure for run in runs):
            lines += [f"{run.title}: failed: {run.record.failure}" for run in runs]
            reason = f"no run ended well: {runs[0].record.failure}"
            raise SolverFailure(reason, project.fit.solver)
    return Predictions(project, tuple(runs), time.perf_counter() - start_time, record)


def _cards_and_sources(
    project: Project, cards: Cards, tests: Sequence[Test]
) -> tuple[dict[str, MaterialCard], list[str | Path] | None]:
    """Return the chosen cards and where they are; none for tests that bring their own material."""
    if not (cards or project.cards) and all(test.own_card for test in tests):
        return {}, []
    return chosen_cards(project, cards), card_sources(project, cards)


def predicted_tests(project: Project, tests: str | Sequence[str] | None) -> list[Test]:
    """Return the tests that `predict` runs, as `Project.chosen`; InputError: there is none."""
    chosen = project.chosen(tests, fitted=False)
    predictable = [test for test in chosen if kind_named(test.kind).predicted is not None]
    if not predictable:
        problem = f"no card is judged on these tests: {', '.join(test.name for test in chosen)}"
        raise InputError(project.path, "", problem)
    return predictable


def measured_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """Return the tests of `predicted_tests` that are measured."""
    return [test for test in predicted_tests(project, tests) if is_measured(test)]


def is_measured(test: Test) -> bool:
    """Return whether a test is predicted, not fitted, and has measured loads."""
    kind = kind_named(test.kind).predicted
    return kind is not None and kind.measured(test)


def run_card(kind: Predicted, solver: Solver, model: Any, card: MaterialCard) -> RunRecord:
    """Run one test with one card; a failure is a record too."""
    check_carries(solver, card.law)
    start_time = time.perf_counter()
    history = attempt(solver.run, model, card.law)
    return record_of(kind, model, history, time.perf_counter() - start_time)


def mark_of(kind: Predicted, model: Any, law: HypoelasticLaw, solver: Solver) -> str:
    """Return a digest of everything on which the result of a run depends."""
    material = (law.pieces, law.coupling, law.thickness_change)
    return digest_of(kind.depends_on(model), material, solver.identity)


def _provenance(
    project: Project,
    tests: Sequence[Test],
    sources: Sequence[str | Path] | None,
    solver: Solver,
    command_line: Sequence[str] | None,
) -> Provenance:
    """Return the provenance of a prediction; it cannot be repeated if Python made a part of it."""
    settings = None
    if sources is not None:
        settings = settings_of(project, [test.name for test in tests], sources)
    named = [(test.name, test) for test in tests]
    return Provenance.of(project, settings, named, solver, command_line)


def _begin_records(
    output: OutputSettings, record: Provenance
) -> tuple[RunRecords | None, Provenance]:
    """Return the runs that the output folder keeps, and the record, written there, if any."""
    if output.path is None:
        return None, record
    records = RunRecords(output.path)
    if records.begin(output.resume, output.overwrite):
        record = record.after(output.path)
    record.write(output.path)
    return records, record


def _planned_runs(
    tests: Sequence[Test], cards: Mapping[str, MaterialCard], solver: Solver
) -> list[PredictedRun]:
    """Return runs to be made: test by test, card by card, end by end of the solver's band.

    The ends of a band are the assumptions on the wall that bound the prediction (`BandEnd`).
    """
    runs = []
    for test in tests:
        models_by_thickness: dict[float, Mapping[str, Any]] = {}
        cards_of_test = cards if test.own_card is None else {test.own_card.name: test.own_card}
        for name, card in cards_of_test.items():
            if card.thickness not in models_by_thickness:
                models_by_thickness[card.thickness] = test.models(card.thickness)
            # A predicted test has one part, hence one model, which cards of this thickness share.
            (model,) = models_by_thickness[card.thickness].values()
            run = PredictedRun(test, name, card, model, RunRecord(0.0, "was not run"))
            band = tuple(solver.band(model)) if isinstance(solver, BandedSolver) else ()
            runs += [replace(run, end=end) for end in band or (None,)]
    return runs


def _runs_around(
    project: Project, runs: Sequence[PredictedRun], samples: int | None
) -> dict[int, list[PredictedRun]]:
    """Return runs with laws around that of a card, by number of the run with the card."""
    neighbours = {}
    for number, run in enumerate(runs):
        if not run.predicted:
            continue
        try:
            around, laws = laws_around(run.material, samples)
        except ValueError as error:
            raise InputError(project.path, f"card {run.card!r}", str(error)) from None
        if laws:
            neighbours[number] = [
                replace(
                    run,
                    card=f"{run.card}, law {k} around it",
                    material=replace(run.material, law=law),
                    around=around,
                )
                for k, law in enumerate(laws, start=1)
            ]
    return neighbours


def _with_spread(
    finished_runs: Sequence[PredictedRun], neighbours: Mapping[int, Sequence[PredictedRun]]
) -> list[PredictedRun]:
    """Return the runs with cards, with the records of those around each, which follow them all."""
    count = len(finished_runs) - sum(map(len, neighbours.values()))
    runs = list(finished_runs[:count])
    remaining = iter(finished_runs[count:])
    for number, group in neighbours.items():
        records = tuple(next(remaining).record for _ in group)
        around = group[0].around
        assert around is not None
        runs[number] = replace(runs[number], around=replace(around, records=records))
    return runs


class RunSeries:
    """Run tests with cards, or take the runs from the folder that keeps them.

    Parameters
    ----------
    project : Project
    records : RunRecords or None
        Of the folder.
    on_event : callable
        Receives a `RunEvent` of every run that ended, None now and then.
    """

    def __init__(
        self, project: Project, records: RunRecords | None, on_event: Callable[..., None]
    ) -> None:
        self._project = project
        self._records = records
        self._on_event = on_event
        self._ended: dict[int, PredictedRun] = {}

    def run(self, runs: Sequence[PredictedRun], jobs: int | None) -> list[PredictedRun]:
        """Return every run with its record, in their order.

        Parameters
        ----------
        runs : sequence of PredictedRun
        jobs : int or None
            Number of processes.
        """
        solvers = BandSolvers(self._project)
        marks = [
            mark_of(
                predicted_kind(run.test.kind),
                run.model,
                run.material.law,
                solvers.solver_of(run.end),
            )
            for run in runs
        ]
        self._on_event(RunEvent(None, 0, len(runs)))
        for number, mark in enumerate(marks):
            record = None if self._records is None else self._records.read(mark)
            if record is not None:
                self._end(runs, number, record, from_folder=True)
        missing = [number for number in range(len(runs)) if number not in self._ended]
        if missing:
            prepare = functools.partial(RunTask, self._project, runs)
            executor = executor_of(self._project.with_fit(jobs=jobs))
            for item in executor.run_tasks(prepare, missing, "runs", _lost_run):
                if item is None:
                    self._on_event(None)
                    continue
                number, record = item
                if self._records is not None:
                    self._records.write(marks[number], record)
                self._end(runs, number, record, from_folder=False)
        return [self._ended[number] for number in range(len(runs))]

    def _end(
        self, runs: Sequence[PredictedRun], number: int, record: RunRecord, from_folder: bool
    ) -> None:
        """Keep a run with its record and notes, and tell of it."""
        run = runs[number]
        notes = notes_of(record, run.material)
        thickness_notes = other_thickness(run.material, self._project.fabric.thickness)
        run = replace(run, record=record, notes=[*notes, *thickness_notes])
        self._ended[number] = run
        end = record.failure or (f"stopped early, {record.early}" if record.early else "finished")
        origin = ", kept from before" if from_folder else ""
        log.info("%s: %s; %.2f s%s", run.title, end, record.seconds, origin)
        self._on_event(RunEvent(run, len(self._ended), len(runs), from_folder))


def _lost_run(number: int, reason: str) -> tuple[int, RunRecord]:
    """Return the record of a run whose workers died."""
    return number, RunRecord(0.0, reason)


class RunTask:
    """Run tests with cards in one process, which has solvers of its own."""

    def __init__(self, project: Project, runs: Sequence[PredictedRun]) -> None:
        self._runs = runs
        self._solvers = BandSolvers(project)

    def __call__(self, number: int, report: Callable[[Any], None]) -> tuple[int, RunRecord]:
        """Return the record of a run with its number."""
        run = self._runs[number]
        solver = self._solvers.solver_of(run.end)
        return number, run_card(predicted_kind(run.test.kind), solver, run.model, run.material)


class BandSolvers:
    """Make the project's solver for each end of its band, once."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._solvers: dict[str, Solver] = {}

    def solver_of(self, end: BandEnd | None) -> Solver:
        """Return the solver of an end of the band, or of a solver without one."""
        name = "" if end is None else end.name
        if name not in self._solvers:
            options = {} if end is None else end.options
            self._solvers[name] = make_solver(self._project, **options)
        return self._solvers[name]
