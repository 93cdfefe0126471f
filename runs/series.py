"""Run one card on the tests of a project, one analysis after the other, and keep records of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..errors import InputError, Note
from ..experiments.kinds import Refined, Studied, Test, notes_of, other_thickness
from ..experiments.registry import kinds
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..project.cards import FITTED, usual_folder
from ..project.project import Project, chosen_cards
from ..solvers.base import History, Solver
from ..solvers.run_cache import RunCache
from .folder import Store
from .simulation import Analyses, Progress

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclass(frozen=True, eq=False)
class Part:
    """One model of a test with the quantities of its kind; its name is unique in a study."""

    name: str
    model: Any
    studied: Studied

    @property
    def increments(self) -> int:
        """Number of load increments of the whole analysis."""
        return len(self.studied.steps(self.model))


class Series:
    """The analyses of a study, all with one card.

    progress, kept : as for `Analyses`, whose `total` counts the analyses to come.

    Raises
    ------
    InputError, SolverFailure : the solver of the project cannot be used.
    """

    def __init__(
        self,
        project: Project,
        card: MaterialCard,
        progress: Progress | None = None,
        kept: RunCache | None = None,
    ) -> None:
        self.card, self._analyses = card, Analyses(project, progress, kept)

    @property
    def total(self) -> int:
        """Number of all analyses, for the progress."""
        return self._analyses.total

    @total.setter
    def total(self, total: int) -> None:
        self._analyses.total = total

    @property
    def solver(self) -> Solver:
        """The solver that runs them."""
        return self._analyses.solver

    def run(self, part: Part, law: HypoelasticLaw) -> History:
        """Run the next analysis; raises SolverFailure."""
        return self._analyses.run(part.name, part.model, law, part.increments)

    def notes(self, history: History) -> list[Note]:
        """Return the notes on the values of a run."""
        return notes_of(history, self.card)


def studied_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """Return the tests of a project that a study can run: those named, of a kind named, or all.

    Raises InputError: no such test; none that can be studied.
    """
    known = kinds()
    able = [t for t in project.chosen(tests or None) if known[t.kind].studied is not None]
    if not able:
        raise InputError(project.path, "", "no study can run the tests of this project")
    return able


def parts_of(
    project: Project,
    tests: Sequence[Test],
    thickness: float,
    what: Refined = "elements",
    factor: float = 1.0,
) -> dict[str, Part]:
    """Return every model of the tests by name, refined, with the thickness (mm) of a card.

    Raises InputError: a mesh or increments that cannot be made.
    """
    parts: dict[str, Part] = {}
    for test in tests:
        studied = kinds()[test.kind].studied
        assert studied is not None
        try:
            models = test.models(thickness, what, factor)
        except InputError as error:
            if error.path is not None:
                raise
            field = f"refinement by {factor:g} (--levels, --coarser, --factor), {error.field}"
            raise InputError(project.path, field, error.problem) from None
        for part, model in models.items():
            name = part_name(test, part, len(models), len(tests))
            parts[name] = Part(name, model, studied)
    return parts


def part_name(test: Test, part: str, parts: int, tests: int) -> str:
    """Return a part's name: that of its test where it is the only one, with it among several."""
    if parts == 1:
        return test.name
    return part if tests == 1 else f"{test.name}: {part}"


def card_of(project: Project, card: MaterialCard | Path | str) -> MaterialCard:
    """Return a card that is given as itself, its file, or its name in the project.

    Raises InputError: there is none, or the file is no card.
    """
    if isinstance(card, MaterialCard):
        return card
    (chosen,) = chosen_cards(project, [card]).values()
    return chosen


def fitted_card(project: Project) -> Path:
    """Return the path of the card that the project's fit left in its usual folder.

    Raises InputError: there is none.
    """
    path = usual_folder(project.path) / FITTED
    if not path.is_file():
        problem = f"no fit left a card in {path}: fit first (bubblefit fit), or name a card"
        raise InputError(project.path, "--card", problem)
    return path


def card_words(card: MaterialCard | Path | str) -> str:
    """Return the name of a card in results."""
    return card.name if isinstance(card, MaterialCard) else str(card)


def thickness_notes(project: Project, card: MaterialCard) -> list[Note]:
    """Return a note where the card's thickness, which counts, is not the fabric's."""
    return other_thickness(card, project.fabric.thickness)


T = TypeVar("T")
R = TypeVar("R", bound="DataclassInstance")


def begin_study(
    folder: Path,
    parts: Mapping[str, str],
    resume: bool,
    overwrite: bool,
    fits: Iterable[str],
    records: Sequence[str] = (),
) -> None:
    """Prepare the folder of a study that holds a folder for each of its fits.

    `overwrite` removes the records of earlier fits, from which an interrupted study would resume.

    Raises
    ------
    OutputError, InputError : as `Store.begin`.
    """
    for name in fits if overwrite else ():
        Store(folder / name).forget()
    Store(folder).begin(parts, resume, overwrite, records)


def mark_of(parts: Mapping[str, Any]) -> str:
    """Return a digest of everything that a record depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_marked(path: Path, mark: str, read: Callable[[dict[str, Any]], T]) -> T | None:
    """Read a record with `read`; None where it has another mark, or there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return read(content) if content["of"] == mark else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_marked(folder: Path, file: str, mark: str, content: Mapping[str, Any]) -> None:
    """Write a record into an existing folder; raises OutputError."""
    Store(folder).write(file, json.dumps({"of": mark, **content}, indent=1) + "\n")


class StudyRecord(Generic[R]):
    """Rows of a study under a mark of all that they depend on, each written as it ends.

    Parameters
    ----------
    folder : None where nothing is read or written. file : its name. name : of the rows in the file.
    row : their class, a dataclass of plain values. key : field by which `rows` are sorted.
    depends : on what they depend, in plain values. read : take over what the file holds.
    """

    def __init__(
        self, folder: Path | None, file: str, name: str, row: type[R], key: str,
        depends: Mapping[str, Any], read: bool = True,
    ) -> None:  # fmt: skip
        self._folder, self._file, self._name, self._key = folder, file, name, key
        self._mark = mark_of(depends)
        self.rows: dict[Any, R] = {}
        if folder is not None and read:
            for one in read_marked(folder / file, self._mark, self._rows_of(row)) or ():
                self.rows[getattr(one, key)] = one

    def _rows_of(self, row: type[R]) -> Callable[[dict[str, Any]], list[R]]:
        return lambda content: [row(**own) for own in content[self._name]]

    def write(self, row: R) -> None:
        """Add a row and write the file; raises OutputError."""
        self.rows[getattr(row, self._key)] = row
        if self._folder is not None:
            rows = [asdict(self.rows[key]) for key in sorted(self.rows)]
            write_marked(self._folder, self._file, self._mark, {self._name: rows})
