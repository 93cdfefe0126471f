"""What every study is: one card on the tests of a project, one analysis after the other."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ..errors import InputError
from ..experiments.kinds import Refined, Studied, Test, notes_of, other_thickness
from ..experiments.registry import kinds
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..notes import Note
from ..project.cards import FITTED, usual_folder
from ..project.project import Project, chosen_cards
from ..solvers.base import History, Solver
from ..solvers.run_cache import RunCache
from .folder import Store
from .simulation import Analyses, Progress


@dataclass(frozen=True, eq=False)
class Part:
    """One model of a test, and what its kind looks at. name : unique among those of a study."""

    name: str
    model: Any
    studied: Studied

    @property
    def increments(self) -> int:
        """Of the load, over the whole analysis."""
        return len(self.studied.steps(self.model))


class Series:
    """Analyses with one card: those of a study.

    Parameters
    ----------
    project : whose tests are run. card : with which material. progress : is told how far they are.
        `total` : how many analyses there will be, for the progress. kept : as of `Analyses`.

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
        """How many analyses there will be."""
        return self._analyses.total

    @total.setter
    def total(self, total: int) -> None:
        self._analyses.total = total

    @property
    def solver(self) -> Solver:
        """What runs them."""
        return self._analyses.solver

    def run(self, part: Part, law: HypoelasticLaw) -> History:
        """The next analysis; raises SolverFailure."""
        return self._analyses.run(part.name, part.model, law, part.increments)

    def notes(self, history: History) -> list[Note]:
        """What a reader of a run's values should know."""
        return notes_of(history, self.card)


def studied_tests(project: Project, tests: str | Sequence[str] | None = None) -> list[Test]:
    """The tests of a project that a study can run: those named, of a kind named, or all.

    Raises
    ------
    InputError : a name that is none; no test that can be studied.
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
    """Every model of the tests, with the thickness (mm) of a card; one refinement of it.

    Raises
    ------
    InputError : a mesh or increments that cannot be had.
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
    """What a part is called: as its test where it is the only one, with it among several tests."""
    if parts == 1:
        return test.name
    return part if tests == 1 else f"{test.name}: {part}"


def card_of(project: Project, card: MaterialCard | Path | str) -> MaterialCard:
    """A card as it is given: itself, its file, or its name in the project.

    Raises
    ------
    InputError : there is none, or it is no card.
    """
    if isinstance(card, MaterialCard):
        return card
    (chosen,) = chosen_cards(project, [card]).values()
    return chosen


def fitted_card(project: Project) -> Path:
    """The card that the project's fit left in its usual folder.

    Raises
    ------
    InputError : there is none.
    """
    path = usual_folder(project.path) / FITTED
    if not path.is_file():
        problem = f"no fit left a card in {path}: fit first (bubblefit fit), or name a card"
        raise InputError(project.path, "--card", problem)
    return path


def card_words(card: MaterialCard | Path | str) -> str:
    """How a result names the card that it was given."""
    return card.name if isinstance(card, MaterialCard) else str(card)


def thickness_notes(project: Project, card: MaterialCard) -> list[Note]:
    """The card's thickness where it is not the fabric's: the card's counts."""
    return other_thickness(card, project.fabric.thickness)


T = TypeVar("T")


def begin_study(
    folder: Path,
    parts: Mapping[str, str],
    resume: bool,
    overwrite: bool,
    fits: Iterable[str],
    records: Sequence[str] = (),
) -> None:
    """Make the folder of a study ready, of whose fits each has a folder of its own in it.

    Where all is replaced, nothing of earlier fits is left that an interrupted study would go on
    with.

    Raises
    ------
    OutputError, InputError : as `Store.begin`.
    """
    for name in fits if overwrite else ():
        Store(folder / name).forget()
    Store(folder).begin(parts, resume, overwrite, records)


def mark_of(parts: Mapping[str, Any]) -> str:
    """Of everything that a record depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_marked(path: Path, mark: str, read: Callable[[dict[str, Any]], T]) -> T | None:
    """What `read` makes of a record; None where it is of something else, or no record at all."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return read(content) if content["of"] == mark else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_marked(folder: Path, file: str, mark: str, content: Mapping[str, Any]) -> None:
    """Write a record into a folder that is there; raises OutputError."""
    Store(folder).write(file, json.dumps({"of": mark, **content}, indent=1) + "\n")
