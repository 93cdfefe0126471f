"""Laws sampled around a material card's own, to propagate its uncertainty to predicted curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..light_dataclasses import dataclass
from ..materials.admissibility import is_positive
from ..materials.card import MaterialCard
from ..solvers.base import Array
from .run_records import RunRecord

if TYPE_CHECKING:
    from ..materials.law import HypoelasticLaw


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
