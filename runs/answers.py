"""Summary of a fit: the moduli at a few strains, with their uncertainty, as they are reported."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..inference.reported import BOUND_MARK, ReportedModulus, sigma_words
from ..materials.forms.base import COMPONENTS
from ..materials.forms.symmetry import modulus_labels
from .best import BestFit

#: Logarithmic strains of the summary, to which the largest valid strain is added.
STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
#: Share of the largest valid strain beyond which one of `STRAINS` is left out.
LAST_SHARE = 0.95


@dataclass(frozen=True)
class Answer:
    """One modulus at one logarithmic strain, as it is reported.

    Attributes
    ----------
    modulus : str
    strain : float
    value : float
        The modulus, MPa.
    per_width : float
        Modulus times thickness, kN/m.
    end : bool
        Whether this is the largest strain for which the modulus is fitted.
    sigma : float or None
        One standard deviation over the modulus; None if not known.
    band : tuple of float, or None
        Ends of the 95 % band, MPa; None if not known.
    bounds : tuple of bool
        Whether a bound of the fit makes the lower and the upper end of the band.
    on_bound : str
        The bound that the value itself lies on ("lower", "upper"), "" for none.
    determined : bool
        Whether the data determine the modulus.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    end: bool
    sigma: float | None = None
    band: tuple[float, float] | None = None
    bounds: tuple[bool, bool] = (False, False)
    on_bound: str = ""
    determined: bool = False

    def with_certainty(self, reported: ReportedModulus) -> Answer:
        """Return the answer with what is reported of the modulus at this one strain."""
        on_bound = "upper" if reported.on_upper_bound[0] else ""
        return replace(
            self,
            sigma=float(reported.sigma[0]),
            band=(float(reported.lower[0]), float(reported.upper[0])),
            bounds=(bool(reported.at_lower_bound[0]), bool(reported.at_upper_bound[0])),
            on_bound="lower" if reported.on_lower_bound[0] else on_bound,
            determined=bool(reported.determined[0]),
        )

    @property
    def marks(self) -> tuple[str, str, str]:
        """Return the mark of a bound at value, lower and upper end, "" where there is none."""
        lower, upper = self.bounds
        return BOUND_MARK * bool(self.on_bound), BOUND_MARK * lower, BOUND_MARK * upper

    @property
    def value_words(self) -> str:
        """Return the modulus in MPa, marked where it lies on a bound."""
        return f"{self.value:.4g}{self.marks[0]}"

    @property
    def sigma_words(self) -> str:
        """Return one standard deviation in words."""
        if self.sigma is None:
            return "not known"
        return sigma_words(self.sigma, not self.determined)

    @property
    def band_words(self) -> str:
        """Return the ends of the band in MPa, marked where a bound of the fit makes them."""
        if self.band is None:
            return "not known"
        _, lower, upper = self.marks
        return f"{self.band[0]:.4g}{lower} to {self.band[1]:.4g}{upper}"

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the row as it is written to `result.json`."""
        lower, upper = self.bounds
        return {
            "strain": self.strain,
            "MPa": self.value,
            "kN_per_m": self.per_width,
            "sigma": self.sigma,
            "band": self.band,
            "at_lower_bound": lower,
            "at_upper_bound": upper,
            "on_bound": self.on_bound or None,
            "determined": self.determined,
        }


def answers(best: BestFit, thickness: float) -> list[Answer]:
    """Return the moduli that follow from no others, at a few strains up to the last valid one.

    Parameters
    ----------
    best : BestFit
    thickness : float
        mm.
    """
    rows = []
    for name in modulus_labels(best.law.form):
        end = float(best.valid[COMPONENTS[name]])
        strains = [strain for strain in STRAINS if strain < LAST_SHARE * end]
        for strain in (*strains, end):
            value = float(best.law.modulus(name, strain))
            answer = Answer(name, strain, value, value * thickness, strain == end)
            if best.certainty is not None:
                reported = best.certainty.at(best.law, name, np.array([strain]))
                answer = answer.with_certainty(reported)
            rows.append(answer)
    return rows


def answer_numbers(best: BestFit, thickness: float) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of `answers` by modulus."""
    numbers: dict[str, list[dict[str, Any]]] = {}
    for answer in answers(best, thickness):
        numbers.setdefault(answer.modulus, []).append(answer.numbers)
    return numbers
