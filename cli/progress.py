"""Progress of fits and of predictions: what is counted, and what is said beside the count."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from ..runs.starts import EvaluationRecord, Stage, StartRecord
from .live_line import CountProgress

if TYPE_CHECKING:
    from ..runs.predictions import RunEvent


class NamedProgress(CountProgress):
    """Things done, the one whose turn it is, time left."""

    def __init__(self, what: str, quiet: bool) -> None:
        super().__init__(what, 0, 0, quiet)
        self.now = ""

    def saw(self, done: int, total: int, name: str) -> None:
        """Take note of how many are done, and of the one whose turn comes where it has a name."""
        self.done, self.total, self.now = done, total, name or self.now
        self.show()

    def note(self) -> str:
        """What is computed, and time left."""
        return f"{self.now}, {self.left()}" if self.now else self.left()


class StudyProgress(CountProgress):
    """Starts done, best objective, time left."""

    def __init__(self, total: int, quiet: bool) -> None:
        super().__init__("starts", total, 0, quiet)
        self.starts = total
        self.best: float | None = None
        self.analyses = 0
        #: The start that last had an analysis, and what that left of the objective.
        self.under_way: tuple[int, float | None] | None = None

    def saw(self, record: object) -> None:
        """Take note of a record, of a stage that begins, or of time passing."""
        if isinstance(record, Stage):
            self.begin(record)
        elif isinstance(record, EvaluationRecord):
            self.analyses += 1
            self.under_way = record.start, record.objective
        elif isinstance(record, StartRecord):
            self.done += 1
            self.under_way = None
            if record.objective is not None:
                self.best = min(self.best or record.objective, record.objective)
        self.show()

    def begin(self, stage: Stage) -> None:
        """Count anew: objectives of another mesh are another sum."""
        self.what, self.total, self.done, self.already, self.best = (
            stage.what,
            stage.total,
            0,
            0,
            None,
        )
        self.under_way = None
        self.begun = time.monotonic()
        if self.bar is not None:
            self.bar.update(self.task, description=stage.what)

    def note(self) -> str:
        """Best objective so far, that of the start under way, analyses, time left."""
        parts = [] if self.best is None else [f"best {self.best:.3g}"]
        if self.under_way is not None:
            start, value = self.under_way
            parts.append(f"start {start} at {'a failure' if value is None else f'{value:.3g}'}")
        begun = parts or ["no analysis yet"]
        return ", ".join(
            [*begun, f"{self.analyses} analys{'is' if self.analyses == 1 else 'es'}", self.left()]
        )


class FitsProgress(StudyProgress):
    """Several fits in turn: the words of the one whose turn it is, then its starts.

    said : of the fit, with {} for its name.
    """

    def __init__(self, total: int, quiet: bool, said: str = "{}") -> None:
        super().__init__(total, quiet)
        self.said_of_fit = said

    def saw(self, record: object) -> None:
        """Take note of a fit that begins, of a start or a fold that ended, or of time passing."""
        if isinstance(record, str):
            self.begin(Stage("starts", self.starts))
            if not self.quiet:
                print(self.said_of_fit.format(record), file=sys.stderr, flush=True)
        super().saw(record)


class RunsProgress(CountProgress):
    """Runs done, how the last one ended, time left."""

    def __init__(self, quiet: bool) -> None:
        super().__init__("runs", 0, 0, quiet)
        self.last = ""

    def saw(self, event: RunEvent | None) -> None:
        """Take note of a run that ended, or of time passing."""
        if event is not None:
            self.done, self.total = event.done, event.total
            self.already += event.again
        if event is not None and event.run is not None:
            run, record = event.run, event.run.record
            how = "ended early" if record.early else "finished"
            how = f"failed ({record.failure})" if record.failure else how
            words = f"{run.title}: {how} in {record.seconds:.0f} s"
            self.last = f"last: {words}; "
        self.show()

    def note(self) -> str:
        """How the last run ended, and time left."""
        return self.last + self.left()
