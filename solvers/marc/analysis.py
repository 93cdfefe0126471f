"""What an analysis of any model is given: how its decks are written, and what runs them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

T = TypeVar("T")
#: Makes something of the .t19 file and the number of iterations.
Reader = Callable[[Path, int], T]


class Run(Protocol):
    """Runs a deck in a scratch folder of its own."""

    def __call__(
        self, deck: str, units: int, read: Reader[T], rescue: Reader[T] | None = None
    ) -> T:
        """What `read` makes of the results, or `rescue` of those of a run that stopped early.

        Parameters
        ----------
        units : total time at the end of the deck.

        Raises
        ------
        SolverFailure : it did not end well.
        """
