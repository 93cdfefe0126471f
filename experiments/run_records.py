"""Records of runs with cards, and notes on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..materials.card import MaterialCard, thickness_difference
from ..notes import Note, NoteKind, Objection, as_note
from ..solvers.base import Array, History, instability
from .strains import notes_beyond, strains_of

UNSTABLE = NoteKind(
    "unstable",
    weight=12.5,
    mark=3,
    objection=Objection(
        "equilibria of the model are unstable", "leave the unstable loads out of the fit"
    ),
)
THICKNESS = NoteKind("other thickness")


@dataclass(frozen=True, eq=False)
class RunRecord:
    """The end of a run of one test with one card, as it is stored.

    Parameters
    ----------
    seconds : float
        Wall clock, when it was made.
    failure : str
        Why there is no result, "" where there is one.
    early : str
        The solver's reason for an end before the last frame, "" otherwise.
    strain : (3,) array, optional
        Largest (eps1, eps2, gamma12).
    arrays : mapping of str to array
        What the kind of test keeps of the history.
    iterations, unstable, remarks
        As the solver has them.
    from_cache : bool
        Whether it was made earlier and is a cached run.
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


def unstable_words(unstable: Sequence[str] | None) -> list[Note]:
    """Note that equilibria at these loads (in words) are unstable, where there are any."""
    words = instability(unstable)
    return [Note(UNSTABLE, f"{words}: the model would not stay there")] if words else []


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """Note that a card that was run is of another thickness than the fabric's (mm), where it is."""
    words = thickness_difference(card, thickness)
    run = f"{words}; it was run with the card's thickness"
    return [] if words is None else [Note(THICKNESS, run)]


def notes_of(run: History | RunRecord, card: MaterialCard) -> list[Note]:
    """Return all notes on an analysis with a card, or on the record of one."""
    strain = strains_of(run) if isinstance(run, History) else run.strain
    reached = [] if strain is None else notes_beyond(strain, card.law.strain_range)
    return [*map(as_note, run.remarks), *reached, *unstable_words(run.unstable)]
