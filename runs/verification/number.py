"""One number of somebody else's beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Number:
    """A published or closed-form number, and what this program computes for it.

    Parameters
    ----------
    what : the quantity and the case.
    ours, theirs : in `unit` ("" for a pure number).
    allowed : largest deviation: relative, or in `unit` where `absolute`. It is what the model, the
        mesh or the reading of a figure can be off by, not what happens to be met.
    source : who published it, or which closed form it is.
    """

    what: str
    ours: float
    theirs: float
    unit: str
    allowed: float
    source: str
    absolute: bool = False

    @property
    def deviation(self) -> float:
        """Ours less theirs: relative to theirs, or in `unit` where `absolute`."""
        off = self.ours - self.theirs
        return off if self.absolute else off / abs(self.theirs)

    @property
    def met(self) -> bool:
        """Whether the deviation is allowed; one that is no number is not."""
        return abs(self.deviation) <= self.allowed

    @property
    def row(self) -> dict[str, Any]:
        """For tables and JSON."""
        return {
            "what": self.what,
            "ours": self.ours,
            "theirs": self.theirs,
            "unit": self.unit,
            "deviation": self.deviation,
            "allowed": self.allowed,
            "absolute": self.absolute,
            "met": self.met,
            "source": self.source,
        }
