"""How far a prediction spreads by what its card leaves open: runs with laws around the card's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from ..materials.certainty import positive

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..materials.law import HypoelasticLaw
    from .predicted import RunRecord

Array = NDArray[np.float64]

#: Of the directions that a card keeps, the least certain first, so many are run unless laws are
#: drawn: the others hardly move the moduli, and each costs as much as the prediction itself.
DIRECTIONS = 4
#: Standard deviations of a step along a direction; the next where a modulus would not be positive.
STEPS = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)
SEED = 0


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card.

    by : "directions": steps along independent directions, `steps` standard deviations each, from
    which the spread follows to first order; "samples": laws drawn from the card's certainty.
    """

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def failed(self) -> int:
        """How many of the runs failed."""
        return sum(bool(record.failure) for record in self.records)

    @property
    def words(self) -> str:
        """What was run."""
        lost = f", {self.failed} failed" if self.failed else ""
        along = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {along}{lost}"

    def sigma(self, own: Array, others: Sequence[Array | None]) -> Array:
        """(frames,) one standard deviation of a curve; NaN where it is not known.

        own : (frames,) of the card itself. others : the same of the runs, None of one that failed,
        shorter of one that ended early.
        """
        reached = [curve for curve in others if curve is not None]
        whole = np.full(len(own), np.nan)
        some = len(reached) == len(others) if self.by == "directions" else len(reached) > 1
        if not some or not reached:
            return whole
        end = min(len(own), *(len(curve) for curve in reached))
        curves = np.array([curve[:end] for curve in reached])
        if self.by == "samples":
            whole[:end] = curves.std(axis=0, ddof=1)
        else:
            steps = np.array(self.steps)[:, None]
            whole[:end] = np.sqrt((((curves - own[:end]) / steps) ** 2).sum(axis=0))
        return whole


def laws_around(
    card: MaterialCard, samples: int | None
) -> tuple[Around | None, Sequence[HypoelasticLaw]]:
    """The laws to be run around a card's, and how; nothing where the card is not said to be sure.

    samples : how many laws are drawn; None for the least certain directions, 0 for nothing.

    Raises
    ------
    ValueError : hardly any law that could be drawn has positive moduli.
    """
    sure = card.certainty
    if sure is None or samples == 0:
        return None, ()
    if samples is not None:
        laws = sure.laws(card.law, samples, np.random.default_rng(SEED))
        return Around("samples", [1.0] * samples), laws
    steps, laws = [], []
    for k in range(min(DIRECTIONS, len(sure.directions))):
        along = np.zeros(len(sure.directions))
        for step in STEPS:
            along[k] = step
            law = sure.shifted(card.law, along)
            if positive(law):
                break
        else:
            raise ValueError("a modulus is not positive next to the card's own law")
        steps.append(step)
        laws.append(law)
    return Around("directions", steps), laws
