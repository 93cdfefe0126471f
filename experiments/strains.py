"""Largest strains that an analysis reaches, and notes on those beyond the range of a law."""

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
    """Return the largest strains (3,) of an analysis: in warp, in fill, and in shear (absolute)."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Return three values (warp, fill, shear) by the names of their strain components."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


#: Texts of notes on a strain beyond the range: of a card that was run, of a law that was fitted.
BEYOND_CARD_WORDS = "{} strain {} % is beyond the card's valid range of {} %: modulus held there"
BEYOND_LAW_WORDS = (
    "{} strain reached {} %, beyond law.strain_range of {} %: the modulus was held at its end "
    "value there; a wider range would let it vary"
)


def notes_beyond(
    reached: Array, ends: Array, kind: NoteKind = BEYOND_CARD, words: str = BEYOND_CARD_WORDS
) -> list[Note]:
    """Note each strain that lies beyond the end of its range.

    Parameters
    ----------
    reached : (3,) array
        Largest strains in warp, fill and shear.
    ends : (3,) array
        Ends of their ranges.
    kind : NoteKind
        Kind of the notes.
    words : str
        Text of a note, with fields {} for the name of the strain, the strain and the end in %.
    """
    rounding = 1 + 1e-6
    return [
        Note(kind, words.format(name, *distinct_numbers(100 * strain, 100 * end)))
        for name, strain, end in zip(STRAINS, reached, ends, strict=True)
        if strain > end * rounding
    ]
