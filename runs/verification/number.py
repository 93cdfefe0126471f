"""A published number beside ours."""

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
    allowed : largest deviation: relative, or in `unit` where `absolute`. It follows from the error
        of the model, the mesh or the reading of a figure.
    source : publication or closed form.
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
        """Ours less theirs, relative to theirs, or in `unit` where `absolute`."""
        off = self.ours - self.theirs
        return off if self.absolute else off / abs(self.theirs)

    @property
    def met(self) -> bool:
        """True where the deviation is allowed; NaN is not."""
        return abs(self.deviation) <= self.allowed

    @property
    def row(self) -> dict[str, Any]:
        """The number in tables and JSON."""
        return {
            "what": self.what, "ours": self.ours, "theirs": self.theirs, "unit": self.unit,
            "deviation": self.deviation, "allowed": self.allowed, "absolute": self.absolute,
            "met": self.met, "source": self.source,
        }  # fmt: skip
