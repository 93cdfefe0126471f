"""A live line of progress on a terminal, a plain line a minute elsewhere."""

from __future__ import annotations

import sys
import time
from collections import Counter
from contextlib import ExitStack
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from ..files import kernels_are_compiled
from ..runs.simulation import Step
from ..solvers.base import Announcement, hearing
from .events import EVENTS

PLAIN_EVERY_S = 60.0
COMPILING = (
    "compiling for this machine: the first run takes some tens of seconds more, later ones do not"
)


class LiveLine:
    """A bar on a terminal, on stderr, so that stdout stays for results; elsewhere none.

    What is announced while it is there is said on a line of its own; a state (somebody waits for a
    licence) is on the bar, and without one a line, a minute apart.
    """

    def __init__(self, quiet: bool, *more: ProgressColumn) -> None:
        self.bar: Progress | None = None
        self.quiet, self._hearing = quiet, ExitStack()
        self._states: dict[str, str] = {}
        self._stated: dict[str, float] = {}
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
        """Take note of a state, or say it."""
        if said.of:
            self._states.pop(said.of, None)
            if said.words:
                self._states[said.of] = said.words
            last = self._stated.get(said.words, -PLAIN_EVERY_S)
            if time.monotonic() - last < PLAIN_EVERY_S:
                return
            self._stated[said.words] = time.monotonic()
        if not said.words or (self.quiet and said.of):  # a state is progress, the rest is not
            return
        if self.bar is None:
            print(said.words, file=sys.stderr, flush=True)
        elif not said.of:
            self.bar.console.print(said.words, markup=False, highlight=False, soft_wrap=True)

    @property
    def states(self) -> str:
        """Who is in which state, as the end of a note; "" where nobody is."""
        return "".join(f", {n} {words}" for words, n in Counter(self._states.values()).items())


class SeriesProgress(LiveLine):
    """A few analyses one after the other, with the increments of the one that runs."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(quiet)
        self.said = time.monotonic()
        if self.bar is not None:
            self.task = self.bar.add_task("", total=None)

    def saw(self, step: Step) -> None:
        """Show how far the analysis is that runs; elsewhere than on a terminal once a minute."""
        words = f"analysis {step.analysis} of {step.analyses}, {step.part}{self.states}"
        EVENTS.progress("increments", step.done, step.increments or None, words)
        if self.bar is None and not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            of = f" of {step.increments}" if step.increments else ""
            print(f"{words}: increment {step.done:g}{of}", file=sys.stderr, flush=True)
        if self.bar is not None:
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
        if self.bar is not None:
            self.task = self.bar.add_task(what, total=total, completed=done, note="")

    def show(self) -> None:
        """On a terminal at once, elsewhere a plain line a minute; events as they come."""
        EVENTS.progress(self.what, self.done, self.total, self.note() + self.states)
        if self.bar is not None:
            self.bar.update(self.task, completed=self.done, total=self.total,
                            note=self.note() + self.states)  # fmt: skip
        elif not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            words = f"{self.done} of {self.total} {self.what}, {self.note()}{self.states}"
            print(words, file=sys.stderr, flush=True)

    def note(self) -> str:
        """What to say beside the count."""
        return self.left()

    def left(self) -> str:
        """Time left, from the tasks done so far."""
        fresh = self.done - self.already
        if not fresh:
            return "time left not known yet"
        each = (time.monotonic() - self.begun) / fresh
        return f"{each * (self.total - self.done):.0f} s left"
