"""What a fit logs of its analyses and starts as they end: told by --verbose."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ..experiments.predicted import RunRecord
from .start import EvaluationRecord, StartRecord

log = logging.getLogger(__name__)


def log_record(record: EvaluationRecord | StartRecord | None) -> None:
    """An analysis, or how a start ended; nothing where only time has passed."""
    if isinstance(record, EvaluationRecord):
        left = "failed" if record.objective is None else f"objective {record.objective:.6g}"
        coarse = ", coarse mesh" if record.mesh == "coarse" else ""
        log.info(
            "start %d, analysis %d by %s%s: %s, %s",
            record.start, record.analysis, record.solver, coarse, left, record.status,
        )  # fmt: skip
    elif isinstance(record, StartRecord):
        left = "no fit" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d ended: %s, %s; %d analyses in %.2f s",
            record.number, record.status, left, record.analyses, record.wall_s,
        )  # fmt: skip


def log_run(title: str, record: RunRecord, again: bool) -> None:
    """A prediction: how it ended, or that the folder held it."""
    how = record.failure or (f"stopped early, {record.early}" if record.early else "finished")
    log.info("%s: %s; %.2f s%s", title, how, record.seconds, ", kept from before" * again)


@contextmanager
def timed(what: str) -> Iterator[None]:
    """Log how long a part of a command took."""
    begun = time.perf_counter()
    yield
    log.info("%s: %.2f s", what, time.perf_counter() - begun)
