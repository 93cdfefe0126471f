"""Strains that an analysis reaches, by name, and notes on those beyond a range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..notes import Note, NoteKind
from ..solvers.base import Array, History
from ..wording import distinct_numbers

BEYOND_CARD = NoteKind("beyond card range", mark=1)
BEYOND_LAW = NoteKind("beyond law.strain_range", weight=8)
#: Strain components by name, in the order (eps1, eps2, gamma12).
STRAINS = ("warp", "fill", "shear")


def strains_of(history: History) -> Array:
    """Return (3,) largest warp, fill and (either way) shear strain of an analysis."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Return three values by the name of their strain component."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


#: Notes on a strain beyond an end: of a card that was run, and of a test that was fitted.
BEYOND_CARD_WORDS = "{} strain {} % is beyond the card's valid range of {} %: modulus held there"
BEYOND_LAW_WORDS = (
    "{} strain reached {} %, beyond law.strain_range of {} %: the modulus was held at its end "
    "value there; a wider range would let it vary"
)


def notes_beyond(
    reached: Array, ends: Array, kind: NoteKind = BEYOND_CARD, words: str = BEYOND_CARD_WORDS
) -> list[Note]:
    """Note strains beyond their ends.

    Parameters
    ----------
    reached, ends : (3,) arrays
        Warp, fill and shear strain.
    kind : NoteKind
    words : str
        With places for name, strain and end in %.
    """
    rounding = 1 + 1e-6
    return [
        Note(kind, words.format(name, *distinct_numbers(100 * strain, 100 * end)))
        for name, strain, end in zip(STRAINS, reached, ends, strict=True)
        if strain > end * rounding
    ]
