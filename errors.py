"""Errors and notes: what bubblefit says of its input and of its results.

An error is raised on purpose; its message says what to do next. A `Note` is a remark on a result,
of a `NoteKind` of the module that makes it: `lines` on the terminal, `rows` in files.
"""

from __future__ import annotations

import difflib
import functools
import inspect
import re
import types
import typing
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, ParamSpec, TypeVar

#: Letters of a field and of a message that are shown: a key may be as long as its file.
LONGEST, LONGEST_LINE = 200, 4000
#: Kinds of characters that would break a line, or steer a terminal.
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
#: The table of the notes in an output folder, and its description on a page.
NOTES = "notes.csv"
NOTES_ARE = "what a reader of the numbers should know, note by note"
#: Weight from which a note is printed on the terminal, however many there are.
GRAVE = 10.0
#: Up to so many notes that differ in numbers only are printed one by one on the terminal.
FEW = 3
#: A number, or several in a row: they differ between notes of the same words.
NUMBERS = re.compile(r"[-+]?\d[\d.e+-]*(, [-+]?\d[\d.e+-]*)*")


class BubblefitError(Exception):
    """Base of every deliberate error; `exit_code` is what the command line returns."""

    exit_code = 2


class InputError(BubblefitError):
    """An unusable input: its file or None; its key, column or line; what is wrong, what to do."""

    def __init__(self, path: Path | str | None, field: str, problem: str) -> None:
        self.path = path
        self.field = field
        self.problem = problem
        shown = field if len(field) <= LONGEST else f"{field[:LONGEST]}..."
        where = ": ".join(str(part) for part in (path, shown) if part)
        super().__init__(one_line(f"{where}: {problem}" if where else problem)[:LONGEST_LINE])

    def __reduce__(self) -> tuple:
        # Exceptions cross process borders: rebuild from the fields, not from the text.
        return type(self), (self.path, self.field, self.problem)


P = ParamSpec("P")
R = TypeVar("R")


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Check the arguments of every call against the annotations; InputError names the argument."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        expected = _annotations(function)
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in expected and not _fits(value, expected[name]):
                words = _annotation_words(expected[name])
                problem = f"expected {words}, got {repr(value)[:FEW_LETTERS]}"
                raise InputError(None, name, problem + MADE_BY.get(words, ""))
        return function(*args, **kwargs)

    return wrapped


#: How to get an argument of a class, by its name.
MADE_BY = {
    "Project": "; read_project(FILE) reads one",
    "Test": "; project.tests[NAME] is one",
    "MaterialCard": "; read_card(FILE) reads one",
}
#: Letters of a value that are shown.
FEW_LETTERS = 60
_annotations = functools.cache(functools.partial(typing.get_type_hints, include_extras=True))


@dataclass(frozen=True)
class AtLeast:
    """The smallest number that an annotated argument may be."""

    smallest: int


#: Whole numbers as arguments.
Positive = typing.Annotated[int, AtLeast(1)]
NotNegative = typing.Annotated[int, AtLeast(0)]
TwoOrMore = typing.Annotated[int, AtLeast(2)]


def _annotation_words(kind: Any) -> str:
    """Return what an annotation allows, without modules and None."""
    origin = typing.get_origin(kind)
    inside = typing.get_args(kind)
    if origin is typing.Annotated and isinstance(inside[1], AtLeast):
        return f"{_annotation_words(inside[0])} of {inside[1].smallest} or more"
    if origin is typing.Literal:
        return f"one of {', '.join(map(repr, inside))}"
    if origin in (typing.Union, types.UnionType):
        return " | ".join(_annotation_words(one) for one in inside if one is not types.NoneType)
    return re.sub(r"\b(\w+\.)+(?=\w)", "", inspect.formatannotation(kind))


def _fits(value: Any, kind: Any) -> bool:
    """Return True if a value is of an annotation, looking into sequences and at keys."""
    origin = typing.get_origin(kind)
    inside = typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return any(_fits(value, one) for one in inside)
    if origin is typing.Annotated:
        of_kind = _fits(value, inside[0])
        return of_kind and not (isinstance(inside[1], AtLeast) and value < inside[1].smallest)
    if origin is typing.Literal:
        return value in inside
    if origin is Sequence:  # a text is no sequence of texts
        several = hasattr(value, "__len__") and not isinstance(value, (str, bytes, Mapping))
        return several and all(_fits(one, inside[0]) for one in value)
    if origin is Mapping:
        pairs = value.items() if isinstance(value, Mapping) else [(None, None)]
        return all(_fits(key, inside[0]) and _fits(one, inside[1]) for key, one in pairs)
    if kind is Any:
        return True
    if kind in (int, float):
        # True is an int for Python, and no number for whoever writes starts=True.
        is_truth = type(value).__name__ in ("bool", "bool_")
        return hasattr(value, f"__{'index' if kind is int else 'float'}__") and not is_truth
    whole = origin or kind
    if getattr(whole, "_is_protocol", False):  # a plug-in's may have some of its methods only
        methods = [name for name, one in vars(whole).items() if inspect.isfunction(one)]
        return any(hasattr(value, name) for name in methods if not name.startswith("_"))
    return isinstance(value, whole) if isinstance(whole, type) else True


def check_one_of(
    value: object, known: Iterable[object], field: str, path: Path | str | None = None
) -> None:
    """Raise InputError, with all that is known, for a value that is not; None is none."""
    if value is not None and value not in (names := list(known)):
        problem = f"expected one of {', '.join(map(str, names))}, got {value!r}"
        raise InputError(path, field, problem)


def did_you_mean(typed: object, known: Iterable[str]) -> str:
    """Return a question with the nearest known name; "" where none is near."""
    near = difflib.get_close_matches(str(typed), list(known), n=1, cutoff=0.5)
    return f"; did you mean {near[0]!r}?" if near else ""


class OutputError(BubblefitError):
    """An output folder that cannot be written (read-only, full, in use)."""


class PlugInFailure(BubblefitError):
    """A plug-in that does not work; the message names its distribution."""


class NoFeasibleStart(BubblefitError):
    """A search in which no random start inside the bounds satisfied the constraints."""

    exit_code = 3


class SolverFailure(BubblefitError):
    """An analysis without a result: one-line reason, exit number, log, scratch folder or None."""

    exit_code = 4

    def __init__(
        self,
        reason: str,
        solver: str = "membrane",
        exit_number: int | None = None,
        log_tail: str = "",
        scratch: Path | None = None,
    ) -> None:
        self.reason = reason
        self.solver = solver
        self.exit_number = exit_number
        self.log_tail = log_tail
        self.scratch = scratch
        text = f"{solver}: {reason}"
        if exit_number is not None:
            text += f" (exit number {exit_number})"
        if scratch is not None:
            text += f"; scratch kept in {scratch}"
        if log_tail:
            text += f"\n{log_tail}"
        super().__init__(text)

    @property
    def line(self) -> str:
        """Return the reason and the folder that is kept, without the log."""
        return f"{self.reason}; scratch kept in {self.scratch}" if self.scratch else self.reason

    def __reduce__(self) -> tuple:
        fields = (self.reason, self.solver, self.exit_number, self.log_tail, self.scratch)
        return type(self), fields


class LicenceDenied(SolverFailure):
    """A program that never began for want of a licence; another try may succeed."""


def one_line(text: str) -> str:
    """Return the text with escapes in place of characters that break a line or steer a terminal."""
    if text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in _UNSEEN else c
        for c in text
    )


@dataclass(frozen=True)
class Against:
    """Hold what speaks against the moduli of a fit, for its verdict.

    Attributes
    ----------
    words : str
        The reason.
    advice : str
        What to do about it, in words that follow "next:".
    unusable : bool
        Whether the moduli are not to be used at all.
    """

    words: str
    advice: str
    unusable: bool = False


class NoteKind(str):
    """Name a kind of note by its words; the same words are the same kind.

    weight : place among the notes of a fit. mark : among those of a run in tables, 0 for none.
    against : what a note of this kind says against the moduli of a fit.
    """

    weight: float
    mark: int
    against: Against | None
    known: ClassVar[dict[str, NoteKind]] = {}

    def __new__(
        cls, words: str, weight: float = 0.0, mark: int = 0, against: Against | None = None
    ) -> NoteKind:
        if not words.strip():
            raise ValueError("a kind of note is named by words")
        kind = cls.known.setdefault(words, super().__new__(cls, words))
        kind.weight = max(weight, getattr(kind, "weight", 0.0))
        kind.mark = mark or getattr(kind, "mark", 0)
        kind.against = against or getattr(kind, "against", None)
        return kind

    def __getnewargs__(self) -> tuple[str, float, int, Against | None]:  # type: ignore[override]
        """Return the arguments that restore the kind in another process."""
        return str(self), self.weight, self.mark, self.against


#: Notes in plain words, of a solver of another distribution.
SOLVER = NoteKind("of the solver")


class Note(str):
    """Hold a sentence, its kind, and what it is about ("" : everything)."""

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
        """Return the note about `name`, or about a part of `name`."""
        return Note(self.kind, str(self), f"{name}, {self.of}" if self.of else name)

    @property
    def line(self) -> str:
        """Return the sentence with what it is about."""
        return f"{self.of}: {self}" if self.of else str(self)


def as_note(words: str) -> Note:
    """Return a note as it is, and plain words of solvers of other distributions as a note."""
    return words if isinstance(words, Note) else Note(SOLVER, words)


def marks(notes: Iterable[str]) -> list[NoteKind]:
    """Return the marks of a run in a table of runs, from its notes."""
    kinds = {as_note(note).kind for note in notes}
    return sorted((kind for kind in kinds if kind.mark), key=lambda kind: kind.mark)


def gravest(notes: Iterable[Note]) -> list[Note]:
    """Return all notes of `GRAVE` weight, else the weightiest, the gravest first."""
    ordered = sorted(notes, key=lambda note: -note.kind.weight)
    return [note for note in ordered if note.kind.weight >= GRAVE] or ordered[:1]


def rows(notes: Iterable[Note]) -> list[dict[str, str]]:
    """Return the notes as plain values, for result.json and tables."""
    return [{"of": note.of, "kind": str(note.kind), "note": str(note)} for note in notes]


def lines(notes: Sequence[Note], begin: str = "note") -> list[str]:
    """Return lines for the terminal; notes that many things share but for numbers are one."""
    alike: dict[tuple[NoteKind, str], list[Note]] = {}
    for note in notes:
        alike.setdefault((note.kind, NUMBERS.sub("#", note)), []).append(note)
    said = []
    for same in alike.values():
        if len(same) <= FEW:
            said += [f"{begin}: {note.line}" for note in same]
        else:
            said.append(f"{begin}, {len(same)} times ({NOTES} has each), as {same[0].line}")
    return said


def apart(one: float, other: float, digits: int = 3) -> tuple[str, str]:
    """Return two numbers, with more significant digits where they would look alike.

    >>> apart(21.96, 22.0), apart(15.3, 10)
    (('21.96', '22'), ('15.3', '10'))
    """
    for count in range(digits, 10):  # beyond it, rounding
        pair = f"{one:.{count}g}", f"{other:.{count}g}"
        if pair[0] != pair[1]:
            break
    return pair


def percent(value: float) -> str:
    """Return a fraction as percent with two significant digits, whole from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"
