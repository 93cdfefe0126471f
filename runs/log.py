"""Logging of runs: analyses, starts and predictions as they end, and the time of each part."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ..experiments.run_records import RunRecord
from .starts import EvaluationRecord, Event, StartRecord

log = logging.getLogger(__name__)


def log_record(record: Event | None) -> None:
    """Log an analysis or the end of a start; nothing for None."""
    if isinstance(record, EvaluationRecord):
        result = "failed" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d, analysis %d by %s%s: %s, %s",
            record.start,
            record.analysis,
            record.solver,
            ", coarse mesh" if record.mesh == "coarse" else "",
            result,
            record.status,
        )
    elif isinstance(record, StartRecord):
        result = "no fit" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d ended: %s, %s; %d analyses in %.2f s",
            record.number,
            record.status,
            result,
            record.analyses,
            record.wall_s,
        )


def log_run(title: str, record: RunRecord, is_kept: bool) -> None:
    """Log the end of a prediction, or that the folder held it."""
    end = record.failure or (f"stopped early, {record.early}" if record.early else "finished")
    log.info("%s: %s; %.2f s%s", title, end, record.seconds, ", kept from before" * is_kept)


@contextmanager
def timed(part: str) -> Iterator[None]:
    """Log the seconds of a part of a command."""
    start_time = time.perf_counter()
    yield
    log.info("%s: %.2f s", part, time.perf_counter() - start_time)
