"""What is kept of a run of one test with one card, whatever the kind of test."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import SolverFailure
from ..notes import as_note
from ..solvers.base import History
from .predicted import Predicted, RunRecord


def record_of(
    kind: Predicted, model: Any, outcome: History | SolverFailure, seconds: float = 0.0
) -> RunRecord:
    """The record of a run that ended, well or not.

    Whatever is no result is a failure: only the solver's own word for an end before the last frame
    makes one.
    """
    if isinstance(outcome, History):
        try:
            return RunRecord(
                seconds if outcome.seconds is None else outcome.seconds,
                early=kind.early(model, outcome),
                strain=np.maximum(np.abs(outcome.strain_min) * [0, 0, 1], outcome.strain_max),
                arrays=kind.arrays(model, outcome),
                iterations=outcome.iterations,
                unstable=outcome.unstable,
                remarks=tuple(map(as_note, outcome.remarks)),
                from_cache=outcome.from_cache,
            )
        except SolverFailure as failure:
            outcome = failure
    return RunRecord(seconds, outcome.line)
