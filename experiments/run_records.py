"""Records of how analyses with material cards ended, as they are stored, and notes on them."""

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
    """The outcome of an analysis of one test with one card, as it is stored.

    Parameters
    ----------
    seconds : float
        Wall-clock time that the analysis took when it was made.
    failure : str
        Why there is no result, "" where there is one.
    early : str
        The solver's reason for an end before the last frame, "" otherwise.
    strain : (3,) array, optional
        Largest strains (eps1, eps2, gamma12).
    arrays : mapping of str to array
        The arrays of the history that the kind of test keeps.
    iterations : int
        Number of iterations of the solver.
    unstable : tuple of str, optional
        Loads (in words) at which the equilibrium is unstable; None where that is not known.
    remarks : tuple of Note
        Notes of the solver.
    from_cache : bool
        Whether the result of an earlier, cached analysis was taken.
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
    """Note that equilibria at these loads (in words) are unstable; without loads, nothing."""
    words = instability(unstable)
    return [Note(UNSTABLE, f"{words}: the model would not stay there")] if words else []


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """Note that the thickness of a card that was run differs from the fabric's, if it does.

    thickness : of the fabric, mm
    """
    words = thickness_difference(card, thickness)
    run = f"{words}; it was run with the card's thickness"
    return [] if words is None else [Note(THICKNESS, run)]


def notes_of(run: History | RunRecord, card: MaterialCard) -> list[Note]:
    """Return all notes on an analysis with a card: remarks, strains beyond its range, instability.

    run : its history or its record
    """
    strain = strains_of(run) if isinstance(run, History) else run.strain
    reached = [] if strain is None else notes_beyond(strain, card.law.strain_range)
    return [*map(as_note, run.remarks), *reached, *unstable_words(run.unstable)]
