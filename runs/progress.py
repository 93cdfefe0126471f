"""Progress: a callback, a bar in a notebook, or nothing; `Count` holds it for terminals as well."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from html import escape
from typing import Any

#: Receives the progress of a study; None: a bar, in a notebook only; True: a bar; False: nothing.
Listener = Callable[..., None] | bool | None
#: Seconds between two updates of a bar, and between two lines elsewhere.
EVERY_S, PLAIN_EVERY_S = 0.2, 10.0


def listener(progress: Listener) -> Callable[..., None]:
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


class Count:
    """Hold what is done, of how many, what runs, and the time left; `show` is the subclass's.
    total : also of the starts of each fit, where several are made in turn."""

    def __init__(self, what: str = "", total: int = 0) -> None:
        self.starts = total
        self.words = ""
        self.analyses = 0
        self.begin(what, total)

    def begin(self, what: str, total: int) -> None:
        """Begin a new count: objectives of another mesh are another sum."""
        self.what = what
        self.total = total
        self.already = 0
        self.done: float = 0
        self.best: float | None = None
        #: The start that last had an analysis, and what that left of the objective.
        self.under_way: tuple[int, float | None] | None = None
        self.begun = time.monotonic()

    def __call__(self, *event: Any) -> None:
        """Take the count and the words of a study, or an event of a fit, of predictions or of a
        series of analyses by the name of its class; None: time passes."""
        one = event[0]
        kind = type(event[0]).__name__
        if len(event) == 3:
            self.done, self.total = event[:2]
            self.words = event[2] or self.words
        elif isinstance(one, str):  # the name of a fit that begins
            self.begin(self.what, self.starts)
            self.words = one
        elif kind == "Stage":
            self.begin(one.what, one.total)
        elif kind == "EvaluationRecord":
            self.analyses += 1
            self.under_way = one.start, one.objective
        elif kind == "StartRecord":
            self.done = self.done + 1
            self.under_way = None
            if one.objective is not None:
                self.best = min(self.best or one.objective, one.objective)
        elif kind == "Step":
            if one.done == 0:
                self.begin("increments", one.increments)
            self.done = one.done
            self.words = f"analysis {one.analysis} of {one.analyses}, {one.part}"
        elif kind == "RunEvent":
            self.done, self.total, self.already = one.done, one.total, self.already + one.again
            if one.run is not None:
                record = one.run.record
                how = "ended early" if record.early else "finished"
                how = f"failed ({record.failure})" if record.failure else how
                self.words = f"last: {one.run.title}: {how} in {record.seconds:.0f} s"
        self.show()

    def show(self) -> None:
        """Show the line."""

    @property
    def note(self) -> str:
        """Return the words beside the count, the last of them the time left."""
        parts = [self.words] if self.words else []
        if self.best is not None:
            parts.append(f"best {self.best:.3g}")
        if self.under_way is not None:
            start, value = self.under_way
            parts.append(f"start {start} at {'a failure' if value is None else f'{value:.3g}'}")
        if self.analyses:
            parts.append(f"{self.analyses} analys{'is' if self.analyses == 1 else 'es'}")
        left = "time left not known yet"
        fresh = self.done - self.already
        if fresh > 0:
            each = (time.monotonic() - self.begun) / fresh
            left = f"{each * (self.total - self.done):.0f} s left"
        return ", ".join([*parts, left])

    @property
    def line(self) -> str:
        """Return the count with its note."""
        count = f"{self.done:g} of {self.total} {self.what}".rstrip() + ", " if self.total else ""
        return f"{count}{self.note}"


class Bar(Count):
    """A bar in a notebook that is updated in place; a line now and then elsewhere."""

    shown, handle = 0.0, None

    def show(self) -> None:
        """Show the line, unless it was shown a moment ago and there is more to come."""
        notebook = in_notebook()
        now = time.monotonic()
        last = self.total > 0 and self.done >= self.total
        if now - self.shown < (EVERY_S if notebook else PLAIN_EVERY_S) and not last:
            return
        self.shown = now
        if not notebook:
            print(self.line, file=sys.stderr, flush=True)
            return
        bar = f"<progress value={self.done:g} max={max(self.total, 1)}></progress> "
        shown = {"text/plain": self.line, "text/html": bar + escape(self.line)}
        if self.handle is None:
            display: Any = sys.modules["IPython"].display
            self.handle = display.display(shown, raw=True, display_id=True)
        else:
            self.handle.update(shown, raw=True)
