"""Doubts about the data of a test before a fit."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..notes import Note, NoteKind, Objection

DOUBTFUL = NoteKind(
    "doubtful data",
    weight=12,
    objection=Objection(
        "the data are doubtful", "settle the doubts about the data (bubblefit check)"
    ),
)
#: A modulus that the data themselves tell may be off its bounds by this factor: it is a rough one.
ROUGH = 4.0


@dataclass(frozen=True)
class Doubt:
    """One trap that the data of a test seem to have fallen into.

    Parameters
    ----------
    name : str
        One or two words joined by a hyphen, by which it is trusted.
    sure : bool
        Whether a fit of such data would be worthless; a warning otherwise.
    text : str
        Numbers, the probable cause, and a remedy.
    """

    name: str
    sure: bool
    text: str


@dataclass(frozen=True)
class Expected:
    """Knowledge of the fabric before the fit; moduli : least and largest at rest, MPa, by name."""

    moduli: Mapping[str, tuple[float, float]]

    @property
    def warp_is_stiffer(self) -> bool:
        """Return whether the bounds mean the warp to be stiffer than the fill."""
        warp_low, warp_high = self.moduli["E1"]
        fill_low, fill_high = self.moduli["E2"]
        return warp_low * warp_high > 1.5 * fill_low * fill_high

    def limits(self, names: Sequence[str]) -> tuple[float, float]:
        """Return the least and the largest of the moduli named together, MPa."""
        low = min(self.moduli[name][0] for name in names)
        high = max(self.moduli[name][1] for name in names)
        return low, high

    def outside(self, modulus: float, names: Sequence[str], factor: float = ROUGH) -> str:
        """Describe a modulus (MPa) out of the bounds of those named together; "" otherwise.

        factor : by which it may lie beyond them.
        """
        low, high = self.limits(names)
        if low / factor <= modulus <= high * factor:
            return ""
        bounds = f"the bounds of {' and '.join(names)} are {low:.3g} to {high:.3g}"
        return f"{modulus:.3g} MPa, and {bounds}"


@dataclass(frozen=True)
class Judgement:
    """The doubts of one test, sure ones first; those whose names are trusted stop nothing."""

    test: str
    doubts: tuple[Doubt, ...]
    trusted: Collection[str]

    @property
    def errors(self) -> tuple[Doubt, ...]:
        """Return sure doubts that are not trusted."""
        return tuple(d for d in self.doubts if d.sure and d.name not in self.trusted)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Return notes on all other doubts, with their name where they are trusted."""
        return tuple(
            Note(DOUBTFUL, d.text + f" (trusted: {d.name})" * (d.name in self.trusted), self.test)
            for d in self.doubts
            if d not in self.errors
        )

    def demand(self, project: Path) -> None:
        """Raise an InputError with all sure doubts in one line, each with its name."""
        if self.errors:
            doubts = "; ".join(f"{d.text} [{d.name}]" for d in self.errors)
            problem = f"{doubts}. Correct the data, or let it pass with --trust NAME"
            raise InputError(project, f"the data of {self.test!r}", problem)
