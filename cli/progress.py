"""Progress of a study: a live line on a terminal, a plain line a minute elsewhere."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from ..fits.analyses import Step
from ..fits.start import EvaluationRecord, Stage, StartRecord

if TYPE_CHECKING:
    from ..fits.predictions import RunEvent

PLAIN_EVERY_S = 60.0


class LiveLine:
    """A bar on a terminal, on stderr, so that stdout stays for results; elsewhere none."""

    def __init__(self, quiet: bool, *more: ProgressColumn) -> None:
        self.bar: Progress | None = None
        if not quiet and sys.stderr.isatty():
            self.bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                *more,
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )

    def __enter__(self) -> Self:
        if self.bar is not None:
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


class SeriesProgress(LiveLine):
    """A few analyses one after the other, with the increments of the one that runs."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(quiet)
        if self.bar is not None:
            self.task = self.bar.add_task("", total=None)

    def saw(self, step: Step) -> None:
        """Show how far the analysis is that runs."""
        if self.bar is not None:
            words = f"analysis {step.analysis} of {step.analyses}, {step.part}"
            self.bar.update(
                self.task,
                description=words,
                completed=step.done,
                total=step.increments or None,
            )


class CountProgress(LiveLine):
    """Tasks done and a note."""

    def __init__(self, what: str, total: int, done: int, quiet: bool) -> None:
        super().__init__(quiet, TextColumn("{task.fields[note]}"))
        self.what, self.total, self.done, self.already = what, total, done, done
        self.begun = self.said = time.monotonic()
        self.quiet = quiet
        if self.bar is not None:
            self.task = self.bar.add_task(what, total=total, completed=done, note="")

    def show(self) -> None:
        """On a terminal at once, elsewhere a plain line a minute."""
        if self.bar is not None:
            self.bar.update(self.task, completed=self.done, total=self.total, note=self.note())
        elif not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            words = f"{self.done} of {self.total} {self.what}, {self.note()}"
            print(words, file=sys.stderr, flush=True)

    def note(self) -> str:
        """What to say beside the count."""
        return self.left()

    def left(self) -> str:
        """Time left, from the tasks done so far."""
        fresh = self.done - self.already
        if not fresh:
            return "? left"
        each = (time.monotonic() - self.begun) / fresh
        return f"{each * (self.total - self.done):.0f} s left"


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

    def saw(self, record: object) -> None:
        """Take note of a record, of a stage that begins, or of time passing."""
        if isinstance(record, Stage):
            self.begin(record)
        elif isinstance(record, EvaluationRecord):
            self.analyses += 1
        elif isinstance(record, StartRecord):
            self.done += 1
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
        self.begun = time.monotonic()
        if self.bar is not None:
            self.bar.update(self.task, description=stage.what)

    def note(self) -> str:
        """Best objective so far, analyses, time left."""
        best = "none yet" if self.best is None else f"{self.best:.3g}"
        return f"best e {best}, {self.analyses} analyses, {self.left()}"


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
