"""Notes of analyses: what solvers say, strains beyond a range, equilibria that no test shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..materials.card import MaterialCard, thickness_difference
from ..notes import Note, NoteKind, as_note
from ..solvers.base import History, instability
from .predicted import RunRecord

Array = NDArray[np.float64]

#: Strain components by name, in the order (eps1, eps2, gamma12).
STRAINS = ("warp", "fill", "shear")
#: A strain this far beyond an end, relative, is no rounding.
BEYOND = 1 + 1e-6


def unstable_words(unstable: Sequence[str] | None) -> list[Note]:
    """That equilibria at these loads (in words) are unstable, where there are any."""
    words = instability(unstable)
    return [Note(NoteKind.UNSTABLE, f"{words}: the model would not stay there")] if words else []


def strains_of(history: History) -> Array:
    """(3,) largest warp, fill and (either way) shear strain of an analysis."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Three values by the name of their strain component."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


def beyond(reached: Array, ends: Array) -> list[tuple[str, float, float]]:
    """Name, strain and end of each strain of `reached` (3,) that is beyond its end of `ends`."""
    return [
        (name, float(s), float(end))
        for name, s, end in zip(STRAINS, reached, ends, strict=True)
        if s > end * BEYOND
    ]


def beyond_card(reached: Array, card: MaterialCard) -> list[Note]:
    """Where strains (3,) leave the range that a card is valid for."""
    return [
        Note(
            NoteKind.BEYOND_CARD,
            f"{name} strain {s:.3f} is beyond the card's valid range {end:.3f}: modulus held there",
        )
        for name, s, end in beyond(reached, card.law.strain_range)
    ]


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """That a card that was run is of another thickness than the fabric's (mm), where it is."""
    words = thickness_difference(card, thickness)
    if words is None:
        return []
    return [Note(NoteKind.THICKNESS, f"{words}; it was run with the card's thickness")]


def beyond_range(reached: Array, ends: Array) -> list[Note]:
    """Where strains (3,) of a fitted test leave the range that its law was given."""
    return [
        Note(
            NoteKind.BEYOND_LAW,
            f"{name} strain reached {s:.3f}, beyond law.strain_range {end:.4g}: the modulus was "
            "held at its end value there; a wider range would let it vary",
        )
        for name, s, end in beyond(reached, ends)
    ]


def notes_of(history: History, card: MaterialCard) -> list[Note]:
    """Everything to know of an analysis with a card."""
    return _notes(history.remarks, strains_of(history), history.unstable, card)


def notes_of_record(record: RunRecord, card: MaterialCard) -> list[Note]:
    """The same of a run that is stored; nothing of one that failed, but its failure."""
    reached = np.zeros(3) if record.strain is None else record.strain
    return _notes(record.remarks, reached, record.unstable, card)


def _notes(
    remarks: Sequence[str], reached: Array, unstable: Sequence[str] | None, card: MaterialCard
) -> list[Note]:
    return [*map(as_note, remarks), *beyond_card(reached, card), *unstable_words(unstable)]
