"""Progress of what is called from Python: a callback, a bar in a notebook, or nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from html import escape
from typing import Any

from .starts import Stage, StartRecord

#: Seconds between two updates of a bar, and between two lines elsewhere.
EVERY_S, PLAIN_EVERY_S = 0.2, 10.0


def listener(progress: Callable[..., None] | bool | None) -> Callable[..., None]:
    """Return what receives progress: a callback as it is; None: a bar, in a notebook only.
    True : a bar, and outside notebooks a line every ten seconds. False : nothing."""
    if callable(progress):
        return progress
    if progress or (progress is None and in_notebook()):
        return Bar()
    return lambda *event: None


def in_notebook() -> bool:
    """Return whether a kernel of IPython shows what is displayed."""
    ipython: Any = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return hasattr(shell, "kernel")


class Bar:
    """A line that shows what is done, of how many, and the time left; it is updated in place."""

    def __init__(self) -> None:
        self.done, self.total, self.words = 0, 0, ""
        self.begun = time.monotonic()
        self.shown, self.handle = 0.0, None

    def __call__(self, *event: Any) -> None:
        """Take the progress of any study, or the records of a fit; None: time passes."""
        one = event[0]
        if len(event) == 3:
            self.done, self.total = event[:2]
            self.words = event[2] or self.words
        elif isinstance(one, str):
            self.words = one
        elif isinstance(one, Stage):
            self.done, self.total, self.words = 0, one.total, one.what
            self.begun = time.monotonic()
        elif isinstance(one, StartRecord):
            self.done += 1
        elif hasattr(one, "analyses"):  # a step of a series
            self.done, self.total, self.words = one.analysis - 1, one.analyses, one.part
        elif hasattr(one, "total"):  # the end of a run
            self.done, self.total = one.done, one.total
        self.show()

    @property
    def line(self) -> str:
        """Return the line in words."""
        count = f"{self.done} of {self.total} " if self.total else ""
        left = ""
        if 0 < self.done < self.total:
            each = (time.monotonic() - self.begun) / self.done
            left = f", {each * (self.total - self.done):.0f} s left"
        return f"{count}{self.words}{left}"

    def show(self) -> None:
        """Show the line, unless it was shown a moment ago and there is more to come."""
        notebook, now = in_notebook(), time.monotonic()
        last = self.total > 0 and self.done >= self.total
        if now - self.shown < (EVERY_S if notebook else PLAIN_EVERY_S) and not last:
            return
        self.shown = now
        if not notebook:
            print(self.line, file=sys.stderr, flush=True)
            return
        bar = f"<progress value={self.done} max={max(self.total, 1)}></progress> "
        shown = {"text/plain": self.line, "text/html": bar + escape(self.line)}
        if self.handle is None:
            display: Any = sys.modules["IPython"].display
            self.handle = display.display(shown, raw=True, display_id=True)
        else:
            self.handle.update(shown, raw=True)
