"""Export total curves to explicit programs: Abaqus *FABRIC, LS-DYNA *MAT_FABRIC, Radioss LAW58.

Of LAW58 (FABR_A) yarns obey sigma = E eps - B eps^2/2, and the angle a between them tau = G0 tan(a)
up to the locking angle, from there on with GT / (1 + tan^2). Columns as in OpenRadioss' reader
(matl58_fabr_a, hm_read_mat58), whose own crimps S of 0.1 make a yarn 16 % softer at 5 % of strain:
they are written small enough not to count.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from ...storage.templates import render
from ..card import MaterialCard
from ..deformation_curves import MEASURES, Measure, trellis_angle, trellis_curve, uniaxial_curve
from ..forms.base import UNLIMITED, Array
from ..law import HypoelasticLaw
from . import base
from .designers import SHEARED

#: Crimp that does not count.
CRIMP = 1e-4
#: Share of its modulus with which a yarn is pushed.
FLEX = 1e-3
POINTS = 121
#: Number of the first function of Radioss, of six.
FUNCTION = 101
FUNCTIONS = (
    "nominal stress of strips along warp and fill, and of shear by the angle between the yarns, as "
    "functions; E, B, G0, GT beside them are those nearest to the curves"
)
UNLOADS = (
    "unloading curves of warp, fill and shear from the end of the range, without stress up to the "
    "permanent set"
)


def from_zero(rows: Array) -> Array:
    """Return an unloading curve (n, 2) with the strain without stress up to the permanent set."""
    return np.vstack([np.zeros((1, 2)), [[rows[0, 0], 0.0]], rows[1:]])


@dataclass(frozen=True, eq=False)
class Yarn:
    """sigma = E eps - B eps^2/2 nearest to a curve; rms_error : RMS over its largest stress."""

    modulus: float
    softening: float
    rms_error: float
    stiffens: bool


@dataclass(frozen=True)
class Law58Options(base.CurveOptions):
    points: int = field(
        default=POINTS, metadata=base.ExportTableOptions.__dataclass_fields__["points"].metadata
    )


def yarn_of(strain: Array, stress: Array) -> Yarn:
    """Fit by least squares; without softening where the curve stiffens: B has to be positive."""
    columns = np.column_stack([strain, -0.5 * strain**2])
    modulus, softening = np.linalg.lstsq(columns, stress, rcond=None)[0].tolist()
    stiffens = not (softening > 0 and modulus > 0)
    if stiffens:
        modulus = float(strain @ stress / (strain @ strain))
        softening = 0.0
    off = stress - columns @ [modulus, softening]
    rms = float(np.sqrt(np.mean(off**2)) / np.abs(stress).max())
    return Yarn(modulus, softening, rms, stiffens)


@dataclass(frozen=True)
class TrellisShear:
    """Shear by the angle between the yarns as LAW58 has it: G0 tan(a), the same slope beyond.

    Parameters
    ----------
    g0, gt : float
        MPa, up to the locking angle and beyond.
    lock : float
        Locking angle, radians.
    rms_error : float
        RMS error over the largest stress.
    """

    g0: float
    gt: float
    lock: float
    rms_error: float

    @classmethod
    def of(cls, law: HypoelasticLaw, end: float, points: int) -> Self:
        """Fit the trellis shear of a law up to a shear strain."""
        angle = np.linspace(0.0, trellis_angle(end), points)
        angle, stress, _ = trellis_curve(law, angle, "nominal")
        tangent = np.tan(angle)
        g0 = float(tangent @ stress / (tangent @ tangent))
        lock = float(angle[-1])
        # The same slope on both sides of the locking angle; so GT is above G0.
        gt = g0 * (1 + math.tan(lock) ** 2)
        off = float(np.sqrt(np.mean((stress - g0 * tangent) ** 2)) / stress.max())
        return cls(g0, gt, lock, off)


def law58(card: MaterialCard, options: Law58Options) -> base.Export:
    """Write the material block from nominal curves of strips and trellis shear."""
    law = card.law
    ends = [float(end) if end < UNLIMITED else options.reach for end in law.strain_range]
    is_sheared = ends[2] >= SHEARED
    yarns = []
    for pulled in range(2):
        strain = np.linspace(0.0, ends[pulled], options.points)
        yarns.append(yarn_of(*uniaxial_curve(law, pulled, strain, "nominal")))
    warp, fill = yarns
    shear = TrellisShear.of(law, ends[2] if is_sheared else options.reach, options.points)
    curves: base.FabricCurves = base.fabric_curves(card, options, "nominal")
    functions = _functions_of_unloading(card, options, curves)
    says = _said_of_law58(
        card,
        options,
        curves,
        warp,
        fill,
        shear,
        is_sheared,
        bool(functions),
    )
    text = render(
        "radioss/law58.rad.j2",
        head=base.heading(card, "Radioss /MAT/LAW58", says, "#"),
        title=base.title_of(card, 100),
        density=base.DENSITY if options.density is None else options.density,
        warp=warp,
        fill=fill,
        flex=FLEX,
        g0=shear.g0,
        gt=shear.gt,
        lock=math.degrees(shear.lock),
        crimp=CRIMP,
        functions=functions,
        f20=lambda value: f"{value:20.12E}",
    )
    return base.Export({".rad": text}, says)


def _functions_of_unloading(
    card: MaterialCard, options: Law58Options, curves: base.FabricCurves
) -> dict[int, Array]:
    """Return tables of loading and unloading by the number of the function; none without them."""
    unload = base.unloading_curves(card, options, "nominal")
    if not unload:
        return {}
    tables = [curves.warp[1:], curves.fill[1:], curves.shear, *map(from_zero, unload.values())]
    for k in (2, 5):  # of the angle between the yarns, in degrees
        tables[k] = tables[k] * [math.degrees(1.0), 1.0]
    return dict(enumerate(tables, start=FUNCTION))


def _said_of_law58(
    card: MaterialCard,
    options: Law58Options,
    curves: base.FabricCurves,
    warp: Yarn,
    fill: Yarn,
    shear: TrellisShear,
    is_sheared: bool,
    has_functions: bool,
) -> base.Says:
    """Return what the material block carries, what it loses, and what is to be confirmed."""
    carries: tuple[str, ...] = (
        f"nominal stress of strips along warp and fill as E eps - B eps^2/2, off by "
        f"{100 * warp.rms_error:.2g} and {100 * fill.rms_error:.2g} % of the largest (RMS)",
        f"shear by the angle between the yarns as G0 tan(a), off by {100 * shear.rms_error:.2g} %, "
        f"to {math.degrees(shear.lock):.3g} degrees and with the same slope beyond",
    )
    confirm = [
        "the measure of strain of LAW58 (the change of length over the length is taken), with "
        "one element of each test",
        "/PROP/TYPE16 with the warp as its first direction",
    ]
    loses = [
        f"nu12 = {card.law.nu12:g}: the crimps S1, S2 that would couple warp and fill are "
        f"{CRIMP:g}; {curves.uncoupled}"
    ]
    if not is_sheared:
        loses.append(
            "G0, GT: nothing that the card was fitted to sheared the fabric; type in others"
        )
    stiffening = [name for name, yarn in (("warp", warp), ("fill", fill)) if yarn.stiffens]
    if has_functions:
        carries = (FUNCTIONS, UNLOADS)
        confirm.append(SCALED)
    elif stiffening:
        loses.append(
            f"the stiffening along {' and '.join(stiffening)}: B has to be positive, a mean E is "
            "written"
        )
    loses += [
        f"compression: a yarn is pushed with {FLEX:g} of its modulus (FLEX)",
        base.FROM_TOP if has_functions else base.TOTAL,
        *options.remarks(card),
    ]
    return base.Says(carries=carries, loses=tuple(loses), confirm=tuple(confirm))


LAW58 = base.ExportFormat("radioss-law58", law58, Law58Options, unloads=True)
MATERIAL = 1
CURVES = {"warp": 101, "fill": 102, "shear": 103}
UNLOADING = {"warp unloading": 104, "fill unloading": 105, "shear unloading": 106}
SHIFTED = "unloading from the end of the range, shifted to where it begins"
SCALED = (
    "how the program takes an unloading curve to a smaller largest strain (LAW58 scales strain and "
    "stress, which keeps the share of the set), with a strip of one element that is unloaded twice"
)
MEASURE: Measure = "green"
NAMES = {
    "green": "2nd Piola-Kirchhoff stress by Green-Lagrange strain (shear: engineering, 2 E12)",
    "nominal": "nominal stress by nominal strain (shear: change of angle, radians)",
    "true": "Cauchy stress by log strain (shear: engineering)",
}


@dataclass(frozen=True)
class Mat34Options(base.CurveOptions):
    """The options of curves, and their measure: public sources disagree."""

    measure: Measure = base.option(  # noqa: RUF009
        MEASURE, f"Measure of LS-DYNA's curves [{MEASURE}].", str, choices=MEASURES
    )
    compression: Literal["law", "none"] = base.option(
        "law",
        "What a pushed yarn carries: as the law (CSE = 0), or none (CSE = 1) [law].",
        str,
        choices=("law", "none"),
    )


#: By the choice of what a pushed yarn carries.
PUSHED = {
    "law": f"compression: CSE = 0, and one point of LCA and LCB at {100 * base.COMPRESSION:g} % of "
    "log strain pushes a yarn as the card's law does: the fabric folds by its mesh only "
    "(--compression none is the other choice)",
    "none": "no compression: CSE = 1, and LCA and LCB begin at zero, so that the fabric goes "
    "slack, and elements may collapse to a line",
}


def mat34(card: MaterialCard, options: Mat34Options) -> base.Export:
    """Write *MAT_FABRIC and three *DEFINE_CURVE, fixed columns of 10 and 20."""
    measure = options.measure
    slack = options.compression == "none"
    curves = base.fabric_curves(card, options, measure)
    law = card.law
    strips = {"warp": curves.warp[slack:], "fill": curves.fill[slack:]}
    unload = {
        f"{n} unloading": from_zero(rows)
        for n, rows in base.unloading_curves(card, options, measure).items()
    }
    if unload:
        unload["shear unloading"] = _odd(unload["shear unloading"])
    losses = ("the stiffness of the law in compression",) if slack else ()
    says = base.Says(
        carries=(
            f"curves LCA (warp), LCB (fill), LCAB (shear): {NAMES[measure]}; of strips free to "
            "contract, and of shear with yarns held at their length",
            "EA, EB, GAB and the Poisson's ratios of no strain, which LS-DYNA needs for its time "
            "step and contact",
            PUSHED[options.compression],
            *((f"{UNLOADS} (LCUA, LCUB, LCUAB); RL = 0",) if unload else ()),
        ),
        loses=(
            *losses,
            "nu12: FORM 14 with curves does not couple warp and fill; " + curves.uncoupled,
            f"stress along the yarns in shear alone (2nd Piola-Kirchhoff, up to "
            f"{curves.yarns:.3g} MPa in the card)",
            "membrane elements only (ELFORM 5 or 9): no bending stiffness",
            base.FROM_TOP if unload else base.TOTAL,
            *options.remarks(card),
        ),
        confirm=(
            "the measure of the curves: public sources disagree (the manual names "
            "Green-Lagrange strain for FORM 2, 4, 12 and 14, a converter true strain); "
            "--measure green, nominal or true writes another; a strip of one element that is "
            "stretched far tells",
            *((SCALED,) if unload else ()),
            "that LCAB is taken as odd in the shear strain, and that CSE acts on curves of FORM 14",
        ),
    )
    e1 = float(law.E1(0.0))
    e2 = float(law.E2(0.0))
    text = render(
        "ls-dyna/mat34.k.j2",
        head=base.heading(card, "LS-DYNA *MAT_FABRIC", says, "$"),
        title=base.title_of(card, 80),
        material=MATERIAL,
        density=base.DENSITY if options.density is None else options.density,
        ea=e1,
        eb=e2,
        gab=float(law.G12(0.0)),
        prab=law.nu12,
        prba=law.nu12 * e2 / e1,
        ids={**CURVES, **dict.fromkeys(UNLOADING, 0), **(UNLOADING if unload else {})},
        curves={**strips, "shear": _odd(curves.shear), **unload},
        cse=float(slack),
        f10=_f10,
    )
    return base.Export({".k": text}, says)


def _odd(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([-rows[:0:-1], rows])


def _f10(value: float) -> str:
    for digits in range(9, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 10:
            return f"{text:>10}"
    return f"{value:10.3E}"


MAT34 = base.ExportFormat("ls-dyna-mat34", mat34, Mat34Options, unloads=True)


def fabric(card: MaterialCard, options: base.CurveOptions) -> base.Export:
    """Write *MATERIAL with *FABRIC and three *UNIAXIAL tests, and how to orient it."""
    curves = base.fabric_curves(card, options, "nominal")
    # A curve is shifted to where unloading begins: its own strain begins at the set.
    unload = {
        name: from_zero(rows)[1:] - [rows[0, 0], 0.0]
        for name, rows in base.unloading_curves(card, options, "nominal").items()
    }
    says = base.Says(
        carries=(
            "nominal stress by nominal strain of strips along warp and fill, free to contract, "
            "and shear stress by change of angle"
            + ("" if unload else ": both elastic, path-independent"),
            *((SHIFTED,) if unload else ()),
        ),
        loses=(
            f"nu12 = {card.law.nu12:g}: warp, fill and shear are independent in *FABRIC; "
            + curves.uncoupled,
            "Abaqus/Explicit only; Abaqus/Standard needs --format abaqus-umat",
            f"stress along the yarns in shear alone (up to {curves.yarns:.3g} MPa in the card)",
            base.FROM_TOP if unload else base.TOTAL,
            *options.remarks(card),
        ),
        confirm=(
            "the order stress, strain of the data lines, and the sign and measure of the shear "
            "(radians between the yarns), with one element of each test",
            *(
                (
                    "TYPE=PERMANENT DEFORMATION with DEFINITION=SHIFTED CURVE, with a strip of one "
                    "element that is unloaded twice",
                )
                if unload
                else ()
            ),
        ),
    )
    text = render(
        "abaqus/fabric.inp.j2",
        head=base.heading(card, "Abaqus/Explicit *FABRIC", says, "**"),
        name=material_name(card),
        density=base.DENSITY if options.density is None else options.density,
        tests=[(1, curves.warp.tolist()), (2, curves.fill.tolist())],
        shear=curves.shear.tolist(),
        unload={name: rows.tolist() for name, rows in unload.items()},
    )
    return base.Export({".inp": text}, says)


def material_name(card: MaterialCard) -> str:
    """Return a name for Abaqus and CalculiX: letters, digits and underscores, a letter first."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in card.name.upper())
    name = name.strip("_")[:32]
    return name if name[:1].isalpha() else "FABRIC"


FABRIC = base.ExportFormat("abaqus-fabric", fabric, base.CurveOptions, unloads=True)
