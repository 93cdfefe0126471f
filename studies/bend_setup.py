"""From a bending project to its runs: every chosen case with every chosen card."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..materials.card import MaterialCard, read_card
from ..models.cylinder import CylinderModel
from ..projects.bend import BendCase, BendProject
from ..projects.bend_cards import BendCard
from ..runs.bend_run import BendRun, fingerprint, run_bend
from ..runs.processes import Task, run_tasks
from ..solvers.base import Solver
from .fingerprint import solver_words
from .setup import project_solver

KEY = "run.solver"


@dataclass(frozen=True, eq=False)
class Pair:
    """A case with a card."""

    case: BendCase
    name: str
    card: MaterialCard

    def model(self) -> CylinderModel:
        """What is run."""
        return self.case.model(self.card.thickness)

    def mark(self, project: BendProject, solver: Solver) -> str:
        """Fingerprint of the run on the project's solver."""
        options = project.solver_options.get(project.solver, {})
        words = f"{project.solver};{solver_words(solver, options)}"
        return fingerprint(self.model(), self.card, words)


def chosen(project: BendProject, cases: Sequence[str], cards: Sequence[str]) -> BendProject:
    """The project with only some cases and cards, in the project's order; all where none is named.

    cards : names in the project, or files of cards to run in their place.

    Raises
    ------
    InputError : a name that the project does not have; a card's file that is none.
    """
    known = [case.name for case in project.cases]
    for name in cases:
        if name not in known:
            problem = f"there is no case {name!r}; the project has: {', '.join(known)}"
            raise InputError(project.path, "--case", problem)
    wanted: dict[str, BendCard] = {n: c for n, c in project.cards.items() if n in cards}
    for name in cards:
        if name in project.cards:
            continue
        if not Path(name).is_file():
            problem = f"there is no card (and no file) {name!r}; the project has: "
            raise InputError(project.path, "--card", problem + ", ".join(project.cards))
        card = read_card(Path(name))
        own = card.name or Path(name).stem
        if own in wanted:
            own = f"{own} ({name})"
        wanted[own] = BendCard(card)
    return replace(
        project,
        cases=tuple(c for c in project.cases if not cases or c.name in cases),
        cards=wanted or project.cards,
    )


def pairs_of(project: BendProject) -> list[Pair]:
    """Case by case, card by card.

    Raises
    ------
    InputError : a case that makes no model with the thickness of a card.
    """
    found = []
    for case in project.cases:
        for name, card in project.cards.items():
            pair = Pair(case, name, card.card)
            try:
                pair.model()
            except InputError as error:
                where = f"case {case.name!r} with card {name!r}, {error.field}"
                raise InputError(project.path, where, error.problem) from None
            found.append(pair)
    return found


def run_pairs(
    project: BendProject, pairs: Sequence[Pair], numbers: Sequence[int], jobs: int
) -> Iterator[tuple[int, BendRun] | None]:
    """Run the pairs of these numbers side by side; None now and then while none ends."""
    return run_tasks(functools.partial(_runner, project, pairs), numbers, jobs, "runs")


def _runner(project: BendProject, pairs: Sequence[Pair]) -> Task:
    solver = project_solver(project, KEY)

    def run(number: int, tell: Callable[[Any], None]) -> tuple[int, BendRun]:
        pair = pairs[number]
        return number, run_bend(solver, pair.model(), pair.card)

    return run
