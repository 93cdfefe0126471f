"""Radioss and OpenRadioss: /MAT/LAW58 (FABR_A), by its moduli.

Yarns obey sigma = E eps - B eps^2/2, and the angle a between them tau = G0 tan(a) up to the locking
angle, from there on with GT / (1 + tan^2). Columns as in OpenRadioss' reader (cfg radioss2017,
matl58_fabr_a; starter hm_read_mat58). Left to itself the reader takes crimps S of 0.1, by which a
yarn is 16 % softer at 5 % of strain than its modulus says; they are written small enough not to
count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...files import render
from ..card import MaterialCard
from ..forms.base import UNLIMITED
from ..responses import trellis_angle, trellis_curve, uniaxial_curve
from .base import (
    DENSITY,
    CurveOptions,
    Export,
    FabricCurves,
    Format,
    Says,
    TableOptions,
    density_remarks,
    fabric_curves,
    heading,
    range_remarks,
    title_of,
)
from .designers import SHEARED

Array = NDArray[np.float64]
#: Crimp that does not count, and the share of its modulus with which a yarn is pushed.
CRIMP, FLEX = 1e-4, 1e-3
POINTS = 121


@dataclass(frozen=True, eq=False)
class Yarn:
    """sigma = E eps - B eps^2/2 nearest to a curve; off : RMS over its largest stress."""

    modulus: float
    softening: float
    off: float
    stiffens: bool


@dataclass(frozen=True)
class Law58Options(CurveOptions):
    """Those of curves."""

    points: int = field(
        default=POINTS, metadata=TableOptions.__dataclass_fields__["points"].metadata
    )


def yarn_of(strain: Array, stress: Array) -> Yarn:
    """The least squares; without softening where the curve stiffens: B has to be positive."""
    both = np.column_stack([strain, -0.5 * strain**2])
    modulus, softening = np.linalg.lstsq(both, stress, rcond=None)[0].tolist()
    stiffens = not (softening > 0 and modulus > 0)
    if stiffens:
        modulus, softening = float(strain @ stress / (strain @ strain)), 0.0
    off = stress - both @ [modulus, softening]
    rms = float(np.sqrt(np.mean(off**2)) / np.abs(stress).max())
    return Yarn(modulus, softening, rms, stiffens)


def law58(card: MaterialCard, options: Law58Options) -> Export:
    """The material block; curves of strips and of trellis shear, nominal, to the card's range."""
    law = card.law
    ends = [float(end) if end < UNLIMITED else options.reach for end in law.strain_range]
    sheared = ends[2] >= SHEARED
    ends[2] = ends[2] if sheared else options.reach
    unknown = () if sheared else (
        "G0, GT: nothing that the card was fitted to sheared the fabric; type in others",
    )  # fmt: skip
    yarns = []
    for pulled in range(2):
        strain = np.linspace(0.0, ends[pulled], options.points)
        yarns.append(yarn_of(*uniaxial_curve(law, pulled, strain, "nominal")))
    warp, fill = yarns
    angle = np.linspace(0.0, trellis_angle(ends[2]), options.points)
    angle, tau, _ = trellis_curve(law, angle, "nominal")
    tangent = np.tan(angle)
    g0 = float(tangent @ tau / (tangent @ tangent))
    lock = float(angle[-1])
    # The same slope on both sides of the locking angle; so GT is above G0.
    gt = g0 * (1 + math.tan(lock) ** 2)
    shear_off = float(np.sqrt(np.mean((tau - g0 * tangent) ** 2)) / tau.max())
    curves: FabricCurves = fabric_curves(card, options, "nominal")
    straight = [name for name, yarn in (("warp", warp), ("fill", fill)) if yarn.stiffens]
    stiffens = (
        (f"the stiffening along {' and '.join(straight)}: B has to be positive, a mean E is "
         "written",) if straight else ()
    )  # fmt: skip
    says = Says(
        carries=(
            f"nominal stress of strips along warp and fill as E eps - B eps^2/2, off by "
            f"{100 * warp.off:.2g} and {100 * fill.off:.2g} % of the largest (RMS)",
            f"shear by the angle between the yarns as G0 tan(a), off by {100 * shear_off:.2g} %, "
            f"to {math.degrees(lock):.3g} degrees and with the same slope beyond",
        ),
        loses=(
            f"nu12 = {law.nu12:g}: the crimps S1, S2 that would couple warp and fill are {CRIMP:g};"
            f" {curves.uncoupled}",
            *unknown,
            *stiffens,
            f"compression: a yarn is pushed with {FLEX:g} of its modulus (FLEX)",
            "hypoelasticity: the curves are total ones; unloading is along the same curve",
            *density_remarks(options.density),
            *range_remarks(card, options.reach),
        ),
        confirm=(
            "the measure of strain of LAW58 (the change of length over the length is taken), with "
            "one element of each test",
            "/PROP/TYPE16 with the warp as its first direction",
        ),
    )
    text = render(
        "radioss/law58.rad.j2",
        head=heading(card, "Radioss /MAT/LAW58", says, "#"),
        title=title_of(card, 100),
        density=DENSITY if options.density is None else options.density,
        warp=warp,
        fill=fill,
        flex=FLEX,
        g0=g0,
        gt=gt,
        lock=math.degrees(lock),
        crimp=CRIMP,
        f20=lambda value: f"{value:20.12E}",
    )
    return Export({".rad": text}, says)


FORMAT = Format("radioss-law58", law58, Law58Options)
