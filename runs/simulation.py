"""Forward analyses of tests with material cards, and the records that studies of them keep."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from ..arguments import checked_arguments
from ..errors import InputError, SolverFailure, check_one_of
from ..experiments.base import ProgramTest, Refined, Test
from ..experiments.data_files import Output
from ..experiments.forward import CardRun, Simulation, Studied, notes_of, other_thickness
from ..experiments.registry import kind_named, presenter_of
from ..experiments.sections import Fabric
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, Verdict, marks_of, note_lines, note_records
from ..project.objects import Definition
from ..project.project import Project, chosen_cards, fitted_card
from ..solvers.base import History, Solver, check_carries
from ..solvers.registry import counted, usable_solver
from ..solvers.run_cache import cache_runs, run_cache
from ..storage.writing import output_errors, write_text
from ..version import __version__
from ..wording import percent
from .executor import executor_of
from .folder import RESULT, RUN, KeptAnalyses, OutputSettings, Reported, Store, draw
from .in_use import alone_in_folder
from .process_pool import Task
from .progress import Listener, listener, timed
from .verdict import COMPARE_CURVES, large_errors, largest_error, state_of_predictions

#: The kind of a note on a run that has no result.
FAILED = NoteKind("failed")
if TYPE_CHECKING:
    from _typeshed import DataclassInstance

R = TypeVar("R", bound="DataclassInstance")
GivenCard = MaterialCard | Path | str
#: Runs of the parts of a test, by names of test and card.
RunsOfCards = Mapping[tuple[str, str], Mapping[str, CardRun]]


@dataclass(frozen=True)
class Step:
    """Tell the progress of a series of analyses.

    Attributes
    ----------
    part : str
        The model that is run.
    analysis, analyses : int
        Number of its analysis, from 1, and of all.
    done : float
        Increments of the analysis that are done.
    increments : int
        Of the whole analysis; 0 where not known.
    """

    part: str
    analysis: int
    analyses: int
    done: float
    increments: int


class Analyses:
    """Run analyses one after the other, by the project's solver.

    Parameters
    ----------
    project : Project
    progress : callable, bool or None
        Receives every `Step`.
    out : path or None
        Folder that keeps finished analyses.
    resume : bool
        Whether analyses that the folder has are reused.

    Attributes
    ----------
    solver : Solver
    total : int
        Number of all analyses, for the progress; 0 unless set.
    count : int
        Number of the analyses that have begun.

    Raises
    ------
    InputError, SolverFailure
        The solver cannot be used.
    """

    def __init__(
        self,
        project: Project,
        progress: Listener,
        out: Path | str | None,
        resume: bool,
    ) -> None:
        name = project.fit.solver
        options = project.options_of(name)
        self.solver: Solver = usable_solver(name, options, project.path, cache=project.run_cache)
        self._project = project
        self._solvers: dict[str, Solver] = {}
        if out is not None:
            cache_runs(self.solver, KeptAnalyses(Path(out), resume), counted(name, options))
        self.total = 0
        self.count = 0
        self._on_event = listener(progress)

    def solver_of(self, test: Test) -> Solver:
        """Return the solver of a test: the project's, or the program of a deck of the user's."""
        if not isinstance(test, ProgramTest):
            return self.solver
        if test.name not in self._solvers:
            project = self._project
            self._solvers[test.name] = test.solver(
                lambda name: usable_solver(name, project.options_of(name), cache=project.run_cache)
            )
        return self._solvers[test.name]

    def run(
        self,
        part: str,
        model: Any,
        law: HypoelasticLaw,
        increments: int = 0,
        solver: Solver | None = None,
    ) -> History:
        """Run the next analysis or raise SolverFailure.

        Parameters
        ----------
        part : str
            Name of what is analysed, for messages.
        model : object
            Model of the solver's kind of test.
        law : HypoelasticLaw
        increments : int
            Number of increments of the analysis, for messages; 0 where not known.
        solver : Solver, optional
            That of the project unless given.
        """
        solver = solver or self.solver
        check_carries(solver, law)
        self.count += 1
        count = self.count

        def report(done: float) -> None:
            self._on_event(Step(part, count, self.total, done, increments))

        with timed(f"analysis {count}, {part}, by {solver.name}"):
            report(0.0)
            solver.progress = lambda increment: report(increment.time)
            try:
                return solver.run(model, law)
            finally:
                solver.progress = None


class Histories(dict[str, History]):
    """Analyses by name, each with its model and law."""

    def __repr__(self) -> str:
        frames = ", ".join(f"{name!r} of {len(run.load)} frames" for name, run in self.items())
        return f"Histories: {frames}"

    def plot(
        self,
        name: str | None = None,
        *,
        quantity: Literal["strain", "stress"] = "strain",
        component: int = 0,
        frame: int = -1,
    ) -> Any:
        """Return a drawing of a deformed mesh; see `Fit.plot_moduli`.

        Parameters
        ----------
        name : str, optional
            Of the analysis; by default the first.
        quantity : str
            "strain" or "stress".
        component : int
            0 along the warp, 1 along the fill, 2 in shear.
        frame : int
            From 0; -1 the last.

        Raises
        ------
        InputError
            There is no analysis of that name, or no such component or frame.
        """
        chosen = next(iter(self)) if name is None else name
        check_one_of(chosen, self, "name")
        return draw(self, "history", chosen, quantity, component, frame)


@checked_arguments
def simulate(
    test: Test | Definition, card: MaterialCard, solver: str = "membrane", **options: Any
) -> Histories:
    """Run one test with a card and its thickness.

    Parameters
    ----------
    test : Test or Definition
        A test of a project, or an object such as `Bubble` or `Strips`, which needs no data.
    card : MaterialCard
    solver : str
        Name of the solver.
    **options
        Options of the solver.

    Returns
    -------
    Histories
        By part of the test.

    Raises
    ------
    InputError
        No such solver, or an option it does not know.
    SolverFailure
        The analysis ended without a result.
    """
    if isinstance(test, Definition):
        fabric = Fabric("", card.thickness, card.law.thickness_change)
        (test,) = Project.of(test, fabric=fabric, need_data=False).tests.values()
    usable = usable_solver(solver, options, cache=run_cache())
    if isinstance(test, ProgramTest):
        usable = test.solver(
            lambda name: usable_solver(name, options if name == solver else {}, cache=run_cache())
        )
    check_carries(usable, card.law)
    models = _at_parameters(test, card).models(card.thickness)
    histories = Histories()
    for part, model in models.items():
        history = usable.run(model, card.law)
        histories[part] = replace(history, model=model, law=card.law)
    return histories


@dataclass(frozen=True, eq=False)
class SimulatedTests(Reported):
    """Hold the results of tests that were run with given cards.

    Attributes
    ----------
    project : Project
    command, solver : str
        Names of the command, for the record, and of the solver.
    simulations : mapping of str to Simulation
        By name of the test.
    failures : mapping of str to str
        Reasons of analyses that failed, by test, card and part.
    count : int
        Number of analyses.
    notes : sequence of Note
    """

    project: Project
    command: str
    solver: str
    simulations: Mapping[str, Simulation]
    failures: Mapping[str, str]
    count: int
    notes: Sequence[Note]

    @property
    def errors(self) -> dict[str, float]:
        """Return the largest relative error with each card; named with the test if several."""
        has_several = len(self.simulations) > 1
        return {
            f"{name}, {card}" if has_several else card: error
            for name, simulation in self.simulations.items()
            for card, error in simulation.errors.items()
        }

    @property
    def verdict(self) -> Verdict:
        """Return how many analyses ended, and how far they are from measured values."""
        count = self.count - len(self.failures)
        sentence = f"{count} of {self.count} analyses ended"
        errors = self.errors
        large = large_errors(errors)
        marks = [f"an analysis is marked {str(kind)!r}" for kind in marks_of(self.notes)]
        worst = largest_error(errors)
        if worst is not None:
            sentence += f", with errors of at most {percent(worst)} of the largest measured value"
        return Verdict(
            state_of_predictions(errors, [*marks, *self.failures]),
            sentence,
            (*large, *marks),
            next_step=COMPARE_CURVES if large else "",
            unknown="; ".join(f"{name}: {reason}" for name, reason in self.failures.items()),
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the content of result.json; numbers of a single test stand at its top level."""
        result = {
            "command": self.command,
            "project": str(self.project.path),
            "solver": self.solver,
            "verdict": self.verdict.numbers,
            "notes": note_records(self.notes),
            "tests": {
                name: {**simulation.numbers, "errors": simulation.errors}
                for name, simulation in self.simulations.items()
            },
        }
        if len(self.simulations) == 1:
            for simulation in self.simulations.values():
                result |= simulation.numbers
        return result

    @property
    def lines(self) -> list[str]:
        """Return what a terminal shows."""
        has_several = len(self.simulations) > 1
        lines = [
            f"{name}: {line}" if has_several else line
            for name, simulation in self.simulations.items()
            for line in simulation.lines
        ]
        return [*lines, *note_lines(self.notes), *self.verdict.lines]


@alone_in_folder
def simulate_cards(
    project: Project,
    tests: Sequence[Test],
    cards: Mapping[str, MaterialCard],
    folder: Path,
    within_range: bool = False,
    progress: Listener = None,
    command: str = "simulate test",
    resume: bool | None = None,
) -> SimulatedTests:
    """Run tests with cards; write files of their kinds, notes.csv, report.html and result.json.

    Parameters
    ----------
    project : Project
    tests : sequence of Test
        Numbers of a single test stand at the top level of the result.
    cards : mapping of str to MaterialCard
        By name; the thickness of each counts, not the fabric's.
    folder : path
        For the files.
    within_range : bool
        Show curves only within a card's valid range.
    progress : callable or bool, optional
        Receives every `Step`.
    command : str
        For the record.
    resume : bool, optional
        Whether to go on with the analyses that the folder keeps; None keeps none.

    Raises
    ------
    InputError, OutputError
    SolverFailure
        Nothing ended well.
    """
    analyses = Analyses(project, progress, None if resume is None else folder, bool(resume))
    runs = _run_cards(analyses, tests, cards)
    simulations = {}
    for test in tests:
        runs_of_test = {
            (card, part): run for card in cards for part, run in runs[test.name, card].items()
        }
        output = Output.of(folder, test.name, len(tests) > 1)
        present = presenter_of(test.kind).simulate
        simulations[test.name] = present(test, cards, runs_of_test, output, within_range)
    simulated = SimulatedTests(
        project=project,
        command=command,
        solver=", ".join(dict.fromkeys(analyses.solver_of(test).name for test in tests)),
        simulations=simulations,
        failures={
            f"{test}: {card}, {part}": run.outcome.reason
            for (test, card), parts in runs.items()
            for part, run in parts.items()
            if isinstance(run.outcome, SolverFailure)
        },
        count=analyses.total,
        notes=_simulation_notes(project, tests, cards, runs),
    )
    simulated.report(folder, overwrite=True)
    return simulated


def _run_cards(
    analyses: Analyses, tests: Sequence[Test], cards: Mapping[str, MaterialCard]
) -> RunsOfCards:
    """Run every model of the tests with every card; SolverFailure if nothing ended well."""
    models = {
        (test.name, name): _at_parameters(test, card).models(card.thickness)
        for test in tests
        for name, card in cards.items()
    }
    solvers = {test.name: analyses.solver_of(test) for test in tests}
    analyses.total = sum(map(len, models.values()))
    runs: dict[tuple[str, str], dict[str, CardRun]] = {}
    failures = []
    for (test_name, card_name), parts in models.items():
        runs[test_name, card_name] = {}
        for part, model in parts.items():
            law = cards[card_name].law
            outcome = attempt(
                analyses.run, f"{card_name}, {part}", model, law, 0, solvers[test_name]
            )
            runs[test_name, card_name][part] = CardRun(model, outcome)
            if isinstance(outcome, SolverFailure):
                failures.append(outcome)
    if len(failures) == analyses.total:
        raise failures[0]
    return runs


def _at_parameters(test: Test, card: MaterialCard) -> Test:
    """Return the test with the parameters of its deck as a card has them."""
    return test.with_values(card.parameters) if isinstance(test, ProgramTest) else test


def _simulation_notes(
    project: Project,
    tests: Sequence[Test],
    cards: Mapping[str, MaterialCard],
    runs: RunsOfCards,
) -> list[Note]:
    """Return notes on runs, on cards of another thickness, and on the data of the tests."""
    has_several = len(tests) > 1
    notes = []
    for (test_name, card_name), parts in runs.items():
        run_notes = _notes_of_card(card_name, cards[card_name], parts)
        notes += [note.about(test_name) for note in run_notes] if has_several else run_notes
    for name, card in cards.items():
        thickness_notes = other_thickness(card, project.fabric.thickness)
        notes += [note.about(name) for note in thickness_notes]
    for test in tests:
        data_notes = test.data_notes
        notes += [note.about(test.name) for note in data_notes] if has_several else data_notes
    return notes


def attempt(run: Callable[..., History], *arguments: Any) -> History | SolverFailure:
    """Return the history of an analysis, or the failure that ended it."""
    try:
        return run(*arguments)
    except SolverFailure as failure:
        return failure


def _notes_of_card(name: str, card: MaterialCard, parts: Mapping[str, CardRun]) -> list[Note]:
    """Return the notes of a card's runs, part by part."""
    notes = []
    for part, run in parts.items():
        if isinstance(run.outcome, SolverFailure):
            run_notes = [Note(FAILED, run.outcome.reason)]
        else:
            run_notes = notes_of(run.outcome, card)
        if len(parts) > 1:
            run_notes = [note.about(part) for note in run_notes]
        notes += [note.about(name) for note in run_notes]
    return notes


@dataclass(frozen=True, eq=False)
class StudiedModel:
    """One model of a test with the quantities of its kind; its name is unique in a study."""

    name: str
    model: Any
    studied: Studied

    @property
    def increments(self) -> int:
        """Return the number of load increments of the whole analysis."""
        return len(self.studied.steps(self.model))


def studied_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """Return the tests that a study can run, as `Project.chosen`; InputError: there is none."""
    studied = [test for test in project.chosen(tests) if kind_named(test.kind).studied is not None]
    if not studied:
        raise InputError(project.path, "", "no study can run the tests of this project")
    return studied


def parts_of(
    project: Project,
    tests: Sequence[Test],
    thickness: float,
    refined: Refined = "elements",
    factor: float = 1.0,
) -> dict[str, StudiedModel]:
    """Return every model of the tests by name, refined, with a thickness (mm); InputError."""
    parts: dict[str, StudiedModel] = {}
    for test in tests:
        studied = kind_named(test.kind).studied
        assert studied is not None
        try:
            models = test.models(thickness, refined, factor)
        except InputError as error:
            if error.path is not None:
                raise
            field = f"refinement by {factor:g} (--levels, --coarser, --factor), {error.field}"
            raise InputError(project.path, field, error.problem) from None
        for part, model in models.items():
            # Of its test where it is the only one, with it among several.
            name = part if len(tests) == 1 else f"{test.name}: {part}"
            name = test.name if len(models) == 1 else name
            parts[name] = StudiedModel(name, model, studied)
    return parts


def card_of(project: Project, card: GivenCard | None) -> MaterialCard:
    """Return a card from itself, its file, or its name in the project; InputError.

    Without a card, it is the one that the project's fit left in its usual folder.
    """
    if isinstance(card, MaterialCard):
        return card
    (chosen,) = chosen_cards(project, [fitted_card(project) if card is None else card]).values()
    return chosen


def check_has_law(project: Project) -> None:
    """Raise InputError for a study of moduli of a project that seeks parameters of decks alone."""
    if not project.has_law:
        problem = "this is a study of moduli, and the project has no law: its parameters are for "
        problem += "bubblefit profile, simulate deck and validate"
        raise InputError(project.path, "law.form", problem)


def card_words(card: GivenCard | None) -> str:
    """Return the name of a card in results."""
    if card is None:
        return "of the fit"
    return card.name if isinstance(card, MaterialCard) else str(card)


def begin_study(
    output: OutputSettings,
    settings: Mapping[str, str],
    fits: Iterable[str] = (),
    records: Sequence[str] = (),
) -> Path | None:
    """Make the folder of a study ready, as `Store.begin`, and return it; None if there is none.

    Parameters
    ----------
    output : OutputSettings
    settings : mapping of str to str
        What must be unchanged for the study to be resumed, by name.
    fits : iterable of str
        Folders of its fits, below that of the study. `overwrite` removes their records, from which
        an interrupted study would resume.
    records : sequence of str
        Files of the study that are removed unless it is resumed.
    """
    path = output.path
    if path is None:
        return None
    with output_errors(path):
        for fit in fits if output.overwrite else ():
            for name in (RESULT, RUN):
                (path / fit / name).unlink(missing_ok=True)
    parts = {"version": __version__, **settings}
    Store(path).begin(parts, output.resume, output.overwrite, records)
    return path


class StudyRecord(Generic[R]):
    """Keep the rows of a study under a mark of all that they depend on, each written as it ends.

    Parameters
    ----------
    folder : Path or None
        None where nothing is read or written.
    file : str
        Name of the file.
    name : str
        Name of the rows in the file.
    row_class : type
        Class of the rows, a dataclass of plain values; its first field is the key of a row.
    depends : mapping
        All that the rows depend on, in plain values.
    resume : bool
        Whether to take over what the file holds.

    Attributes
    ----------
    rows : dict
        Rows by their key.
    """

    def __init__(
        self,
        folder: Path | None,
        file: str,
        name: str,
        row_class: type[R],
        depends: Mapping[str, Any],
        resume: bool = True,
    ) -> None:
        self._path = None if folder is None else folder / file
        self._name = name
        self._key = fields(row_class)[0].name
        self._mark = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
        self.rows: dict[Any, R] = {}
        if self._path is not None and resume:
            with suppress(OSError, ValueError, KeyError, TypeError):  # damaged, or not there
                content = json.loads(self._path.read_text(encoding="utf-8"))
                if content["of"] == self._mark:
                    rows = [row_class(**values) for values in content[name]]
                    self.rows = {getattr(row, self._key): row for row in rows}

    def write(self, row: R) -> None:
        """Add a row and write the file; raises OutputError."""
        self.rows[getattr(row, self._key)] = row
        if self._path is not None:
            rows = [asdict(self.rows[key]) for key in sorted(self.rows)]
            content = {"of": self._mark, self._name: rows}
            write_text(self._path, json.dumps(content, indent=1) + "\n")

    def run(
        self, project: Project, prepare: Callable[[], Task], keys: Iterable[Any]
    ) -> Iterator[R | None]:
        """Run the tasks of the keys without a row; yield each row written, None now and then."""
        missing = [key for key in keys if key not in self.rows]
        tasks = executor_of(project).run_tasks(prepare, missing, self._name) if missing else ()
        for row in tasks:
            if row is not None:
                self.write(row)
            yield row
