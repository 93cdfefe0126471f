"""Notes: remarks and warnings in words that accompany the numbers of a result.

Each `Note` is a sentence with a `NoteKind`, which the module that makes the note defines. Terminals
show notes by `note_lines`; files hold them by `note_records`.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Literal

from .light_dataclasses import dataclass
from .storage.writing import replacing

#: File name of the table of notes in an output folder, and its description on a page.
NOTES = "notes.csv"
NOTES_ARE = "what a reader of the numbers should know, note by note"
#: Weight from which a note is printed on the terminal, however many there are.
GRAVE = 10.0


@dataclass(frozen=True)
class Objection:
    """Hold a reason not to trust the moduli of a fit, which the verdict of the fit states.

    Attributes
    ----------
    reason : str
        Why the moduli are not to be trusted.
    advice : str
        What to do about it, in words that follow "Next:".
    unusable : bool
        Whether the moduli are not to be used at all.
    """

    reason: str
    advice: str
    unusable: bool = False


State = Literal["usable", "usable within limits", "not to be used"]


@dataclass(frozen=True)
class Verdict:
    """Hold the judgement of a result, as terminal, page and result.json state it.

    Attributes
    ----------
    state : str
        Whether the result can be used.
    sentence : str
        What the result comes to, without its full stop.
    reasons : tuple of str
        What speaks against the result, the gravest first.
    unknown : str
        What the result leaves unknown, "" for nothing.
    next_step : str
        What to do next, "" for nothing.
    """

    state: State
    sentence: str
    reasons: tuple[str, ...] = ()
    unknown: str = ""
    next_step: str = ""

    def of_study(self, fit: Verdict) -> Verdict:
        """Return the verdict of a study of a fit; it is not to be used where the fit is not."""
        if fit.state != "not to be used":
            return self
        reason = f"the fit is not to be used: {'; '.join(fit.reasons)}"
        return replace(
            self, state=fit.state, reasons=(reason, *self.reasons), next_step=fit.next_step
        )

    @property
    def title(self) -> str:
        """Return the state with a capital letter."""
        return self.state.capitalize()

    @property
    def details(self) -> list[tuple[str, str]]:
        """Return labels and sentences: what speaks against the result, is unknown, and is next."""
        reasons = "; ".join(self.reasons)
        if reasons == self.sentence:
            reasons = ""
        pairs = [("Against it", reasons), ("Not known", self.unknown), ("Next", self.next_step)]
        return [(label, f"{words}.") for label, words in pairs if words]

    @property
    def lines(self) -> list[str]:
        """Return the lines of the terminal: state and sentence, then the details."""
        details = [f"{label}: {words}" for label, words in self.details]
        return [f"{self.title}: {self.sentence}.", *details]

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the verdict as it is written to `result.json`."""
        return {
            "state": self.state,
            "sentence": self.sentence,
            "reasons": list(self.reasons),
            "not_known": self.unknown,
            "next": self.next_step,
        }


class NoteKind(str):
    """Name a kind of note by its words; two kinds of the same words are one object.

    Attributes
    ----------
    weight : float
        Severity, by which the notes of a fit are ordered. Below `GRAVE` = 10: remarks (from 2,
        those on data are warnings of a check). From it on, always printed: 10 to 14 doubts about
        data and analyses, 15 to 18 faults of the law (form, mesh, bounds), from 19 a fit that is
        not to be used.
    mark : int
        Position of this kind among the marks of a run in tables; 0 for a kind that is no mark.
    objection : Objection or None
        Why a note of this kind speaks against the moduli of a fit; None if it does not.
    registered : dict
        All kinds of this process by their words.
    """

    weight: float
    mark: int
    objection: Objection | None
    registered: ClassVar[dict[str, NoteKind]] = {}

    def __new__(
        cls, words: str, weight: float = 0.0, mark: int = 0, objection: Objection | None = None
    ) -> NoteKind:
        if not words.strip():
            raise ValueError("a kind of note is named by words")
        kind = cls.registered.setdefault(words, super().__new__(cls, words))
        kind.weight = max(weight, getattr(kind, "weight", 0.0))
        kind.mark = mark or getattr(kind, "mark", 0)
        kind.objection = objection or getattr(kind, "objection", None)
        return kind

    def __getnewargs__(self) -> tuple[str, float, int, Objection | None]:  # type: ignore[override]
        """Return the arguments that restore the kind in another process."""
        return str(self), self.weight, self.mark, self.objection


#: The kind of remarks that solvers make in plain words, such as those of plug-ins.
SOLVER = NoteKind("of the solver")


class Note(str):
    """Hold a sentence about a result.

    Attributes
    ----------
    kind : NoteKind
        Kind of note, with its severity.
    of : str
        Name of what the sentence is about, such as a test or a modulus; "" for the whole result.
    """

    kind: NoteKind
    of: str

    def __new__(cls, kind: NoteKind, words: str, of: str = "") -> Note:
        note = super().__new__(cls, words)
        note.kind = kind
        note.of = of
        return note

    def __getnewargs__(self) -> tuple[NoteKind, str, str]:  # type: ignore[override]
        """Return the arguments that restore the note in another process."""
        return self.kind, str(self), self.of

    def about(self, name: str) -> Note:
        """Return the note with `name` put before what it is about, as in "bubble, frame 3"."""
        return Note(self.kind, str(self), f"{name}, {self.of}" if self.of else name)

    @property
    def line(self) -> str:
        """Return the sentence with what it is about."""
        return f"{self.of}: {self}" if self.of else str(self)


def as_note(words: str) -> Note:
    """Return a note unchanged, and plain words of a solver as a note of the kind `SOLVER`."""
    return words if isinstance(words, Note) else Note(SOLVER, words)


def marks_of(notes: Iterable[str]) -> list[NoteKind]:
    """Return the kinds of a run's notes that a table of runs marks, in the order of their marks."""
    kinds = {as_note(note).kind for note in notes}
    return sorted((kind for kind in kinds if kind.mark), key=lambda kind: kind.mark)


def gravest_notes(notes: Iterable[Note]) -> list[Note]:
    """Return the notes of a weight of `GRAVE` or more, else the one of the largest weight."""
    ordered = sorted(notes, key=lambda note: -note.kind.weight)
    return [note for note in ordered if note.kind.weight >= GRAVE] or ordered[:1]


class BubblefitWarning(UserWarning):
    """A grave note of a result, for those who do not look at its notes."""


def warn_of(notes: Iterable[Note], stacklevel: int) -> None:
    """Give notes of a weight of `GRAVE` or more to `warnings.warn`.

    `stacklevel` : calls from here to the user's line.
    """
    for note in notes:
        if note.kind.weight >= GRAVE:
            warnings.warn(note.line, BubblefitWarning, stacklevel + 1)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore every BubblefitWarning within a `with` block, where notes are shown otherwise."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BubblefitWarning)
        yield


def note_records(notes: Iterable[Note]) -> list[dict[str, str]]:
    """Return the notes as plain values, for result.json and tables."""
    return [{"of": note.of, "kind": str(note.kind), "note": str(note)} for note in notes]


def note_lines(
    notes: Iterable[Note], begin: str = "note", *, printed_one_by_one: int = 3
) -> list[str]:
    """Return notes as lines for the terminal.

    Parameters
    ----------
    notes : iterable of Note
        The notes.
    begin : str
        First word of each line.
    printed_one_by_one : int
        Largest number of notes, alike but for their numbers, that get a line each; more of them
        share one line.
    """
    # A number, or several in a row.
    numbers = re.compile(r"[-+]?\d[\d.e+-]*(, [-+]?\d[\d.e+-]*)*")
    groups: dict[tuple[NoteKind, str], list[Note]] = {}
    for note in notes:
        groups.setdefault((note.kind, numbers.sub("#", note)), []).append(note)
    lines = []
    for group in groups.values():
        if len(group) <= printed_one_by_one:
            lines += [f"{begin}: {note.line}" for note in group]
        else:
            lines.append(f"{begin}, {len(group)} times ({NOTES} has each), as {group[0].line}")
    return lines


def joined_lines(notes: Iterable[Note]) -> list[str]:
    """Return notes as lines of a page, where notes of the same words share a line."""
    subjects: dict[str, list[str]] = {}
    for note in notes:
        subjects.setdefault(str(note), []).append(note.of)
    lines = []
    for words, names in subjects.items():
        named = "; ".join(filter(None, names))
        lines.append(f"{named}: {words}" if named else words)
    return lines


def write_notes(folder: Path, notes: Iterable[Note]) -> None:
    """Write notes.csv with the columns of, kind and note; raise OutputError if it cannot be."""
    with replacing(folder / NOTES) as path, open(path, "w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, ["of", "kind", "note"], lineterminator="\n")
        table.writeheader()
        table.writerows(note_records(notes))
