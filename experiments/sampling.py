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
#: Number of a card's directions, least certain first, that are run unless laws are drawn: others
#: hardly move the moduli, and each costs as much as the prediction itself.
DIRECTIONS = 4
#: Standard deviations of a step along a direction; the next where a modulus would not be positive.
STEPS = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)
SEED = 0


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card.
    by : "directions": steps along independent directions, `steps` standard deviations each, from
    which the spread follows to first order; "samples": laws drawn from the card's certainty."""

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def words(self) -> str:
        """Describe the runs."""
        failed = sum(bool(record.failure) for record in self.records)
        lost = f", {failed} failed" if failed else ""
        along = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {along}{lost}"

    def sigma(self, own: Array, others: Sequence[Array | None]) -> Array:
        """Return (frames,) one standard deviation of a curve; NaN where it is not known.
        own : (frames,) of the card itself. others : the same of the runs, None of one that failed,
        shorter of one that ended early."""
        reached = [curve for curve in others if curve is not None]
        whole = np.full(len(own), np.nan)
        least = max(1, len(others)) if self.by == "directions" else 2
        if len(reached) < least:
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
    """Return the laws to be run around a card's, and how; nothing where the card has no certainty.
    samples : number of laws to draw; None for the least certain directions, 0 for nothing. Raises
    ValueError where hardly any law that could be drawn has positive moduli."""
    sure = card.certainty
    if sure is None or samples == 0:
        return None, ()
    if samples is not None:
        laws = sure.laws(card.law, samples, np.random.default_rng(SEED))
        return Around("samples", [1.0] * samples), laws
    found = []
    for along in np.eye(len(sure.directions))[:DIRECTIONS]:
        tried = ((step, sure.shifted(card.law, step * along)) for step in STEPS)
        found.append(next((pair for pair in tried if is_positive(pair[1])), None))
    known = [pair for pair in found if pair is not None]
    if len(known) < len(found):
        raise ValueError("a modulus is not positive next to the card's own law")
    return Around("directions", [step for step, _ in known]), [law for _, law in known]
