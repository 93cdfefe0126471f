"""The parameter section: from the title to `end`."""

from __future__ import annotations

from dataclasses import dataclass, field

from .fields import Deck, DeckError, Line

TYPES = (18, 75, 139)
#: Fields after the keyword, in columns 30, 40, ...; None where any integer will do.
FIXED: dict[str, list[int | None]] = {
    "alloc": [25],
    "elements": [None],
    "version": [14, 1, 0, 1],
    "table": [0, 0, 2, 1, 1, 0, 0, 1],
    "processor": [1, 1, 1, 0],
    "large stra": [2, 1, 0, 0, 0, 0, 0],
    "follow for": [1, 0, 0],
    "shell sect": [5, 0, 1],
    "state vars": [None],
    "cavity": [1],
    "extended": [],
    "all points": [],
}
ALWAYS = (
    "title", "extended", "sizing", "alloc", "elements", "version", "table", "processor",
    "large stra", "all points",
)  # fmt: skip


@dataclass
class Parameters:
    """What the parameter section says; `has` are its keywords."""

    title: str = ""
    elements: int = 0
    nodes: int = 0
    type: int = 0
    states: int = 0
    has: list[str] = field(default_factory=list)


def read_parameters(deck: Deck) -> Parameters:
    """Read up to and including `end`."""
    found = Parameters()
    while True:
        if deck.ended:
            raise DeckError("no end of the parameters")
        line = deck.next()
        word = line.text[:10].rstrip()
        if word == "end":
            line.nothing_after(10)
            break
        if word in found.has:
            raise line.fail(f"parameter {word!r} twice")
        if word not in ("title", "extended") and "extended" not in found.has:
            raise line.fail("extended has to come before anything that has columns")
        found.has.append(word)
        _parameter(line, word, found)
    _complete(found)
    return found


def _parameter(line: Line, word: str, found: Parameters) -> None:
    if word == "title":
        found.title = line.text[20:].strip()
    elif word == "sizing":
        values = _after(line, word, 4, first=40)
        line.expect(values, [0, None, None, 0])
        found.elements, found.nodes = values[1:3]
        if min(found.elements, found.nodes) < 1:
            raise line.fail("sizing without elements or nodes")
    elif word in FIXED:
        values = _after(line, word, len(FIXED[word]))
        line.expect(values, FIXED[word])
        if word == "elements":
            (found.type,) = values
            if found.type not in TYPES:
                raise line.fail(f"element type {found.type} is none of {TYPES}")
        if word == "state vars":
            (found.states,) = values
    else:
        raise line.fail(f"unknown parameter {line.text.strip()!r}")


def _after(line: Line, word: str, count: int, first: int = 30) -> list[int]:
    """The fields of a parameter: i10, the first of which ends in column `first`."""
    if line.text[len(word) : first - 10].strip():
        raise line.fail(f"columns {len(word) + 1} to {first - 10} have to be empty")
    end = first - 10 + 10 * count
    line.nothing_after(end)
    if count and len(line.text.rstrip()) < end:
        raise line.fail(f"{word}: fewer than {count} fields")
    return [line.integer(first + 10 * i) for i in range(count)]


def _complete(found: Parameters) -> None:
    for word in ALWAYS:
        if word not in found.has:
            raise DeckError(f"no parameter {word!r}")
    shell = found.type != 18
    if shell != ("shell sect" in found.has):
        raise DeckError(f"shell sect is for shells, and elements are {found.type}")
