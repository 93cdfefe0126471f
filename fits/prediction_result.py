"""Predictions: tests that are not fitted, each with every card, and what they say of the cards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..experiments.predicted import Predicted, PredictedOutcome, PredictedRun, band_of
from ..experiments.registry import kind_named
from ..notes import Note, as_note, marks
from ..notes import lines as note_lines
from ..notes import rows as note_rows
from .numbers import versions
from .record import Record
from .store import PROVENANCE

if TYPE_CHECKING:
    import pandas as pd

    from ..solvers.base import BandEnd
    from .project import Project


def predicted_kind(name: str) -> Predicted:
    """What a kind of test offers whose tests are predicted."""
    kind = kind_named(name).predicted
    assert kind is not None
    return kind


@dataclass(frozen=True, eq=False)
class Predictions:
    """Every chosen test with every chosen card.

    each : the runs, test by test, card by card; they keep this order in every table.
    wall_s : seconds that all of it took. record : what it came from, None where nobody asks.
    """

    project: Project
    each: tuple[PredictedRun, ...]
    wall_s: float
    record: Record | None = None

    @cached_property
    def outcomes(self) -> Mapping[str, tuple[PredictedOutcome, tuple[int, ...]]]:
        """What the runs of each kind of test say, and their numbers among all runs."""
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
        """Everything in plain values, as result.json has it."""
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
            "notes": note_rows(self.notes),
            "worst_relative_error": self.worst,
            "cached_runs": self.cached,
            "wall_s": self.wall_s,
            "versions": versions(),
            **({} if self.record is None else {"provenance": PROVENANCE}),
        }

    @property
    def notes(self) -> list[Note]:
        """What a reader of each run should know, of "TEST with CARD", or "TEST with CARD, WALL"."""
        return [as_note(note).about(run.title) for run in self.each for note in run.notes]

    @property
    def band(self) -> list[BandEnd]:
        """The ends of the solver's band, first what is predicted; empty where there is none."""
        return band_of(self.each)

    @property
    def worst(self) -> float | None:
        """Largest RMS error over the largest value measured; None where nothing is compared.

        Of what is predicted: the other end of a band is no prediction.
        """
        errors = [self.error(i) for i, run in enumerate(self.each) if run.predicted]
        return max((e for e in errors if e is not None), default=None)

    def ended(self, number: int) -> str:
        """How a run ended: "finished", how far it came, or why it failed."""
        outcome, own = self._own(number)
        return outcome.ended(own)

    def error(self, number: int) -> float | None:
        """RMS of model less measured over the largest value measured, of a run."""
        outcome, own = self._own(number)
        return outcome.error(own)

    def failed(self) -> list[int]:
        """Numbers of the runs that failed."""
        return [i for i, run in enumerate(self.each) if run.record.failure]

    @property
    def cached(self) -> int:
        """How many of the runs were made earlier by another program, and not again."""
        return sum(run.record.from_cache for run in self.each)

    def silent(self) -> list[int]:
        """Numbers of the runs of measured tests that gave nothing to compare."""
        measured = [
            i
            for i, run in enumerate(self.each)
            if run.predicted and predicted_kind(run.test.kind).measured(run.test)
        ]
        return [i for i in measured if self.error(i) is None]

    def runs(self) -> pd.DataFrame:
        """A row a run: test, card, wall, numbers, how it ended, marks, notes, seconds."""
        import pandas as pd

        rows = []
        for i, run in enumerate(self.each):
            outcome, own = self._own(i)
            tail = {
                "ended": self.ended(i),
                "marks": "; ".join(marks(run.notes)),
                "notes": "; ".join(run.notes),
                "seconds": run.record.seconds,
            }
            head = {"test": run.test.name, "card": run.card, "wall": run.wall}
            rows.append({**head, **outcome.columns(own), **tail})
        columns = list(dict.fromkeys(name for row in rows for name in row))
        last = [name for name in columns if name not in tail]
        return pd.DataFrame(rows, columns=[*last, *tail])

    def curves(self) -> pd.DataFrame:
        """Every run frame by frame, with its test, card and wall."""
        import pandas as pd

        curves = []
        for i, run in enumerate(self.each):
            outcome, own = self._own(i)
            curve = outcome.curve(own)
            curve.insert(0, "wall", run.wall)
            curve.insert(0, "card", run.card)
            curve.insert(0, "test", run.test.name)
            curves.append(curve)
        return pd.concat(curves, ignore_index=True)

    def lines(self) -> list[str]:
        """For the terminal: a table of each kind of test, then the notes."""
        lines = [line for outcome, _ in self.outcomes.values() for line in outcome.lines()]
        return [*lines, *note_lines(self.notes)]

    def report(self, folder: Path | str) -> Path:
        """Write tables, figures, files, report.html and last result.json; the page's path.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        from .prediction_page import write_predictions

        return write_predictions(self, Path(folder))

    def _own(self, number: int) -> tuple[PredictedOutcome, int]:
        """The outcome that a run belongs to, and its number there."""
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
            "marks": marks(run.notes),
            "seconds": run.record.seconds,
        }
        if run.record.failure:
            return head
        tail = {"iterations": run.record.iterations, "warnings": list(run.notes)}
        return {**head, **outcome.numbers(own), **tail}
