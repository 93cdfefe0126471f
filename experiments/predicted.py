"""What tests have that cards predict: runs, outcomes and what a kind says of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..errors import SolverFailure
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..notes import Note, as_note
from ..solvers.base import Array, History
from .run_records import RunRecord
from .sampling import Around

if TYPE_CHECKING:
    from ..solvers.base import BandEnd


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One test with one card: the model, how its run ended, and notes on it.

    Parameters
    ----------
    test : Test
    card : str
        Name of the card.
    material : MaterialCard
    model
    record : RunRecord
    notes : sequence of Note
    end : BandEnd, optional
        Of the band that the solver gives for the model; None where it has one answer.
    around : Around, optional
        Runs with laws around the card's.
    """

    test: Any
    card: str
    material: MaterialCard
    model: Any
    record: RunRecord
    notes: Sequence[Note] = ()
    end: BandEnd | None = None
    around: Around | None = None

    @property
    def wall(self) -> str:
        """Return the name of the wall that was run, "" where the solver has one answer."""
        return "" if self.end is None else self.end.name

    @property
    def predicted(self) -> bool:
        """Return whether the solver predicts it, not only as the other end of its band."""
        return self.end is None or self.end.predicted

    @property
    def title(self) -> str:
        """Return test and card; and the wall where it is the other end of a band."""
        of = f"{self.test.name} with {self.card}"
        return of if self.predicted else f"{of}, {self.wall}"


def band_of(runs: Iterable[PredictedRun]) -> list[BandEnd]:
    """Return the ends of the band that the solver gave, the prediction first; empty without one."""
    ends = [run.end for run in runs if run.end is not None]
    return list({end.name: end for end in ends}.values())


class Predicted(Protocol):
    """The protocol of a kind of test that is predicted with cards, not fitted."""

    def depends_on(self, model: Any) -> Sequence[object]:
        """Return all of a model that its result depends on: numbers, words, arrays, dataclasses."""

    def arrays(self, model: Any, history: History) -> Mapping[str, Array]:
        """Return the arrays of a history that are kept; raises SolverFailure if they do not fit."""

    def measured(self, test: Any) -> bool:
        """Return whether a test has anything measured to compare runs with."""

    def outcome(self, runs: Sequence[PredictedRun]) -> PredictedOutcome:
        """Return the outcome of runs of tests of this kind, in the order given."""


class PredictedOutcome(Protocol):
    """The outcome of runs of one kind of test, numbered in the order given."""

    def ended(self, number: int) -> str:
        """Describe the end of a run: "finished", how far it came, or why it failed."""

    def error(self, number: int) -> float | None:
        """Return RMS of model less measured over the largest measured value, if measured."""

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Return the entries of result.json on a run that did not fail."""

    def columns(self, number: int) -> Mapping[str, object]:
        """Return the same as one row of a table by names of columns, with units."""

    def curve(self, number: int) -> pd.DataFrame:
        """Return the curve frame by frame; no rows where the run failed."""

    def test_numbers(self, test: Any) -> Mapping[str, Any]:
        """Return the entries of result.json on a test."""

    def lines(self) -> Sequence[str]:
        """Return a table for the terminal."""


def record_of(
    kind: Predicted, model: Any, outcome: History | SolverFailure, seconds: float = 0.0
) -> RunRecord:
    """Return the record of a run that ended, well or not; a history without a result failed."""
    if isinstance(outcome, History):
        try:
            return RunRecord(
                seconds if outcome.seconds is None else outcome.seconds,
                early=outcome.early,
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
