"""Kinds of test that are predicted with cards: what is run, what is kept of it, what it says."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..notes import Note
from .exhibit import Exhibit, Output

if TYPE_CHECKING:
    import pandas as pd

    from ..materials.card import MaterialCard
    from ..solvers.base import BandEnd, History
    from .spread import Around

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RunRecord:
    """How a run of one test with one card ended, as it is stored.

    seconds : wall clock, of when it was made. failure : why there is no result, "" where there is
    one; early : the solver's own word for why it could go no further than it did, "" where it came
    to the end. strain : (3,) largest (eps1, eps2, gamma12). arrays : what the kind of test keeps of
    the history. iterations, unstable, remarks : as the solver says them. from_cache : it was made
    earlier and taken from the cache of runs.
    """

    seconds: float
    failure: str = ""
    early: str = ""
    strain: Array | None = None
    arrays: Mapping[str, Array] = field(default_factory=dict)
    iterations: int = 0
    unstable: tuple[str, ...] | None = None
    remarks: tuple[Note, ...] = ()
    from_cache: bool = False


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One test with one card: what was run, how it ended, what a reader should know of it.

    end : of the band that the solver gives for the model, None where it has one answer. around :
    runs with laws around the card's, None where there are none.
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
        """Name of the wall that was run, "" where the solver has one answer."""
        return "" if self.end is None else self.end.name

    @property
    def predicted(self) -> bool:
        """Whether it is what the solver predicts, not only the other end of its band."""
        return self.end is None or self.end.predicted

    @property
    def title(self) -> str:
        """Test and card; and the wall where it is the other end of a band."""
        of = f"{self.test.name} with {self.card}"
        return of if self.predicted else f"{of}, {self.wall}"


def band_of(runs: Iterable[PredictedRun]) -> list[BandEnd]:
    """The ends of the band that the solver gave, first what is predicted; empty without one."""
    ends = [run.end for run in runs if run.end is not None]
    return list({end.name: end for end in ends}.values())


class Predicted(Protocol):
    """What a kind of test offers whose tests are predicted with cards, not fitted."""

    def depends_on(self, model: Any) -> Sequence[object]:
        """All of a model that its result depends on: numbers, words, arrays, dataclasses."""

    def arrays(self, model: Any, history: History) -> Mapping[str, Array]:
        """What is kept of a history, for everything that is told of it later.

        Raises
        ------
        SolverFailure : the history is not what the model asks for.
        """

    def early(self, model: Any, history: History) -> str:
        """The solver's own word for an end before the last frame, "" where it came so far."""

    def measured(self, test: Any) -> bool:
        """Whether a test has anything measured to compare runs with."""

    def outcome(self, runs: Sequence[PredictedRun]) -> PredictedOutcome:
        """What runs of tests of this kind say, in the order given."""


class PredictedOutcome(Protocol):
    """What runs of one kind of test say; runs are named by their number in the order given."""

    def ended(self, number: int) -> str:
        """Whether a run came to its end ("finished"), how far it came, or why it failed."""

    def error(self, number: int) -> float | None:
        """RMS of model less measured over the largest measured value; None where there is none."""

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Of a run that did not fail, for result.json."""

    def columns(self, number: int) -> Mapping[str, object]:
        """The same as one row of a table: by the names of the columns, units in the names."""

    def curve(self, number: int) -> pd.DataFrame:
        """Frame by frame; no rows where the run failed."""

    def test_numbers(self, test: Any) -> Mapping[str, Any]:
        """What a test is, for result.json."""

    def lines(self) -> Sequence[str]:
        """A table for the terminal."""

    def show(self, out: Output) -> Exhibit:
        """Write figures, tables and files of the runs."""
