"""Notes: remarks on a result, each of a kind, presented alike by every command.

Any module makes a `Note` of a `NoteKind`; commands collect them and present them by the functions
here: `line` by line on the terminal and on the page, `rows` in result.json, and
notes.csv (`write_notes`). A run is marked in its tables by the kinds of its notes (`marks`).
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from enum import StrEnum
from pathlib import Path

from .files import replacing

#: The table of the notes in an output folder, and its description on a page.
NOTES = "notes.csv"
NOTES_ARE = "what a reader of the numbers should know, note by note"
#: Up to so many notes that differ in numbers only are printed one by one on the terminal.
FEW = 3
#: A number, or several in a row: they differ between notes of the same words.
NUMBERS = re.compile(r"[-+]?\d[\d.e+-]*(, [-+]?\d[\d.e+-]*)*")


class NoteKind(StrEnum):
    """Name a kind of note by the words that tables and result.json have for it.

    The list is open: `NoteKind("creep")` is a kind of its own, which a solver or a reader of
    another distribution declares where it says such notes.
    """

    #: Of an analysis, by its solver.
    EARLY = "stopped early"
    SNAP = "snap"
    PENETRATION = "penetration"
    WRINKLES = "wrinkle stiffness"
    GAS = "gas"
    TILT = "tilted sheet"
    REPEATED = "repeated increments"
    UNCONFIRMED = "unconfirmed"
    UNBALANCED = "unbalanced forces"
    NO_REACTIONS = "no reactions"
    #: Of a solver of another distribution.
    SOLVER = "of the solver"
    #: Of an analysis with a card.
    BEYOND_CARD = "beyond card range"
    UNSTABLE = "unstable"
    THICKNESS = "other thickness"
    FAILED = "failed"
    #: Of a fit and its data.
    BEYOND_LAW = "beyond law.strain_range"
    STARTS = "starts that failed"
    UNCERTAIN = "uncertain"
    MESH = "mesh error"
    TAKEN_OUT = "mesh error taken out"
    MARGIN = "on its margin"
    BOUND = "on a bound"
    ALONE = "undetermined alone"
    INVERSE_CRIME = "inverse crime"
    ABOVE_NOISE = "above the noise"
    BELOW_NOISE = "below the noise"
    SECOND_ORDER = "second order"
    NOT_THE_CARD = "not where the card is"
    NOT_CLOSED = "profile not closed"
    FEW_UNITS = "few to draw from"
    DISCREPANCY = "wrong form"
    SURFACES = "unfaithful surfaces"
    FLAT_SHEET = "sheet taken for flat"
    UNMATCHED = "unmatched direction"
    LEFT_OUT = "points left out"
    DOUBTFUL = "doubtful data"
    READING = "how a file was read"
    FOLD = "fold without an error"
    #: Of a virtual strain gauge.
    LOST = "correlation lost"
    ORDER = "order of frames"
    NO_LOAD = "frames without load"
    #: Of an export: what the other program makes of a card.
    LOSES = "loses"
    CONFIRM = "to confirm"

    @classmethod
    def _missing_(cls, value: object) -> NoteKind | None:
        """Return a kind that is not in the list above; None where it is no words."""
        if not (isinstance(value, str) and value.strip()):
            return None
        kind = str.__new__(cls, value)
        kind._name_ = kind._value_ = value
        return kind


#: A run that has a note of these kinds is marked in the tables of runs.
MARKS = (NoteKind.BEYOND_CARD, NoteKind.SNAP, NoteKind.UNSTABLE, NoteKind.EARLY)

#: Order of the one note that a fit prints: wrong moduli first, then unsure ones, then its course.
GRAVEST = (
    NoteKind.DISCREPANCY,
    NoteKind.UNSTABLE,
    NoteKind.ABOVE_NOISE,
    NoteKind.DOUBTFUL,
    NoteKind.FLAT_SHEET,
    NoteKind.SURFACES,
    NoteKind.UNMATCHED,
    NoteKind.BEYOND_LAW,
    NoteKind.BOUND,
    NoteKind.UNCERTAIN,
    NoteKind.MESH,
    NoteKind.INVERSE_CRIME,
    NoteKind.MARGIN,
    NoteKind.STARTS,
    NoteKind.ALONE,
)


class Note(str):
    """Hold a sentence, its kind, and what it is about ("" : everything)."""

    kind: NoteKind
    of: str

    def __new__(cls, kind: NoteKind, words: str, of: str = "") -> Note:
        note = super().__new__(cls, words)
        note.kind, note.of = kind, of
        return note

    def __getnewargs__(self) -> tuple[NoteKind, str, str]:  # type: ignore[override]
        """Return the arguments that restore the note in another process."""
        return self.kind, str(self), self.of

    def about(self, name: str) -> Note:
        """Return the note about `name`, or about a part of `name`."""
        return Note(self.kind, str(self), f"{name}, {self.of}" if self.of else name)

    @property
    def line(self) -> str:
        """Return the sentence with what it is about."""
        return f"{self.of}: {self}" if self.of else str(self)


def as_note(words: str) -> Note:
    """Return a note as it is, and plain words of solvers of other distributions as a note."""
    return words if isinstance(words, Note) else Note(NoteKind.SOLVER, words)


def marks(notes: Iterable[str]) -> list[str]:
    """Return the marks of a run in a table of runs, from its notes."""
    kinds = {as_note(note).kind for note in notes}
    return [kind.value for kind in MARKS if kind in kinds]


def foremost(notes: Iterable[Note]) -> Note | None:
    """Return the gravest note, the first of its kind; None where there is none."""
    rank = {kind: place for place, kind in enumerate(GRAVEST)}
    return min(notes, key=lambda note: rank.get(note.kind, len(rank)), default=None)


def rows(notes: Iterable[Note]) -> list[dict[str, str]]:
    """Return the notes as plain values, for result.json and tables."""
    return [{"of": note.of, "kind": note.kind.value, "note": str(note)} for note in notes]


def lines(notes: Sequence[Note]) -> list[str]:
    """Return the notes as lines for the terminal.

    Notes that more than a few things share but for their numbers are one line; notes.csv has each.
    """
    alike: dict[tuple[NoteKind, str], list[Note]] = {}
    for note in notes:
        alike.setdefault((note.kind, NUMBERS.sub("#", note)), []).append(note)
    said = []
    for same in alike.values():
        if len(same) <= FEW:
            said += [f"note: {note.line}" for note in same]
        else:
            said.append(f"note, {len(same)} times ({NOTES} has each), as {same[0].line}")
    return said


def write_notes(folder: Path, notes: Iterable[Note]) -> None:
    """Write notes.csv: of, kind, note; a header alone where there is nothing to say.

    Raises
    ------
    OutputError : it cannot be written.
    """
    with replacing(folder / NOTES) as path, open(path, "w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, ["of", "kind", "note"], lineterminator="\n")
        table.writeheader()
        table.writerows(rows(notes))


def percent(value: float) -> str:
    """Return a fraction as percent with two significant digits, whole from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"
