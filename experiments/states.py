"""Notes on tests fitted together although the fabric was in different states or loaded otherwise.

A state is "first loading" (the fabric was new) or "conditioned" (it had been loaded in cycles).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..materials.card import State
from ..notes import Note, NoteKind
from ..readers.histories import Pace
from .base import Test

STATES = NoteKind("tests in different states", weight=9)
#: How strips say that they were not conditioned: in all, or by their first word.
WITHOUT_CONDITIONING = frozenset(("none", "0", "virgin", "new", "unconditioned", "nein", "neu"))
NEGATIONS = frozenset(("no", "not", "without", "kein", "keine", "nicht", "ohne"))


@dataclass(frozen=True)
class PaceComparison:
    """A quantity of the loading in time that should be alike in tests that are fitted together."""

    quantity: str  # its name in messages
    unit: str
    value: Callable[[Pace], float]  # returns it in `unit`
    smallest: float  # in `unit`: differences between values below this do not matter
    effect: str  # what a difference does to the fit, in words
    largest_ratio: float = 2.0  # values whose ratio is larger differ

    def describe_difference(self, paces: Mapping[str, Pace]) -> str:
        """Describe how tests differ in the quantity; return "" where they are alike or unknown.

        Parameters
        ----------
        paces : mapping of str to Pace
            Mapping of test name to rate of strain and longest hold.
        """
        values = {name: self.value(pace) for name, pace in paces.items()}
        values = {name: value for name, value in values.items() if np.isfinite(value)}
        if not values:
            return ""
        limit = max(self.largest_ratio * min(values.values()), self.smallest)
        if max(values.values()) <= limit:
            return ""
        words = ", ".join(f"{name}: {value:.3g} {self.unit}" for name, value in values.items())
        return f"joined tests differ in {self.quantity} ({words}): {self.effect}"


#: The quantities that are compared: rate of strain and longest hold.
PACES = (
    PaceComparison(
        "rate of strain",
        "%/min",
        lambda pace: 6000.0 * pace.rate,
        0.0,
        "coated fabrics are the stiffer the faster they are pulled, and one law lies between",
    ),
    PaceComparison(
        "longest hold",
        "s",
        lambda pace: pace.hold,
        10.0,
        "the fabric creeps in a hold, which a law without time takes for softness or permanent set",
    ),
)


def state_from_conditioning(conditioning: str | None) -> State:
    """Return the state of a fabric from a project's words for its conditioning; "" without any."""
    if conditioning is None:
        return ""
    text = conditioning.strip().casefold()
    is_new = text in WITHOUT_CONDITIONING or text.split(" ")[0] in NEGATIONS
    return "first loading" if is_new else "conditioned"


def state_of(tests: Sequence[Test]) -> State:
    """Return the one state of all tests; "" where they differ or none describes a conditioning."""
    states: set[Any] = {test.state for test in tests if test.state}
    is_described = any(test.conditioning for test in tests)
    return states.pop() if is_described and len(states) == 1 else ""


def notes_of_states(tests: Iterable[Test]) -> list[Note]:
    """Note tests fitted together that differ in state, in rate of strain or in longest hold."""
    tests = list(tests)
    states = {test.name: test.state for test in tests if test.state}
    notes = []
    if len({*states.values()}) > 1:
        words = ", ".join(f"{name}: {state}" for name, state in states.items())
        notes.append(Note(STATES, f"joined tests differ in state ({words}): one law is not both"))
    paces = {test.name: test.pace for test in tests if test.pace}
    texts = (comparison.describe_difference(paces) for comparison in PACES)
    return [*notes, *(Note(STATES, text) for text in texts if text)]
