"""Progress: a live line on a terminal, a plain line a minute elsewhere, and events for machines."""

from __future__ import annotations

import sys
import time
from collections import Counter
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from ..runs.progress import Count
from .terminal import EVENTS

if TYPE_CHECKING:
    from ..solvers.base import Announcement

PLAIN_EVERY_S = 60.0
COMPILING = (
    "compiling for this machine: the first run takes some tens of seconds more, later ones do not"
)


class LiveLine(Count):
    """Show a bar on a terminal, on stderr, so that stdout stays for results; elsewhere none.
    Announcements meanwhile get a line of their own; a state (a process that waits for a licence)
    is shown on the bar, and without a bar on a line, a minute apart."""

    def __init__(self, what: str, quiet: bool, total: int = 0) -> None:
        super().__init__(what, total)
        self.bar: Progress | None = None
        self.said = time.monotonic()
        self.quiet, self._hearing = quiet, ExitStack()
        self._states: dict[str, str] = {}
        self._stated: dict[str, float] = {}
        if not quiet and sys.stderr.isatty():
            self.bar = Progress(
                TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                TextColumn("{task.fields[note]}"), TimeElapsedColumn(),
                console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self.task = self.bar.add_task(what, total=total or None, note="")

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

    def __call__(self, *event: Any) -> None:
        """Print the name of a fit that begins, and show what was told."""
        if isinstance(event[0], str) and not self.quiet:
            print(event[0], file=sys.stderr, flush=True)
        super().__call__(*event)

    def show(self) -> None:
        """Update the bar, or elsewhere print a plain line a minute; write events as they come."""
        waits = "".join(f", {n} {words}" for words, n in Counter(self._states.values()).items())
        note, total = self.note + waits, self.total or None
        EVENTS.progress(self.what, self.done, total, note)
        if self.bar is not None:
            self.bar.update(
                self.task, description=self.what, completed=self.done, total=total, note=note
            )
        elif not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            print(f"{self.line}{waits}", file=sys.stderr, flush=True)
