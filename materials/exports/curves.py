"""Stress-strain curves of the three tests that fabric materials of explicit programs take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..card import MaterialCard
from ..moduli import MODULI
from ..responses import Measure, trellis_angle, trellis_curve, uniaxial_curve
from ..tables import modulus_table
from .base import Options

Array = NDArray[np.float64]
#: Log strain of the one point in compression: a curve has to begin somewhere.
COMPRESSION = -0.1


@dataclass(frozen=True, eq=False)
class FabricCurves:
    """Strain and stress (MPa), (n, 2), of warp, fill and shear in one measure.

    Warp and fill from compression through zero; shear from zero, odd. yarns : largest 2nd
    Piola-Kirchhoff stress (MPa) along a yarn in shear alone, which uncoupled curves leave out.
    """

    warp: Array
    fill: Array
    shear: Array
    yarns: float


def fabric_curves(card: MaterialCard, options: Options, measure: Measure) -> FabricCurves:
    """The curves of a card, to the end of its range or `options.reach`.

    Raises
    ------
    InputError : a modulus is not positive on the way.
    """
    strains = {
        name: modulus_table(card.law, name, options.points, options.reach).strain for name in MODULI
    }
    both = []
    for pulled, name in enumerate(("E1", "E2")):
        x, y = uniaxial_curve(card.law, pulled, strains[name], measure)
        back, push = uniaxial_curve(card.law, pulled, np.array([COMPRESSION]), measure)
        both.append(np.stack([np.concatenate([back, x]), np.concatenate([push, y])], axis=1))
    gamma = strains["G12"][strains["G12"] >= 0]
    angle = np.array([trellis_angle(g) for g in gamma])
    x, y, yarns = trellis_curve(card.law, angle, measure)
    return FabricCurves(both[0], both[1], np.stack([x, y], axis=1), float(np.abs(yarns).max()))
