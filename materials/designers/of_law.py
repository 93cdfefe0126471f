"""Designers' constants of any law: the linear evaluation of its own biaxial response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..biaxial_response import biaxial_response
from ..law import HypoelasticLaw
from .constants import DesignersConstants
from .linear import USUAL, Evaluation, Options, evaluate, evaluate_others, line_of
from .ratios import RATIOS, shares

Array = NDArray[np.float64]

#: Increments of the law along a path.
STEPS = 60
#: Strains of a shear at which G is averaged.
SHEARS = 61


@dataclass(frozen=True, eq=False)
class LawConstants:
    """A law as designers' constants.

    evaluation : that was asked for, its constants with the shear stiffness; others : of the other
    options. lost : by ratio, RMS of what the constants are off the law's own strains along the
    path, %. largest : by ratio, the law's largest strain, %. shear : (least, largest) G per width
    over the shear strains, kN/m.
    """

    evaluation: Evaluation
    others: tuple[Evaluation, ...]
    lost: Mapping[str, float]
    largest: Mapping[str, float]
    shear: tuple[float, float]

    @property
    def constants(self) -> DesignersConstants:
        """What was asked for."""
        return self.evaluation.constants

    @property
    def rms(self) -> float:
        """Over all ratios, %."""
        return float(np.sqrt(np.mean(np.square([*self.lost.values()]))))


def constants_of_law(
    law: HypoelasticLaw,
    thickness: float,
    lowest: float,
    highest: float,
    shear_strain: float,
    options: Options = USUAL,
    ratios: Sequence[str] = RATIOS,
) -> LawConstants:
    """Evaluate a law as a test of five ratios is evaluated.

    Parameters
    ----------
    thickness : mm. lowest, highest : kN/m, of the larger load of each ratio. shear_strain : up to
        which G is averaged.

    Raises
    ------
    InputError : loads that do not increase, a law that does not carry them.
    """
    if not 0 <= lowest < highest:
        problem = f"expected loads that increase from 0 kN/m or more, got {lowest:g} to {highest:g}"
        raise InputError(None, "loads", problem)
    curves = {name: _curve(law, thickness, name, lowest, highest) for name in ratios}
    lines = [line_of(name, *curve) for name, curve in curves.items()]
    gammas = np.linspace(0.0, shear_strain, SHEARS)
    shear = law.G12(gammas) * thickness
    mean = float(np.trapezoid(shear, gammas) / shear_strain)
    asked = evaluate(lines, options)
    asked = replace(asked, constants=replace(asked.constants, shear=mean))
    others = tuple(evaluate_others(lines, options))
    lost, largest = {}, {}
    for name, (load, strain) in curves.items():
        off = (strain - strain[0]) - asked.constants.strain(load - load[0])
        lost[name] = float(100 * np.sqrt(np.mean(off**2)))
        largest[name] = float(100 * np.abs(strain).max())
    return LawConstants(asked, others, lost, largest, (float(shear.min()), float(shear.max())))


def _curve(
    law: HypoelasticLaw, thickness: float, ratio: str, lowest: float, highest: float
) -> tuple[Array, Array]:
    """Loads (n, 2) kN/m of a ratio and the law's strains (n, 2)."""
    larger = np.concatenate(
        [np.linspace(0, lowest, STEPS)[1:-1] if lowest > 0 else [],
         np.linspace(lowest, highest, STEPS + 1)]
    )  # fmt: skip
    loads = np.outer(larger, shares(ratio))
    found = biaxial_response(law, loads, thickness)
    if found.reached < len(larger):
        problem = (
            f"the law carries no more than {larger[max(found.reached - 1, 0)]:.3g} kN/m at ratio "
            f"{ratio}: choose a lower stress range"
        )
        raise InputError(None, "loads", problem)
    keep = larger >= lowest
    return loads[keep], found.elongation[keep]
