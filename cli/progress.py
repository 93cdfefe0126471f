"""Progress: a live line on a terminal, a plain line a minute elsewhere, and events for machines."""

from __future__ import annotations

import sys
import time
from collections import Counter
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from .terminal import EVENTS

if TYPE_CHECKING:
    from ..runs.simulation import Step
    from ..runs.starts import Stage
    from ..solvers.base import Announcement

PLAIN_EVERY_S = 60.0
COMPILING = (
    "compiling for this machine: the first run takes some tens of seconds more, later ones do not"
)


class LiveLine:
    """Show a bar on a terminal, on stderr, so that stdout stays for results; elsewhere none.
    Announcements meanwhile get a line of their own; a state (a process that waits for a licence)
    is shown on the bar, and without a bar on a line, a minute apart."""

    def __init__(self, quiet: bool, *more: ProgressColumn) -> None:
        self.bar: Progress | None = None
        self.said = time.monotonic()
        self.quiet, self._hearing = quiet, ExitStack()
        self._states: dict[str, str] = {}
        self._stated: dict[str, float] = {}
        if not quiet and sys.stderr.isatty():
            self.bar = Progress(
                TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), *more,
                TimeElapsedColumn(), console=Console(stderr=True), transient=True,
            )  # fmt: skip

    def __enter__(self) -> Self:
        from ..files import kernels_are_compiled
        from ..solvers.base import hearing

        if not self.quiet and not kernels_are_compiled():
            print(COMPILING, file=sys.stderr, flush=True)
        self._hearing.enter_context(hearing(self.heard))
        if self.bar is not None:
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._hearing.close()
        if self.bar is not None:
            self.bar.stop()

    def heard(self, said: Announcement) -> None:
        """Record a state, or print an announcement."""
        if said.of:
            self._states.pop(said.of, None)
            if said.words:
                self._states[said.of] = said.words
            last = self._stated.get(said.words, -PLAIN_EVERY_S)
            if time.monotonic() - last < PLAIN_EVERY_S:
                return
            self._stated[said.words] = time.monotonic()
        if not said.words or (self.quiet and said.of):  # a state is progress
            return
        if self.bar is None:
            print(said.words, file=sys.stderr, flush=True)
        elif not said.of:
            self.bar.console.print(said.words, markup=False, highlight=False, soft_wrap=True)

    def plain(self, words: str) -> None:
        """Print a line where there is no bar, once a minute."""
        if not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            print(words, file=sys.stderr, flush=True)

    @property
    def states(self) -> str:
        """Return the states with their counts, as the end of a note; "" where there is none."""
        return "".join(f", {n} {words}" for words, n in Counter(self._states.values()).items())


class SeriesProgress(LiveLine):
    """Show a few analyses in turn, with the increments of the one that runs."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(quiet)
        if self.bar is not None:
            self.task = self.bar.add_task("", total=None)

    def saw(self, step: Step) -> None:
        """Show how far the current analysis is; without a terminal once a minute."""
        words = f"analysis {step.analysis} of {step.analyses}, {step.part}{self.states}"
        EVENTS.progress("increments", step.done, step.increments or None, words)
        total = step.increments or None
        if self.bar is not None:
            self.bar.update(self.task, description=words, completed=step.done, total=total)
        else:
            of = f" of {total}" if total else ""
            self.plain(f"{words}: increment {step.done:g}{of}")


class CountProgress(LiveLine):
    """Show how many are done, what runs or ran last, and the time left."""

    def __init__(self, what: str, quiet: bool, total: int = 0) -> None:
        super().__init__(quiet, TextColumn("{task.fields[note]}"))
        self.what, self.total, self.done, self.already = what, total, 0, 0
        self.now, self.begun = "", time.monotonic()
        if self.bar is not None:
            self.task = self.bar.add_task(what, total=total, note="")

    def saw(self, *event: Any) -> None:
        """Record how many of how many are done, and which one begins where it has a name.
        Or a `RunEvent`, the end of a run; None: time passes."""
        if len(event) == 3:
            self.done, self.total, name = event
            self.now = f"{name}, " if name else self.now
        elif (ended := event[0]) is not None:
            self.done, self.total = ended.done, ended.total
            self.already += ended.again
            if ended.run is not None:
                record = ended.run.record
                how = "ended early" if record.early else "finished"
                how = f"failed ({record.failure})" if record.failure else how
                self.now = f"last: {ended.run.title}: {how} in {record.seconds:.0f} s; "
        self.show()

    def show(self) -> None:
        """Update the bar, or elsewhere print a plain line a minute; write events as they come."""
        note = self.note() + self.states
        EVENTS.progress(self.what, self.done, self.total, note)
        if self.bar is not None:
            self.bar.update(self.task, completed=self.done, total=self.total, note=note)
        else:
            self.plain(f"{self.done} of {self.total} {self.what}, {note}")

    def note(self) -> str:
        """Return the words beside the count."""
        return self.now + self.left()

    def left(self) -> str:
        """Return the time left, estimated from the tasks done so far."""
        fresh = self.done - self.already
        if not fresh:
            return "time left not known yet"
        each = (time.monotonic() - self.begun) / fresh
        return f"{each * (self.total - self.done):.0f} s left"


class StudyProgress(CountProgress):
    """Show starts done, best objective, and the time left.
    said : the line that begins each of several fits in turn, with {} for its name."""

    def __init__(self, total: int, quiet: bool, said: str = "{}") -> None:
        super().__init__("starts", quiet, total)
        self.starts, self.said_of_fit = total, said
        self.best: float | None = None
        self.analyses = 0
        #: The start that last had an analysis, and what that left of the objective.
        self.under_way: tuple[int, float | None] | None = None

    def saw(self, *event: Any) -> None:
        """Record the name of a fit that begins, a stage, an analysis or the end of a start.
        None: time passes."""
        from ..runs.starts import EvaluationRecord, Stage, StartRecord

        record = event[0]
        if isinstance(record, str):
            self.begin(Stage("starts", self.starts))
            if not self.quiet:
                print(self.said_of_fit.format(record), file=sys.stderr, flush=True)
        elif isinstance(record, Stage):
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
        """Begin a new count: objectives of another mesh are another sum."""
        self.what, self.total = stage.what, stage.total
        self.done, self.already, self.best, self.under_way = 0, 0, None, None
        self.begun = time.monotonic()
        if self.bar is not None:
            self.bar.update(self.task, description=stage.what)

    def note(self) -> str:
        """Return the best objective, that of the current start, the analyses and the time left."""
        parts = [] if self.best is None else [f"best {self.best:.3g}"]
        if self.under_way is not None:
            start, value = self.under_way
            parts.append(f"start {start} at {'a failure' if value is None else f'{value:.3g}'}")
        count = f"{self.analyses} analys{'is' if self.analyses == 1 else 'es'}"
        return ", ".join([*(parts or ["no analysis yet"]), count, self.left()])
