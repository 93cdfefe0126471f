"""The history section: one block for each load case, which ends with `continue`."""

from __future__ import annotations

from .blocks import loadcase
from .content import Content, Control, LoadCase
from .fields import Deck, Line

#: Convergence is judged by residual AND displacement (5), full Newton-Raphson (1).
CONTROL: list[int | None] = [None, None, 0, 5, 0, 1, 0, 0, 1, *[0] * 7]


def read_history(deck: Deck, content: Content) -> None:
    """Read to the end of the file."""
    while not deck.ended:
        content.cases.append(_case(deck))


def _case(deck: Deck) -> LoadCase:
    case, has = LoadCase("", [], 0, 0.0), []
    while True:
        line = deck.next()
        word = line.keyword if line.text[:6] != "title " else "title"
        if word == "continue":
            line.nothing_after(20)
            break
        if word in has:
            raise line.fail(f"{word} twice in a load case: is a continue missing?")
        has.append(word)
        _block(deck, line, word, case)
    for word in ("loadcase", "control", "auto load", "time step"):
        if word not in has:
            raise line.fail(f"a load case without {word}")
    return case


def _block(deck: Deck, line: Line, word: str, case: LoadCase) -> None:
    if word == "title":
        case.title = line.text[20:].strip()
    elif word == "loadcase":
        case.line = line.number
        case.conditions = loadcase(deck, line)
    elif word == "control":
        row = deck.next()
        values = row.integers(16)
        row.expect(values, CONTROL)
        if values[0] < 1 or values[1] < 1:
            raise row.fail("control without increments or iterations")
        tolerances = []
        for _ in range(2):
            row = deck.next()
            tolerance, *rest = row.reals(8)
            if not 0 < tolerance < 1 or any(rest):
                raise row.fail("expected a tolerance between 0 and 1, and seven zeros")
            tolerances.append(tolerance)
        case.control = Control(*tolerances, iterations=values[1])
    elif word == "auto load":
        row = deck.next()
        values = row.integers(5)
        row.expect(values, [None, 0, 10, 0, 0])
        case.increments = values[0]
        if values[0] < 1:
            raise row.fail("auto load of no increments")
    elif word == "time step":
        row = deck.next()
        (case.step,) = row.reals(1)
        if not case.step > 0:
            raise row.fail("a time step has to be above 0")
    else:
        raise line.fail(f"unknown history option {line.text.strip()!r}")
