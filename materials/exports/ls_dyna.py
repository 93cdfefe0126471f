"""LS-DYNA: *MAT_FABRIC (34) with load curves, FORM = 14."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...files import render
from ..card import MaterialCard
from ..responses import MEASURES, Measure
from .base import (
    DENSITY,
    CurveOptions,
    Export,
    Format,
    Says,
    density_remarks,
    fabric_curves,
    heading,
    option,
    range_remarks,
    title_of,
)

MATERIAL = 1
CURVES = {"warp": 101, "fill": 102, "shear": 103}
MEASURE: Measure = "green"
NAMES = {
    "green": "2nd Piola-Kirchhoff stress by Green-Lagrange strain (shear: engineering, 2 E12)",
    "nominal": "nominal stress by nominal strain (shear: change of angle, radians)",
    "true": "Cauchy stress by log strain (shear: engineering)",
}


@dataclass(frozen=True)
class Mat34Options(CurveOptions):
    """The measure of the curves, too: public sources disagree."""

    measure: Measure = field(
        default=MEASURE,
        metadata=option(f"Measure of LS-DYNA's curves [{MEASURE}].", str, choices=MEASURES),
    )


def mat34(card: MaterialCard, options: Mat34Options) -> Export:
    """*MAT_FABRIC and three *DEFINE_CURVE, fixed columns of 10 and 20."""
    measure = options.measure
    curves, law = fabric_curves(card, options, measure), card.law
    says = Says(
        carries=(
            f"curves LCA (warp), LCB (fill), LCAB (shear): {NAMES[measure]}; of strips free to "
            "contract, and of shear with yarns held at their length",
            "EA, EB, GAB and the Poisson's ratios of no strain, which LS-DYNA needs for its time "
            "step and contact",
        ),
        loses=(
            "nu12: FORM 14 with curves does not couple warp and fill; " + curves.uncoupled,
            f"stress along the yarns in shear alone (2nd Piola-Kirchhoff, up to "
            f"{curves.yarns:.3g} MPa in the card)",
            "membrane elements only (ELFORM 5 or 9): no bending stiffness",
            "hypoelasticity: the curves are total ones; unloading is along the same curve",
            *density_remarks(options.density),
            *range_remarks(card, options.reach),
        ),
        confirm=(
            "the measure of the curves: public sources disagree (the manual names "
            "Green-Lagrange strain for FORM 2, 4, 12 and 14, a converter true strain); "
            "--measure green, nominal or true writes another; a strip of one element that is "
            "stretched far tells",
            "that LCAB is taken as odd in the shear strain",
        ),
    )
    e1, e2 = float(law.E1(0.0)), float(law.E2(0.0))
    text = render(
        "ls-dyna/mat34.k.j2",
        head=heading(card, "LS-DYNA *MAT_FABRIC", says, "$"),
        title=title_of(card, 80),
        material=MATERIAL,
        density=DENSITY if options.density is None else options.density,
        ea=e1,
        eb=e2,
        gab=float(law.G12(0.0)),
        prab=law.nu12,
        prba=law.nu12 * e2 / e1,
        ids=CURVES,
        curves={"warp": curves.warp, "fill": curves.fill, "shear": _odd(curves.shear)},
        f10=_f10,
    )
    return Export({".k": text}, says)


def _odd(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([-rows[:0:-1], rows])


def _f10(value: float) -> str:
    """As many digits as ten columns hold."""
    for digits in range(9, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 10:
            return f"{text:>10}"
    return f"{value:10.3E}"


FORMAT = Format("ls-dyna-mat34", mat34, Mat34Options)
