"""Tests that material cards predict: their runs, outcomes, and laws around a card for the spread.

Such a test is not fitted; its analyses with cards are compared with what was measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from ..errors import SolverFailure
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..materials.admissibility import is_positive
from ..materials.card import MaterialCard
from ..notes import Note, as_note
from ..solvers.base import Array, History
from .forward import RunRecord, strains_of

if TYPE_CHECKING:
    from ..materials.law import HypoelasticLaw
    from ..solvers.base import BandEnd


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


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card, which give the spread of what the card predicts.

    Parameters
    ----------
    by : "directions" or "samples"
        How the laws were chosen: "directions" steps along independent directions of the
        coefficients, from which the spread follows to first order; "samples" draws laws at random
        from the card's certainty.
    steps : sequence of float
        Length of each step in standard deviations; 1 for each law that is drawn.
    records : sequence of RunRecord
        The runs, in the order of the steps.
    """

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def words(self) -> str:
        """Describe how many runs there were, of what, and how many failed."""
        failed = sum(bool(record.failure) for record in self.records)
        failures = f", {failed} failed" if failed else ""
        laws = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {laws}{failures}"

    def sigma(self, card_curve: Array, run_curves: Sequence[Array | None]) -> Array:
        """Return one standard deviation of a predicted curve at each frame.

        Parameters
        ----------
        card_curve : (frames,) array
            The curve computed with the card itself.
        run_curves : sequence of (frames,) array or None
            The curves computed with the laws around it, in the order of `steps`: None for a run
            that failed, shorter for one that ended early.

        Returns
        -------
        (frames,) array
            In the unit of the curve; NaN where too few runs reached the frame.
        """
        curves = [curve for curve in run_curves if curve is not None]
        sigma = np.full(len(card_curve), np.nan)
        needed = max(1, len(run_curves)) if self.by == "directions" else 2
        if len(curves) < needed:
            return sigma
        end = min(len(card_curve), *(len(curve) for curve in curves))
        values = np.array([curve[:end] for curve in curves])
        if self.by == "samples":
            sigma[:end] = values.std(axis=0, ddof=1)
        else:
            steps = np.array(self.steps)[:, None]
            sigma[:end] = np.sqrt((((values - card_curve[:end]) / steps) ** 2).sum(axis=0))
        return sigma


@dataclass(frozen=True)
class DirectionSteps:
    """Steps from a card's law along the independent directions of its coefficients' covariance."""

    #: Number of directions, the least certain first: others hardly move the moduli, and each costs
    #: a run.
    directions: int = 4
    #: Steps to try, in standard deviations: the first at which all moduli are positive is taken.
    steps: tuple[float, ...] = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)


DIRECTION_STEPS = DirectionSteps()


#: Laws drawn by default where a card has draws, which no directions describe.
LAWS_OF_DRAWS = 10


def laws_around(
    card: MaterialCard, samples: int | None, seed: int = 0
) -> tuple[Around | None, Sequence[HypoelasticLaw]]:
    """Choose the laws around a card's own that are to be run.

    Parameters
    ----------
    card : MaterialCard
    samples : int, optional
        Number of laws to draw at random; None for steps along the least certain directions, or for
        `LAWS_OF_DRAWS` of a card with draws; 0 for no laws.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    around : Around, optional
        How the laws were chosen, without records; None where the card has no certainty or no laws
        are asked for.
    laws : sequence of HypoelasticLaw
        The laws, in the order of `around.steps`.

    Raises
    ------
    ValueError
        No law with positive moduli is found in some direction, or hardly any can be drawn.
    """
    certainty = card.certainty
    if certainty is None or samples == 0:
        return None, ()
    if samples is None and certainty.draws is not None:
        samples = LAWS_OF_DRAWS
    if samples is not None:
        laws = certainty.laws(card.law, samples, np.random.default_rng(seed))
        return Around("samples", [1.0] * samples), laws
    steps = []
    laws_of_steps = []
    for direction in np.eye(len(certainty.directions))[: DIRECTION_STEPS.directions]:
        for step in DIRECTION_STEPS.steps:
            law = certainty.shifted(card.law, step * direction)
            if is_positive(law):
                break
        else:
            raise ValueError("a modulus is not positive next to the card's own law")
        steps.append(step)
        laws_of_steps.append(law)
    return Around("directions", steps), laws_of_steps


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
