"""Forward analyses: cards in tests, one after the other, and the records of a study of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from ..arguments import checked_arguments
from ..errors import InputError, SolverFailure, check_one_of
from ..experiments.base import Refined, Test
from ..experiments.fabric import Fabric
from ..experiments.forward import CardRun, Simulation, Studied
from ..experiments.output import Output
from ..experiments.presenter import presenter_of
from ..experiments.registry import kind_named
from ..experiments.run_records import notes_of, other_thickness
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, note_lines, note_records, write_notes
from ..project.objects import Definition
from ..project.project import Project, chosen_cards, fitted_card
from ..solvers.base import History, Solver, check_carries
from ..solvers.registry import counted, usable_solver
from ..solvers.run_cache import once, run_cache
from ..storage.plain_values import json_text
from ..storage.writing import output_errors, write_text
from ..version import __version__
from .executor import executor_of
from .folder import RESULT, RUN, KeptAnalyses, OutputSettings, Store, draw
from .in_use import alone_in_folder
from .log import timed
from .process_pool import Task
from .progress import Listener, listener

#: A remark on a run that has no result.
FAILED = NoteKind("failed")
if TYPE_CHECKING:
    from _typeshed import DataclassInstance

R = TypeVar("R", bound="DataclassInstance")
GivenCard = MaterialCard | Path | str


@dataclass(frozen=True)
class Step:
    """Progress of a series of analyses; done : increments of the current one, from 1."""

    part: str
    analysis: int
    analyses: int
    done: float
    increments: int


class Analyses:
    """A series of analyses by the project's solver; `total` : their number, for the progress.
    out : folder that keeps finished analyses, from which `resume` goes on. Raises InputError or
    SolverFailure if the solver cannot be used."""

    def __init__(
        self,
        project: Project,
        progress: Listener = None,
        out: Path | str | None = None,
        resume: bool = False,
    ) -> None:
        name = project.fit.solver
        options = project.options_of(name)
        self.solver: Solver = usable_solver(name, options, project.path, cache=project.run_cache)
        if out is not None:
            once(self.solver, KeptAnalyses(Path(out), resume), counted(name, options))
        self.total = self.count = 0
        self._progress = listener(progress)

    def run(self, part: str, model: Any, law: HypoelasticLaw, increments: int = 0) -> History:
        """Run the next analysis or raise SolverFailure; increments : 0 where not known."""
        check_carries(self.solver, law)
        self.count += 1
        tell = self._progress
        count = self.count
        with timed(f"analysis {count}, {part}, by {self.solver.name}"):

            def say(done: float) -> None:
                tell(Step(part, count, self.total, done, increments))

            say(0.0)
            self.solver.progress = lambda increment: say(increment.time)
            try:
                return self.solver.run(model, law)
            finally:
                self.solver.progress = None


class Histories(dict[str, History]):
    """Analyses by name, each with its model and law."""

    def plot(
        self,
        name: str | None = None,
        *,
        quantity: Literal["strain", "stress"] = "strain",
        component: int = 0,
        frame: int = -1,
    ) -> Any:
        """Return a drawing of a deformed mesh, the first unless named; see `Fit.plot_moduli`.
        component : 0 along the warp, 1 along the fill, 2 in shear. frame : from 0; -1 the last.
        InputError : no analysis of that name, or no such component or frame."""
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
        Of a project, or an object such as `Bubble` or `Strips`, which needs no data.
    card : MaterialCard
    solver : str
    **options
        Of the solver.

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
    runs = usable_solver(solver, options, cache=run_cache())
    check_carries(runs, card.law)
    models = test.models(card.thickness)
    return Histories(
        {
            part: replace(runs.run(model, card.law), model=model, law=card.law)
            for part, model in models.items()
        }
    )


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
) -> Simulation:
    """Run tests with cards; write files of their kinds, notes.csv and result.json.
    cards : by name; the thickness of each counts, not the fabric's. within_range : show curves only
    within a card's valid range. resume : go on with the analyses that the folder keeps; None keeps
    none. Numbers of a single test stand at the top level. SolverFailure : nothing ended well.
    InputError, OutputError."""
    analyses = Analyses(project, progress, None if resume is None else folder, bool(resume))
    models = {
        (test.name, name): test.models(card.thickness)
        for test in tests
        for name, card in cards.items()
    }
    analyses.total = sum(map(len, models.values()))
    outcomes: dict[tuple[str, str], dict[str, CardRun]] = {}
    for (of, name), parts in models.items():
        outcomes[of, name] = {
            part: CardRun(model, attempt(analyses.run, f"{name}, {part}", model, cards[name].law))
            for part, model in parts.items()
        }
    every = [run.outcome for parts in outcomes.values() for run in parts.values()]
    failures = [outcome for outcome in every if isinstance(outcome, SolverFailure)]
    if len(failures) == len(every):
        raise failures[0]
    shown: dict[str, Simulation] = {}
    for test in tests:
        of_test = {
            (name, part): run for name in cards for part, run in outcomes[test.name, name].items()
        }
        out = Output.of(folder, test.name, len(tests) > 1)
        shown[test.name] = presenter_of(test.kind).simulate(test, cards, of_test, out, within_range)
    notes = [
        note.about(of) if len(tests) > 1 else note
        for (of, name), parts in outcomes.items()
        for note in _notes(name, cards[name], parts)
    ]
    notes += [
        note.about(name)
        for name, card in cards.items()
        for note in other_thickness(card, project.fabric.thickness)
    ]
    for test in tests:
        remarks = test.data_notes
        notes += [note.about(test.name) for note in remarks] if len(tests) > 1 else remarks
    result = {
        "command": command,
        "project": str(project.path),
        "solver": analyses.solver.name,
        "notes": note_records(notes),
        "tests": {name: one.numbers for name, one in shown.items()},
        **(shown[tests[0].name].numbers if len(tests) == 1 else {}),
    }
    write_notes(folder, notes)
    write_text(folder / RESULT, json_text(result))
    several = "{0}: {1}" if len(shown) > 1 else "{1}"
    lines = [several.format(name, line) for name, one in shown.items() for line in one.lines]
    return Simulation(result, [*lines, *note_lines(notes)])


def attempt(run: Callable[..., History], *given: Any) -> History | SolverFailure:
    """Return the history of an analysis, or the failure that ended it."""
    try:
        return run(*given)
    except SolverFailure as failure:
        return failure


def _notes(name: str, card: MaterialCard, parts: Mapping[str, CardRun]) -> list[Note]:
    """Return the notes of a card's runs, part by part."""
    notes = []
    for part, run in parts.items():
        if isinstance(run.outcome, SolverFailure):
            own = [Note(FAILED, run.outcome.reason)]
        else:
            own = notes_of(run.outcome, card)
        notes += [(note.about(part) if len(parts) > 1 else note).about(name) for note in own]
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
    able = [t for t in project.chosen(tests) if kind_named(t.kind).studied is not None]
    if not able:
        raise InputError(project.path, "", "no study can run the tests of this project")
    return able


def parts_of(
    project: Project,
    tests: Sequence[Test],
    thickness: float,
    what: Refined = "elements",
    factor: float = 1.0,
) -> dict[str, StudiedModel]:
    """Return every model of the tests by name, refined, with a thickness (mm); InputError."""
    parts: dict[str, StudiedModel] = {}
    for test in tests:
        studied = kind_named(test.kind).studied
        assert studied is not None
        try:
            models = test.models(thickness, what, factor)
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
    """Return a card that is given as itself, its file, or its name in the project; InputError.
    None : the one that the project's fit left in its usual folder."""
    if isinstance(card, MaterialCard):
        return card
    (chosen,) = chosen_cards(project, [fitted_card(project) if card is None else card]).values()
    return chosen


def card_words(card: GivenCard | None) -> str:
    """Return the name of a card in results."""
    if card is None:
        return "of the fit"
    return card.name if isinstance(card, MaterialCard) else str(card)


def begin_study(
    output: OutputSettings,
    of: Mapping[str, str],
    fits: Iterable[str] = (),
    records: Sequence[str] = (),
) -> Path | None:
    """Return the folder of a study, if any, prepared with a folder for each fit; as `Store.begin`.
    `overwrite` removes the records of earlier fits, from which an interrupted study would resume.
    """
    path = output.path
    if path is None:
        return None
    with output_errors(path):
        for fit in fits if output.overwrite else ():
            for name in (RESULT, RUN):
                (path / fit / name).unlink(missing_ok=True)
    parts = {"version": __version__, **of}
    Store(path).begin(parts, output.resume, output.overwrite, records)
    return path


class StudyRecord(Generic[R]):
    """Rows of a study under a mark of all that they depend on, each written as it ends.
    folder : None where nothing is read or written. file : its name. name : of the rows in the file.
    row : their class, a dataclass of plain values. key : field by which `rows` are sorted.
    depends : on what they depend, in plain values. read : take over what the file holds."""

    def __init__(
        self,
        folder: Path | None,
        file: str,
        name: str,
        row: type[R],
        key: str,
        depends: Mapping[str, Any],
        read: bool = True,
    ) -> None:
        self._path = None if folder is None else folder / file
        self._name = name
        self._key = key
        self._mark = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
        self.rows: dict[Any, R] = {}
        if self._path is not None and read:
            with suppress(OSError, ValueError, KeyError, TypeError):  # damaged, or not there
                content = json.loads(self._path.read_text(encoding="utf-8"))
                if content["of"] == self._mark:
                    rows = [row(**own) for own in content[name]]
                    self.rows = {getattr(one, key): one for one in rows}

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
