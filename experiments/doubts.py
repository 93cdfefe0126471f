"""Doubts about the data of a test, raised by checks before a fit, and what becomes of them."""

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
        "the data are doubtful", "correct what bubblefit check doubts in the data, and fit again"
    ),
)
#: Smallest usual modulus, MPa, of a coated fabric along its stiffer and along its softer yarn.
USUAL_MODULI = {"warp": 100.0, "fill": 30.0}
#: Factor by which a modulus estimated from the data alone may lie beyond its bounds without being
#: doubted: the estimate is rough.
ROUGH = 4.0


@dataclass(frozen=True)
class Doubt:
    """A doubt: a mistake that the data of a test seem to contain, such as a wrong unit.

    Parameters
    ----------
    name : str
        One or two words joined by a hyphen, by which a user can let the data pass (--trust NAME).
    sure : bool
        Whether a fit of such data would be worthless, which is an error; otherwise the doubt is
        only a warning.
    text : str
        What the numbers are, the probable cause, and a remedy.
    """

    name: str
    sure: bool
    text: str


@dataclass(frozen=True)
class Expected:
    """Hold what is known of the fabric before the fit.

    Attributes
    ----------
    moduli : mapping
        Lower and upper bound, MPa, of each modulus at zero strain, by its name ("E1").
    """

    moduli: Mapping[str, tuple[float, float]]

    @property
    def warp_is_stiffer(self) -> bool:
        """Return whether the bounds say that the warp (E1) is stiffer than the fill (E2)."""
        warp_low, warp_high = self.moduli["E1"]
        fill_low, fill_high = self.moduli["E2"]
        return warp_low * warp_high > 1.5 * fill_low * fill_high

    def limits(self, names: Sequence[str]) -> tuple[float, float]:
        """Return the lowest and the highest bound of the named moduli, MPa."""
        low = min(self.moduli[name][0] for name in names)
        high = max(self.moduli[name][1] for name in names)
        return low, high

    def outside(self, modulus: float, names: Sequence[str], factor: float = ROUGH) -> str:
        """Describe a modulus (MPa) that lies beyond the bounds of the named moduli; "" otherwise.

        Parameters
        ----------
        factor : float
            By which it may lie beyond the lowest and the highest bound.
        """
        low, high = self.limits(names)
        if low / factor <= modulus <= high * factor:
            return ""
        bounds = f"the bounds of {' and '.join(names)} are {low:.3g} to {high:.3g}"
        return f"{modulus:.3g} MPa, and {bounds}"


#: Nothing is known of the fabric.
UNKNOWN = Expected({})


@dataclass(frozen=True)
class Judgement:
    """The doubts about the data of one test, and the names of those that a user trusts.

    A sure doubt stops the fit unless its name is trusted.
    """

    test: str
    doubts: tuple[Doubt, ...]
    trusted: Collection[str]

    @property
    def errors(self) -> tuple[Doubt, ...]:
        """Return the sure doubts that are not trusted, which stop the fit."""
        return tuple(d for d in self.doubts if d.sure and d.name not in self.trusted)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Return notes on all other doubts, which name those that are trusted."""
        return tuple(
            Note(DOUBTFUL, d.text + f" (trusted: {d.name})" * (d.name in self.trusted), self.test)
            for d in self.doubts
            if d not in self.errors
        )

    def demand(self, project: Path) -> None:
        """Raise an InputError with all `errors` in one line, each with its name, if there are any.

        Parameters
        ----------
        project : Path
            File of the project, for the message.
        """
        if self.errors:
            doubts = "; ".join(f"{d.text} [{d.name}]" for d in self.errors)
            problem = f"{doubts}. Correct the data, or let it pass with --trust NAME"
            raise InputError(project, f"the data of {self.test!r}", problem)


def force_unit_doubt(modulus: float, usual: float) -> str:
    """Return words on a modulus (MPa) so far below usual that its forces may have another unit.

    It is empty where the modulus is usual, or where none of the units explains it.
    """
    factors = {"kgf": 9.81, "lbf": 4.45, "kN": 1000.0}
    likely = [
        f"{factor * modulus:.3g} MPa if they are {unit}"
        for unit, factor in factors.items()
        if usual <= factor * modulus <= 40 * usual
    ]
    if modulus >= usual or not likely:
        return ""
    return (
        f"a modulus of about {modulus:.3g} MPa, where coated fabrics have {usual:g} and more: are "
        f"the forces in N? ({', '.join(likely)})"
    )
