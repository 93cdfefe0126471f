"""Forward analyses: cards in the tests of a project, or one card in one test."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import Note, NoteKind, SolverFailure, rows
from ..errors import lines as note_lines
from ..experiments.kinds import CardRun, Output, Simulation, Test, notes_of, other_thickness
from ..experiments.registry import report_of
from ..files import write_notes, write_text
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw
from ..project.project import Project
from ..solvers.base import History, Solver, check_carries
from ..solvers.registry import counted, usable_solver
from ..solvers.run_cache import Once, RunCache, run_cache
from .starts import timed

#: A remark on a run that has no result.
FAILED = NoteKind("failed")


@dataclass(frozen=True)
class Step:
    """Progress of a series of analyses; done : increments of the current one, from 1."""

    part: str
    analysis: int
    analyses: int
    done: float
    increments: int


Progress = Callable[[Step], None]


class Analyses:
    """A series of analyses by the project's solver; `total` : their number, for the progress.

    kept : cache of finished analyses beside the cache of runs. Raises InputError or SolverFailure
    if the solver cannot be used.
    """

    def __init__(
        self, project: Project, progress: Progress | None = None, kept: RunCache | None = None
    ) -> None:
        name = project.fit.solver
        options = project.options_of(name)
        self.solver: Solver = usable_solver(name, options, project.path, cache=project.run_cache)
        own = counted(name, options)
        self._runs = self.solver if kept is None else Once(self.solver, kept, own)
        self.total = self.count = 0
        self._progress = progress

    def run(self, part: str, model: Any, law: HypoelasticLaw, increments: int) -> History:
        """Run the next analysis, or raise SolverFailure.

        part, increments : for the progress; 0 where not known.
        """
        check_carries(self.solver, law)
        self.count += 1
        with timed(f"analysis {self.count}, {part}, by {self.solver.name}"):
            return self._run(part, model, law, increments)

    def _run(self, part: str, model: Any, law: HypoelasticLaw, increments: int) -> History:
        tell, count = self._progress, self.count
        if tell is None:
            return self._runs.run(model, law)

        def say(done: float) -> None:
            tell(Step(part, count, self.total, done, increments))

        say(0.0)
        self.solver.progress = lambda increment: say(increment.time)
        try:
            return self._runs.run(model, law)
        finally:
            self.solver.progress = None


def simulate(
    test: Test, card: MaterialCard, solver: str = "membrane", **options: Any
) -> dict[str, History]:
    """Run one test with a card and its thickness; return histories by part of the test.

    Raises
    ------
    InputError : no such solver, or an option it does not know. SolverFailure.
    """
    runs = usable_solver(solver, options, cache=run_cache())
    check_carries(runs, card.law)
    models = test.models(card.thickness)
    return {part: runs.run(model, card.law) for part, model in models.items()}


def simulate_cards(
    project: Project,
    tests: Sequence[Test],
    cards: Mapping[str, MaterialCard],
    folder: Path,
    within_range: bool = False,
    progress: Progress | None = None,
    command: str = "simulate test",
    kept: RunCache | None = None,
) -> Simulation:
    """Run tests with cards; write files of their kinds, notes.csv and result.json.

    Parameters
    ----------
    cards : by name; the thickness of each counts, not the fabric's.
    within_range : show curves only within a card's valid range.
    kept : where finished analyses are kept, to resume an interrupted series.

    Returns
    -------
    The numbers of result.json (of a single test at the top level), and lines for a terminal.

    Raises
    ------
    SolverFailure : nothing ended well. InputError, OutputError.
    """
    analyses = Analyses(project, progress, kept)
    models = {
        (test.name, name): test.models(card.thickness)
        for test in tests
        for name, card in cards.items()
    }
    analyses.total = sum(map(len, models.values()))
    outcomes: dict[tuple[str, str], dict[str, CardRun]] = {}
    for (of, name), parts in models.items():
        outcomes[of, name] = {
            part: CardRun(model, _outcome(analyses, f"{name}, {part}", model, cards[name]))
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
        shown[test.name] = report_of(test.kind).simulate(test, cards, of_test, out, within_range)
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
    result = {
        "command": command,
        "project": str(project.path),
        "solver": analyses.solver.name,
        "notes": rows(notes),
        "tests": {name: one.numbers for name, one in shown.items()},
        **(shown[tests[0].name].numbers if len(tests) == 1 else {}),
    }
    write_notes(folder, notes)
    write_text(folder / "result.json", json.dumps(result, indent=1) + "\n")
    return Simulation(result, _lines(shown, notes))


def _outcome(
    analyses: Analyses, part: str, model: Any, card: MaterialCard
) -> History | SolverFailure:
    try:
        return analyses.run(part, model, card.law, 0)
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


def _lines(shown: Mapping[str, Simulation], notes: Sequence[Note]) -> list[str]:
    several = len(shown) > 1
    lines = [f"{name}: {line}" if several else line for name, one in shown.items()
             for line in one.lines]  # fmt: skip
    return [*lines, *note_lines(notes)]
