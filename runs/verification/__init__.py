"""Verification: published and closed-form numbers beside those of the installed program.

bf.verify().table() lists them all, bf.verify(["bars"]) those of a subject.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...lazy_modules import LazyFunction

#: Folder of the published tables.
PUBLISHED = Path(__file__).parent / "published"


@dataclass(frozen=True)
class Number:
    """Hold a published or closed-form number, and the one that this program computes for it.

    Attributes
    ----------
    quantity : str
        The quantity and the case.
    ours, theirs : float
        In `unit`.
    unit : str
        "" for a pure number.
    allowed : float
        Largest deviation, relative or in `unit` where `absolute`, by the error of the model, of the
        mesh or of the reading of a figure.
    source : str
        Publication or closed form.
    absolute : bool
    """

    quantity: str
    ours: float
    theirs: float
    unit: str
    allowed: float
    source: str
    absolute: bool = False

    @property
    def deviation(self) -> float:
        """Return ours less theirs, relative to theirs, or in `unit` where `absolute`."""
        difference = self.ours - self.theirs
        return difference if self.absolute else difference / abs(self.theirs)

    @property
    def met(self) -> bool:
        """Return True where the deviation is allowed; NaN is not."""
        return bool(abs(self.deviation) <= self.allowed)

    @property
    def row(self) -> dict[str, Any]:
        """Return the number as plain values, as `verify --json` prints it."""
        values = asdict(self)
        quantity = values.pop("quantity")
        return {"what": quantity, **values, "deviation": self.deviation, "met": self.met}


SUBJECTS = {
    subject: LazyFunction(f"{__name__}.{module}", function)
    for subject, module, function in (
        ("bars", "uniaxial", "marc_bars"),
        ("hencky", "bubbles", "hencky_membranes"),
        ("abaqus", "bubbles", "abaqus_bubbles"),
        ("marc bubble", "bubbles", "marc_bubble"),
        ("strips", "uniaxial", "strips"),
        ("thin walls", "thin_walls", "thin_walls"),
        ("bent tube", "tubes", "bent_tubes"),
        ("loaded tubes", "tubes", "loaded_tubes"),
        ("nu12", "bubbles", "poisson_ratios"),
        ("calculix", "uniaxial", "with_calculix"),
    )
}
