"""Summary of a fit: the moduli at a few strains, with their uncertainty, as they are reported."""

from dataclasses import dataclass
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
    reported : ReportedModulus or None
        At this one strain; None where the uncertainty is not known.
    end : bool
        Whether this is the largest strain for which the modulus is fitted.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    reported: ReportedModulus | None
    end: bool

    @property
    def sigma(self) -> float | None:
        """Return one standard deviation over the modulus; None if not known."""
        return None if self.reported is None else self.reported.sigma[0]

    @property
    def band(self) -> tuple[float, float] | None:
        """Return the ends of the 95 % band, MPa; None if not known."""
        if self.reported is None:
            return None
        return self.reported.lower[0], self.reported.upper[0]

    @property
    def bounds(self) -> tuple[bool, bool]:
        """Return whether a bound of the fit makes the lower and the upper end of the band."""
        if self.reported is None:
            return False, False
        return bool(self.reported.at_lower_bound[0]), bool(self.reported.at_upper_bound[0])

    @property
    def on_bound(self) -> str:
        """Return the bound that the value itself lies on ("lower", "upper"), "" for none."""
        if self.reported is None:
            return ""
        if self.reported.on_lower_bound[0]:
            return "lower"
        return "upper" if self.reported.on_upper_bound[0] else ""

    @property
    def determined(self) -> bool:
        """Return whether the data determine the modulus."""
        return self.reported is not None and bool(self.reported.determined[0])

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
            reported = None
            if best.certainty is not None:
                reported = best.certainty.at(best.law, name, np.array([strain]))
            rows.append(Answer(name, strain, value, value * thickness, reported, strain == end))
    return rows


def answer_numbers(best: BestFit, thickness: float) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of `answers` by modulus."""
    numbers: dict[str, list[dict[str, Any]]] = {}
    for answer in answers(best, thickness):
        numbers.setdefault(answer.modulus, []).append(answer.numbers)
    return numbers
