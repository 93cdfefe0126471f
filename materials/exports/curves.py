"""Stress-strain curves of the three tests that fabric materials of explicit programs take."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..card import MaterialCard
from ..forms.base import COMPONENTS
from ..law import HypoelasticLaw
from ..responses import Measure, trellis_angle, trellis_curve, uniaxial_curve
from ..tables import modulus_table
from .formats import TableOptions

Array = NDArray[np.float64]
#: Log strain of the one point in compression: a curve has to begin somewhere.
COMPRESSION = -0.1
#: Log strain of both yarns at which the loss of nu12 is told, and increments up to there.
BIAXIAL, INCREMENTS = 0.05, 50


@dataclass(frozen=True, eq=False)
class FabricCurves:
    """Strain and stress (MPa), (n, 2), of warp, fill and shear in one measure.

    Warp and fill from compression through zero; shear from zero, odd. Curves that do not couple
    leave out: yarns, the largest 2nd Piola-Kirchhoff stress (MPa) along a yarn in shear alone;
    softer, the share of the stress that is missing along warp and fill when both have the log
    strain biaxial.
    """

    warp: Array
    fill: Array
    shear: Array
    yarns: float
    biaxial: float
    softer: tuple[float, float]

    @property
    def uncoupled(self) -> str:
        """What it costs that nu12 is lost, in words."""
        warp, fill = (100 * share for share in self.softer)
        return (
            "under biaxial tension softer than the card, as the contraction of the strips is in "
            f"the curves: by {warp:.2g} % along the warp and {fill:.2g} % along the fill when "
            f"both have {100 * self.biaxial:g} % of log strain"
        )


def fabric_curves(card: MaterialCard, options: TableOptions, measure: Measure) -> FabricCurves:
    """The curves of a card, to the end of its range or `options.reach`.

    Raises
    ------
    InputError : a modulus is not positive on the way.
    """
    strains = {
        name: modulus_table(card.law, name, options.points, options.reach).strain
        for name in COMPONENTS
    }
    both = []
    for pulled, name in enumerate(("E1", "E2")):
        x, y = uniaxial_curve(card.law, pulled, strains[name], measure)
        back, push = uniaxial_curve(card.law, pulled, np.array([COMPRESSION]), measure)
        both.append(np.stack([np.concatenate([back, x]), np.concatenate([push, y])], axis=1))
    gamma = strains["G12"][strains["G12"] >= 0]
    angle = np.array([trellis_angle(g) for g in gamma])
    x, y, yarns = trellis_curve(card.law, angle, measure)
    largest = float(np.abs(yarns).max())
    equal = min(BIAXIAL, *(float(strains[name][-1]) for name in ("E1", "E2")))
    shear = np.stack([x, y], axis=1)
    return FabricCurves(both[0], both[1], shear, largest, equal, _softer(card.law, equal))


def _softer(law: HypoelasticLaw, log_strain: float) -> tuple[float, float]:
    """Share of the biaxial stress that the curves of strips do not give, warp and fill."""
    ends = np.linspace(0.0, log_strain, INCREMENTS + 1)
    strain = np.stack([ends, ends, 0 * ends], axis=1)
    stress = np.zeros(3)
    for old, new in pairwise(strain):
        stress = law.increment(old, new, stress)[0][0]
    # Forces over reference areas: the other direction is stretched, too.
    _, per_strip = zip(*(uniaxial_curve(law, i, ends, "nominal") for i in (0, 1)), strict=True)
    area = np.exp(law.area_power * 2 * log_strain - log_strain)
    warp, fill = (1 - float(per_strip[i][-1] / (stress[i] * area)) for i in (0, 1))
    return warp, fill
