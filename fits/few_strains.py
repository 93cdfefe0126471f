"""The answer of a fit: each modulus at a few strains, and how sure it is there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..materials.forms.base import COMPONENTS

if TYPE_CHECKING:
    from .result import Fit

#: Logarithmic strains at which moduli are told, and the end of the valid strains beside them.
STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
#: Of the end: a strain nearer to it is left out, the end stands for it.
NEAR = 0.95


@dataclass(frozen=True)
class Answer:
    """One modulus at one strain.

    strain : logarithmic. value : MPa; per_width : the same times the thickness before the test,
    kN/m. sigma : one standard deviation over the value; band : MPa, between which it lies with 95 %
    certainty; None where they are not known. end : whether the modulus is fitted no further.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    sigma: float | None = None
    band: tuple[float, float] | None = None
    end: bool = False


def answers(fit: Fit) -> list[Answer]:
    """E1, E2 and G12 at a few strains up to the end of those that they are fitted for."""
    told = []
    for name, component in COMPONENTS.items():
        end = float(fit.best.valid[component])
        strains = [*(strain for strain in STRAINS if strain < NEAR * end), end]
        told += [answer_at(fit, name, strain, strain == end) for strain in strains]
    return told


def answer_at(fit: Fit, name: str, strain: float, end: bool = False) -> Answer:
    """One modulus (E1, E2 or G12) at one strain."""
    value, sure = float(fit.law.modulus(name, strain)), fit.best.certainty
    per_width = value * fit.thickness
    if sure is None:
        return Answer(name, strain, value, per_width, end=end)

    def at(values: np.ndarray) -> float:
        return float(np.interp(strain, sure.strain[name], values))

    band = None
    if name in sure.band:
        lower, upper = sure.band[name]
        band = at(lower), at(upper)
    return Answer(name, strain, value, per_width, at(sure.total[name]), band, end)
