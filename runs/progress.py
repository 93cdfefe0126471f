"""Progress of runs: shown by a callback, a bar in a notebook or lines (`Count`), and logged."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

#: Receives the progress of a study; None: a bar, in a notebook only; True: a bar; False: nothing.
Listener = Callable[..., None] | bool | None
#: Seconds between two updates of a bar, and between two lines elsewhere.
BAR_INTERVAL_S = 0.2
LINE_INTERVAL_S = 10.0


def listener(progress: Listener) -> Callable[..., None]:
    """Return what receives the progress of a study.

    Parameters
    ----------
    progress : callable, bool or None
        A callback as it is; None: a bar, in a notebook only; True: a bar, and outside notebooks a
        line every ten seconds; False: nothing.
    """
    if callable(progress):
        return progress
    if progress or (progress is None and in_notebook()):
        return ProgressBar()
    return lambda *event: None


def in_notebook() -> bool:
    """Return whether a kernel of IPython shows what is displayed."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return hasattr(shell, "kernel")


class Count:
    """Hold how many of what has ended, what runs, and the time left; a subclass's `show` shows it.

    Parameters
    ----------
    counted : str
        What is counted, such as "starts".
    total : int
        How many there are in one count, 0 where that is not known. Each fit of several that are
        made in turn begins to count again at it.
    """

    def __init__(self, counted: str = "", total: int = 0) -> None:
        self.initial_total = total
        self.words = ""
        self.analyses = 0
        self.begin(counted, total)

    def begin(self, counted: str, total: int) -> None:
        """Begin a new count: objectives of another mesh are another sum."""
        self.counted = counted
        self.total = total
        self.done_earlier = 0
        self.done: float = 0
        self.best: float | None = None
        #: The start that last had an analysis, and what that left of the objective.
        self.under_way: tuple[int, float | None] | None = None
        self.start_time = time.monotonic()

    def __call__(self, *event: Any) -> None:
        """Take in what a command reports, and show it.

        Parameters
        ----------
        event
            The count, the total and the words of a study; or the name of a fit that begins; or an
            event, known by the name of its class; or None: time passes.
        """
        if len(event) == 3:
            self.done, self.total = event[:2]
            self.words = event[2] or self.words
        elif isinstance(event[0], str):
            self.begin(self.counted, self.initial_total)
            self.words = event[0]
        else:
            receivers = {
                "Stage": self.begin_stage,
                "EvaluationRecord": self.count_evaluation,
                "StartRecord": self.count_start,
                "Step": self.take_increment,
                "RunEvent": self.count_prediction,
            }
            receive = receivers.get(type(event[0]).__name__)
            if receive is not None:
                receive(event[0])
        self.show()

    def begin_stage(self, stage: Any) -> None:
        """Begin to count a stage of a fit, a `Stage`."""
        self.begin(stage.counted, stage.total)

    def count_evaluation(self, record: Any) -> None:
        """Count an analysis of a fit, an `EvaluationRecord`."""
        self.analyses += 1
        self.under_way = record.start, record.objective

    def count_start(self, record: Any) -> None:
        """Count a start that ended, a `StartRecord`."""
        self.done = self.done + 1
        self.under_way = None
        if record.objective is not None:
            earlier = () if self.best is None else (self.best,)
            self.best = min([record.objective, *earlier])

    def take_increment(self, step: Any) -> None:
        """Count an increment of an analysis, a `Step`."""
        if step.done == 0:
            self.begin("increments", step.increments)
        self.done = step.done
        self.words = f"analysis {step.analysis} of {step.analyses}, {step.part}"

    def count_prediction(self, event: Any) -> None:
        """Count a prediction that ended, or those to come: a `RunEvent`."""
        self.done = event.done
        self.total = event.total
        self.done_earlier += event.from_folder
        if event.run is not None:
            record = event.run.record
            end = "ended early" if record.early else "finished"
            if record.failure:
                end = f"failed ({record.failure})"
            self.words = f"last: {event.run.title}: {end} in {record.seconds:.0f} s"

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
        time_left = "time left not known yet"
        done_in_run = self.done - self.done_earlier
        if done_in_run > 0:
            seconds_per_unit = (time.monotonic() - self.start_time) / done_in_run
            time_left = f"{seconds_per_unit * (self.total - self.done):.0f} s left"
        return ", ".join([*parts, time_left])

    @property
    def line(self) -> str:
        """Return the count with its note."""
        count = ""
        if self.total:
            count = f"{self.done:g} of {self.total} {self.counted}".rstrip() + ", "
        return f"{count}{self.note}"


class ProgressBar(Count):
    """A bar in a notebook that is updated in place; a line now and then elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self._last_time = 0.0
        self._handle: Any = None

    def show(self) -> None:
        """Show the line, unless it was shown a moment ago and there is more to come."""
        is_notebook = in_notebook()
        current_time = time.monotonic()
        is_last = self.total > 0 and self.done >= self.total
        interval = BAR_INTERVAL_S if is_notebook else LINE_INTERVAL_S
        if current_time - self._last_time < interval and not is_last:
            return
        self._last_time = current_time
        if not is_notebook:
            print(self.line, file=sys.stderr, flush=True)
            return
        bar = f"<progress value={self.done:g} max={max(self.total, 1)}></progress> "
        formats = {"text/plain": self.line, "text/html": bar + escape(self.line)}
        if self._handle is None:
            display = sys.modules["IPython"].display
            self._handle = display.display(formats, raw=True, display_id=True)
        else:
            self._handle.update(formats, raw=True)


@contextmanager
def timed(part: str) -> Iterator[None]:
    """Log the seconds of a part of a command."""
    start_time = time.perf_counter()
    yield
    logging.getLogger(__name__).info("%s: %.2f s", part, time.perf_counter() - start_time)
