"""What makes the data of a test doubtful before anything is fitted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..notes import Note, NoteKind

#: A modulus that the data themselves tell may be off its bounds by this factor: it is a rough one.
ROUGH = 4.0


@dataclass(frozen=True)
class Doubt:
    """One trap that the data of a test seem to have fallen into.

    Parameters
    ----------
    name : of the trap, in one or two words joined by a hyphen: what is trusted by name.
    sure : whether a fit of such data would be worthless; a warning otherwise.
    text : what was seen, in numbers, what it probably is, and what to do.
    """

    name: str
    sure: bool
    text: str


@dataclass(frozen=True)
class Expected:
    """What is known of the fabric before the fit.

    moduli : least and largest at rest, MPa, by name.
    """

    moduli: Mapping[str, tuple[float, float]]

    @property
    def warp_is_stiffer(self) -> bool:
        """Whether the bounds mean the warp to be stiffer than the fill."""
        (low, high), (least, largest) = self.moduli["E1"], self.moduli["E2"]
        return low * high > 1.5 * least * largest

    def outside(self, modulus: float, names: Sequence[str]) -> str:
        """Words on a modulus (MPa) far out of the bounds of those named together, "" otherwise."""
        low = min(self.moduli[name][0] for name in names)
        high = max(self.moduli[name][1] for name in names)
        if low / ROUGH <= modulus <= high * ROUGH:
            return ""
        whose = " and ".join(names)
        return f"{modulus:.3g} MPa, and the bounds of {whose} are {low:.3g} to {high:.3g}"


@dataclass(frozen=True)
class Judgement:
    """The doubts of one test, sure ones first; those that are trusted stop nothing."""

    test: str
    doubts: tuple[Doubt, ...]
    trusted: frozenset[str]

    @property
    def errors(self) -> tuple[Doubt, ...]:
        """Sure ones that nobody trusts."""
        return tuple(d for d in self.doubts if d.sure and d.name not in self.trusted)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What a reader of the result should know, trusted doubts with the word for it."""
        return tuple(
            Note(NoteKind.DOUBTFUL, d.text + self._trusted(d), self.test)
            for d in self.doubts
            if d not in self.errors
        )

    def _trusted(self, doubt: Doubt) -> str:
        return f" (trusted: {doubt.name})" if doubt.name in self.trusted else ""

    def demand(self, project: Path) -> None:
        """Stop at the sure doubts.

        Raises
        ------
        InputError : all of them in one line, each with the name by which it can be trusted.
        """
        if self.errors:
            said = "; ".join(f"{d.text} [{d.name}]" for d in self.errors)
            problem = f"{said}. Correct the data, or let it pass with --trust NAME"
            raise InputError(project, f"the data of {self.test!r}", problem)


def judged(test: str, doubts: Sequence[Doubt], trust: Collection[str]) -> Judgement:
    """The doubts of a test, sure ones first."""
    ordered = tuple(sorted(doubts, key=lambda d: not d.sure))
    return Judgement(test, ordered, frozenset(trust))
