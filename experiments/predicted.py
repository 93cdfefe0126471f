"""The protocol of kinds of test that material cards predict: their runs and their outcomes.

Such a test is not fitted; its analyses with cards are compared with what was measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import SolverFailure
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard
from ..notes import Note, as_note
from ..solvers.base import Array, History
from .run_records import RunRecord, strains_of
from .sampling import Around

if TYPE_CHECKING:
    from ..solvers.base import BandEnd


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """The analysis of one test with one card: the model, how its run ended, and notes on it.

    Parameters
    ----------
    test : Test
    card : str
        Name of the card.
    material : MaterialCard
        The card.
    model : object
        The model that was run, of the class that the kind's solver takes.
    record : RunRecord
        How the run ended.
    notes : sequence of Note
    end : BandEnd, optional
        The assumption on the wall with which the model was run, where the solver gives a band of
        answers between two of them; None where it gives one answer.
    around : Around, optional
        Runs with laws around the card's, for the uncertainty of the prediction.
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
        """Return the name of the assumed wall (the band's end), "" where there is one answer."""
        return "" if self.end is None else self.end.name

    @property
    def predicted(self) -> bool:
        """Return whether the run is the prediction, and not merely the other end of a band."""
        return self.end is None or self.end.predicted

    @property
    def title(self) -> str:
        """Return a title with the test, the card, and the wall where the run is no prediction."""
        of = f"{self.test.name} with {self.card}"
        return of if self.predicted else f"{of}, {self.wall}"


def band_of(runs: Iterable[PredictedRun]) -> list[BandEnd]:
    """Return the ends of the band that the solver gave, each once, the prediction first.

    The list is empty where the solver gave one answer.
    """
    ends = [run.end for run in runs if run.end is not None]
    return list({end.name: end for end in ends}.values())


class Predicted(Protocol):
    """Describe a kind of test that is predicted with cards, not fitted, to forward analyses."""

    def depends_on(self, model: Any) -> Sequence[object]:
        """Return everything in a model on which its result depends, to identify a cached run.

        Entries are numbers, strings, arrays or dataclasses.
        """

    def arrays(self, model: Any, history: History) -> Mapping[str, Array]:
        """Return the arrays of a history that its record keeps, by name.

        Raise SolverFailure if they do not fit the model.
        """

    def measured(self, test: Any) -> bool:
        """Return whether a test has measured values with which runs can be compared."""

    def outcome(self, runs: Sequence[PredictedRun]) -> PredictedOutcome:
        """Return the outcome of runs of tests of this kind, in the order given."""


class PredictedOutcome(Protocol):
    """The outcome of runs of one kind of test.

    Methods take the number of a run, from 0 in the order in which runs were given.
    """

    def ended(self, number: int) -> str:
        """Describe the end of a run: "finished", how far it came, or why it failed."""

    def error(self, number: int) -> float | None:
        """Return the RMS of model less measured values over the largest measured value.

        It is None where nothing is measured.
        """

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Return the entries of result.json on one run, which did not fail."""

    def columns(self, number: int) -> Mapping[str, object]:
        """Return the same as one row of a table, by names of columns that state the units."""

    def curve(self, number: int) -> pd.DataFrame:
        """Return the predicted curve with a row for each frame, without rows if the run failed."""

    def test_numbers(self, test: Any) -> Mapping[str, Any]:
        """Return the entries of result.json on a test."""

    def lines(self) -> Sequence[str]:
        """Return the lines of a table of all runs, for the terminal."""


def record_of(
    kind: Predicted,
    model: Any,
    outcome: History | SolverFailure,
    seconds: float = 0.0,
) -> RunRecord:
    """Return the record of a run that ended with a history or with a failure.

    A history whose arrays do not fit the model is recorded as a failure.

    Parameters
    ----------
    seconds : float
        Wall-clock time of the run, where the history does not have it.
    """
    if isinstance(outcome, History):
        try:
            return RunRecord(
                seconds if outcome.seconds is None else outcome.seconds,
                early=outcome.early,
                strain=strains_of(outcome),
                arrays=kind.arrays(model, outcome),
                iterations=outcome.iterations,
                unstable=outcome.unstable,
                remarks=tuple(map(as_note, outcome.remarks)),
                from_cache=outcome.from_cache,
            )
        except SolverFailure as failure:
            outcome = failure
    return RunRecord(seconds, outcome.line)
