"""Laws around that of a card, for the spread of what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..materials.card import MaterialCard
from ..materials.positivity import is_positive
from ..solvers.base import Array
from .run_records import RunRecord

if TYPE_CHECKING:
    from ..materials.law import HypoelasticLaw


@dataclass(frozen=True)
class DirectionSteps:
    """Laws around a card's along its independent directions."""

    directions: int = 4  # least certain first: others hardly move the moduli, and each costs a run
    #: Standard deviations; the next one is taken where a modulus would not be positive.
    steps: tuple[float, ...] = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)


DIRECTION_STEPS = DirectionSteps()


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card.

    Parameters
    ----------
    by : "directions" or "samples"
        Steps along independent directions, from which the spread follows to first order; or laws
        drawn from the card's certainty.
    steps : sequence of float
        Standard deviations of each step.
    records : sequence of RunRecord
        The runs, in the order of the steps.
    """

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def words(self) -> str:
        """Describe the runs."""
        failed = sum(bool(record.failure) for record in self.records)
        failures = f", {failed} failed" if failed else ""
        laws = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {laws}{failures}"

    def sigma(self, card_curve: Array, run_curves: Sequence[Array | None]) -> Array:
        """Return one standard deviation of a curve.

        Parameters
        ----------
        card_curve : (frames,) array
            With the card itself.
        run_curves : sequence of arrays
            With the laws around it: None of a run that failed, shorter if it ended early.

        Returns
        -------
        (frames,) array
            NaN where it is not known.
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


def laws_around(
    card: MaterialCard, samples: int | None, seed: int = 0
) -> tuple[Around | None, Sequence[HypoelasticLaw]]:
    """Return the laws to be run around a card's, and how they came about.

    Parameters
    ----------
    card : MaterialCard
    samples : int, optional
        Number of laws to draw; None for steps along the least certain directions, 0 for nothing.
    seed : int
        Of the laws that are drawn.

    Returns
    -------
    around : Around, optional
        None where the card has no certainty.
    laws : sequence of HypoelasticLaw

    Raises
    ------
    ValueError
        Hardly any law that could be drawn has positive moduli.
    """
    certainty = card.certainty
    if certainty is None or samples == 0:
        return None, ()
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
