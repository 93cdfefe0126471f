"""States of the fabric in tests: conditioning, rates and holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..materials.card import State
from ..notes import Note, NoteKind
from .base import Test

STATES = NoteKind("tests in different states", weight=9)
#: How strips say that they were not conditioned; rates or holds that differ by more are not one.
NONE, ALIKE = frozenset(("none", "no", "0", "without", "keine", "ohne")), 2.0
#: Fields of a `Pace`, in words, unit and its number, the least that matters, and what it may do.
PACES = (
    ("rate", "rate of strain", "%/min", 6000.0, 0.0,
     "coated fabrics are the stiffer the faster they are pulled, and one law lies between"),
    ("hold", "longest hold", "s", 1.0, 10.0,
     "the fabric creeps in a hold, which a law without time takes for softness or permanent set"),
)  # fmt: skip


def state_said(conditioning: str | None) -> State:
    """Return the state of a fabric by the words for its conditioning; "" where nothing is said."""
    if conditioning is None:
        return ""
    return "first loading" if conditioning.strip().casefold() in NONE else "conditioned"


def state_of(tests: Sequence[Test]) -> State:
    """Return the state of all tests where strips say one and no other test is in another."""
    states: set[Any] = {s for t in tests if (s := getattr(t, "state", ""))}
    said = any(getattr(t, "conditioning", None) for t in tests)
    return states.pop() if said and len(states) == 1 else ""


def notes_of_states(tests: Iterable[Test]) -> list[Note]:
    """Note tests that are fitted together in other states, at other rates or with other holds."""
    every = list(tests)
    states = {t.name: said for t in every if (said := getattr(t, "state", ""))}
    found = []
    if len({*states.values()}) > 1:
        words = ", ".join(f"{name}: {said}" for name, said in states.items())
        found.append(Note(STATES, f"joined tests differ in state ({words}): one law is not both"))
    paces = {t.name: pace for t in every if (pace := getattr(t, "pace", None))}
    for field_, what, unit, number, least, effect in PACES:
        each = {name: number * getattr(pace, field_) for name, pace in paces.items()}
        each = {name: value for name, value in each.items() if np.isfinite(value)}
        if each and max(each.values()) > max(ALIKE * min(each.values()), least):
            words = ", ".join(f"{name}: {value:.3g} {unit}" for name, value in each.items())
            found.append(Note(STATES, f"joined tests differ in {what} ({words}): {effect}"))
    return found
