"""What a fit says of each unknown beside the moduli: value, sigma, its bound, or nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import COMPONENTS, modulus_rows
from ..notes import Note, NoteKind
from .posterior import Posterior

Array = NDArray[np.float64]

#: Of the width of the bounds: as uncertain as a number that may be anywhere between them.
ANYWHERE = 12**-0.5
#: Of a prior: the data add next to nothing to it.
AS_BEFORE = 0.9
#: Of the width of the bounds, within which a value lies on one.
ON_BOUND = 1e-6
#: Correlations that are worth saying.
CORRELATED = 0.5


@dataclass(frozen=True)
class Verdict:
    """One unknown beside the moduli.

    Parameters
    ----------
    name : with its comparison where it is of one among several. value, sigma, lower, upper, prior :
        in `unit`; prior None where nothing was known of it.
    correlation : with each modulus in the middle of its strains, -1 to 1.
    shared : whether it is one for all tests. why : the data say nothing of it, if they do not.
    """

    name: str
    unit: str
    value: float
    sigma: float
    lower: float
    upper: float
    prior: float | None
    correlation: dict[str, float]
    shared: bool
    why: str = ""

    @property
    def on(self) -> str:
        """The bound that it lies on ("lower", "upper"), "" for none."""
        room = ON_BOUND * (self.upper - self.lower)
        if self.value - self.lower <= room:
            return "lower"
        return "upper" if self.upper - self.value <= room else ""

    @property
    def determined(self) -> bool:
        """Whether the data say anything of it."""
        if self.prior is not None:
            return self.sigma < AS_BEFORE * self.prior
        return self.sigma < ANYWHERE * (self.upper - self.lower)

    @property
    def words(self) -> str:
        """What the data say of it."""
        unit = f" {self.unit}" if self.unit else ""
        value = f"{self.value:.4g}{unit}" + (f", on its {self.on} bound" if self.on else "")
        if not self.determined:
            known = (
                f"it may be {self.lower:.4g} to {self.upper:.4g}{unit}"
                if self.prior is None
                else f"known to {self.prior:.2g}{unit} before"
            )
            why = f"; {self.why}" if self.why else ""
            return f"{value}: the data say nothing of it ({known}){why}"
        return f"{value}, 1 sigma {self.sigma:.2g}{unit}{self._together}"

    @property
    def _together(self) -> str:
        name = max(self.correlation, key=lambda name: abs(self.correlation[name]))
        if abs(self.correlation[name]) < CORRELATED:
            return ""
        return f", correlation {self.correlation[name]:.2f} with {name}"

    @property
    def numbers(self) -> dict[str, Any]:
        """For result.json."""
        return {
            "value": self.value,
            "unit": self.unit,
            "sigma": self.sigma,
            "bounds": [self.lower, self.upper],
            "prior": self.prior,
            "on_bound": self.on or None,
            "determined": self.determined,
            "correlation": self.correlation,
            "verdict": self.words,
        }


def verdicts(posterior: Posterior, ends: Array) -> tuple[Verdict, ...]:
    """Of all unknowns beside the moduli.

    ends : (3,) strains (eps1, eps2, gamma12) to which the moduli are known.
    """
    unknowns, covariance = posterior.unknowns, posterior.covariance
    size, free = unknowns.size, list(unknowns.free)
    slopes = {}
    for modulus, component in COMPONENTS.items():
        middle = [0.5 * float(ends[component])]
        row = modulus_rows(unknowns.form, modulus, middle, unknowns.strain_range)[0, free]
        slopes[modulus] = row @ unknowns.to_coefficients
    of_law = covariance[:size, :size]
    spread = {m: float(np.sqrt(slope @ of_law @ slope)) for m, slope in slopes.items()}
    found = []
    pairs = zip(unknowns.nuisance_names, unknowns.nuisance.all, strict=True)
    for place, (name, one) in enumerate(pairs, start=size):
        sigma = float(np.sqrt(covariance[place, place]))
        correlation = {
            modulus: float(slope @ covariance[:size, place]) / max(sigma * spread[modulus], 1e-300)
            for modulus, slope in slopes.items()
        }
        value = float(posterior.best[place])
        found.append(
            Verdict(name, one.unit, value, sigma, one.lower, one.upper, one.prior, correlation,
                    one.shared, one.why)
        )  # fmt: skip
    return tuple(found)


def notes_of_verdicts(found: tuple[Verdict, ...]) -> list[Note]:
    """What the data say nothing of; what lies on a bound is told with the moduli that do."""
    return [
        Note(NoteKind.UNCERTAIN, f"{verdict.name} is {verdict.words}")
        for verdict in found
        if not verdict.determined and (verdict.shared or verdict.prior is None)
    ]
