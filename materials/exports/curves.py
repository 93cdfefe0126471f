"""Export total curves to explicit programs: Abaqus *FABRIC, LS-DYNA *MAT_FABRIC, Radioss.

Of Radioss' LAW58 (FABR_A) and LAW158 (FABR_NL) a function is the force of a yarn per reference
width by its elongation, which with small crimps is nominal stress by nominal strain; shear is by
the angle between the yarns in degrees. Columns as in OpenRadioss' readers (hm_read_mat58,
hm_read_mat158), which refuse a function that is level anywhere, and unloading that does not meet
loading on both sides of zero. Their default crimps S of 0.1 make a yarn 16 % softer at 5 % of
strain: they are written small enough not to count.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...storage.templates import render
from ..card import MaterialCard
from ..deformation_curves import MEASURES, Measure
from ..forms.base import Array
from . import base

#: Crimp that does not count.
CRIMP = 1e-4
#: Share of its modulus with which a yarn is pushed.
FLEX = 1e-3
#: Stress up to the permanent set, as a share of the largest: Radioss refuses a level function.
SMALLEST_RISE = 1e-6
#: Numbers of Radioss' functions; the first three are of loading.
FUNCTIONS = {
    "warp": 101,
    "fill": 102,
    "shear, degrees": 103,
    "warp unloading": 104,
    "fill unloading": 105,
    "shear unloading, degrees": 106,
}
LOADS = (
    "nominal stress by nominal strain of strips along warp and fill, and shear stress by the angle "
    "between the yarns in degrees, as functions"
)
UNLOADS = (
    "unloading curves of warp, fill and shear from the end of the range, without stress up to the "
    "permanent set"
)


def from_zero(rows: Array) -> Array:
    """Return an unloading curve (n, 2) with the strain without stress up to the permanent set.

    Parameters
    ----------
    rows : (n, 2) array
        Strain and stress (MPa) of the curve, from the permanent set on.
    """
    permanent_set = [rows[0, 0], 0.0]
    return np.vstack([[0.0, 0.0], permanent_set, rows[1:]])


def _radioss(card: MaterialCard, options: base.CurveOptions, number: int) -> base.Export:
    """Write /MAT/LAW58 or 158: functions of loading, of unloading if the law has a memory."""
    law = card.law
    curves = base.fabric_curves(card, options, "nominal")
    remarks = _remarks_of_radioss(card, options, curves, number)
    lock = curves.shear[-1, 0]
    shear = float(law.G12(0.0))
    text = render(
        "radioss/fabric.rad.j2",
        head=base.heading(card, f"Radioss /MAT/LAW{number}", remarks, "#", options.unit_system),
        law=number,
        title=base.title_of(card, 100),
        density=options.written_density,
        warp=float(law.E1(0.0)),
        fill=float(law.E2(0.0)),
        flex=FLEX,
        shear=shear,
        # The same slope over tan(angle) on both sides of the locking angle.
        locked=shear * (1 + math.tan(lock) ** 2),
        lock=math.degrees(lock),
        crimp=CRIMP,
        # LAW158 has FLEX in units of stress: so a yarn is pushed with the same share.
        bend=FLEX * ((1 + CRIMP) ** 2 - 1),
        ids=FUNCTIONS,
        functions=_functions(card, options, curves),
        f20=lambda value: f"{value:20.12E}",
    )
    return base.Export({".rad": text}, remarks)


def _functions(
    card: MaterialCard, options: base.CurveOptions, curves: base.FabricCurves
) -> dict[str, Array]:
    """Return tables of loading, and of unloading that ends where loading does, by their names."""
    unload = base.unloading_curves(card, options, "nominal").values()
    loads = [curves.warp[1:], curves.fill[1:], curves.shear]
    ends = [rows[-1] for rows in loads]
    tables = [*loads, *(_rising(rows, end) for rows, end in zip(unload, ends, strict=False))]
    for k in range(2, len(tables), 3):
        tables[k] = _odd(tables[k]) * [math.degrees(1.0), 1.0]
    return dict(zip(FUNCTIONS, tables, strict=False))


def _rising(rows: Array, end: Array) -> Array:
    """Return an unloading curve from zero to `end` that rises everywhere, if little at first.

    Parameters
    ----------
    rows : (n, 2) array
        Strain and stress of the curve, from the permanent set on.
    end : (2,) array
        Strain and stress of the last point.
    """
    curve = from_zero(rows)
    curve[-1] = end
    rise = SMALLEST_RISE * end[1] * curve[:, 0] / end[0]
    curve[:, 1] = np.maximum(curve[:, 1], rise)
    return curve


def _remarks_of_radioss(
    card: MaterialCard, options: base.CurveOptions, curves: base.FabricCurves, number: int
) -> base.ExportRemarks:
    """Return what the material block carries, what it loses, and what is to be confirmed."""
    unloads = card.law.memory is not None
    loses = [
        f"nu12 = {card.law.nu12:g}: the crimps S1, S2 that would couple warp and fill are "
        f"{CRIMP:g}; {curves.uncoupled}",
        f"compression: a yarn is pushed with {FLEX:g} of its modulus (FLEX)",
        base.FROM_TOP if unloads else base.TOTAL,
        *options.remarks(card),
    ]
    return base.ExportRemarks(
        carries=(LOADS, *((UNLOADS,) if unloads else ())),
        loses=tuple(loses),
        confirm=(
            f"the measure of strain of LAW{number} (that of OpenRadioss' source of 2026, the "
            "elongation of a yarn), with one element of each test",
            "/PROP/TYPE16 with the warp as its first direction",
            *((SCALED,) if unloads else ()),
        ),
    )


MATERIAL = 1
CURVES = {
    "warp": 101,
    "fill": 102,
    "shear": 103,
    "warp unloading": 104,
    "fill unloading": 105,
    "shear unloading": 106,
    "warp biaxial": 107,
    "fill biaxial": 108,
}
SHIFTED = "unloading from the end of the range, shifted to where it begins"
SCALED = (
    "how the program takes an unloading curve to a smaller largest strain (LAW58 scales strain and "
    "stress, which keeps the share of the set), with a strip of one element that is unloaded twice"
)
NAMES = {
    "green": "2nd Piola-Kirchhoff stress by Green-Lagrange strain (shear: engineering, 2 E12)",
    "nominal": "nominal stress by nominal strain (shear: change of angle, radians)",
    "true": "Cauchy stress by log strain (shear: engineering)",
}


@dataclass(frozen=True)
class CurveReader:
    """A program that reads *MAT_FABRIC: its name, the measure it takes, and where that is from."""

    name: str
    measure: Measure
    source: str
    form: str = "14"


#: By the choice of `--for`.
READERS: Mapping[str, CurveReader] = {
    "ls-dyna": CurveReader(
        "LS-DYNA",
        "green",
        "public sources disagree (the manual names Green-Lagrange strain for FORM 2, 4, 12 and "
        "14, a converter nominal strain)",
        "-14",
    ),
    "radioss": CurveReader(
        "Radioss' reader of LS-DYNA files",
        "true",
        "Altair's guide names true stress and true strain for FUNC_1 to FUNC_3 of this card; "
        "OpenRadioss' converter takes them otherwise (--for openradioss)",
    ),
    "openradioss": CurveReader(
        "OpenRadioss' converter",
        "nominal",
        "by its source of 2026 it takes a point x, y of a yarn to ln(1 + x), y (1 + x), and x of "
        "shear to 57 x degrees, for LAW58, which reads nominal strain; points are such that LAW58 "
        "gets the measure above (--format radioss-law58 has no converter between)",
    ),
}
#: Degrees in a radian, as OpenRadioss' converter has them.
CONVERTER_DEGREES = 57.0


@dataclass(frozen=True)
class Mat34Options(base.CurveOptions):
    """The options of curves, their reader and measure, and the formulation of the membrane."""

    for_: str = base.option(
        "ls-dyna",
        "Program that is to read the card, which decides on --measure and --form [ls-dyna].",
        str,
        choices=tuple(READERS),
    )
    measure: Measure | None = base.option(  # noqa: RUF009
        None, "Measure of the curves [that of --for: green, true].", str, choices=MEASURES
    )
    form: str | None = base.option(
        None,
        "FORM of *MAT_FABRIC: -14 has curves of equal strain of both yarns, 24 Poisson's ratios "
        "[-14 for LS-DYNA, 14 for Radioss].",
        str,
        choices=("-14", "14", "24"),
    )
    compression: Literal["law", "none"] = base.option(
        "law",
        "What a pushed yarn carries: as the law (CSE = 0), or none (CSE = 1) [law].",
        str,
        choices=("law", "none"),
    )

    @property
    def reader(self) -> CurveReader:
        return READERS[self.for_]

    @property
    def written_measure(self) -> Measure:
        return self.measure or self.reader.measure

    @property
    def written_form(self) -> str:
        return self.form or self.reader.form


#: By the choice of what a pushed yarn carries.
PUSHED = {
    "law": f"compression: CSE = 0, and one point of LCA and LCB at {100 * base.COMPRESSION:g} % of "
    "log strain pushes a yarn as the card's law does: the fabric folds by its mesh only "
    "(--compression none is the other choice)",
    "none": "no compression: CSE = 1, and LCA and LCB begin at zero, so that the fabric goes "
    "slack, and elements may collapse to a line",
}


def mat34(card: MaterialCard, options: Mat34Options) -> base.Export:
    """Write *MAT_FABRIC and its *DEFINE_CURVE blocks, fixed columns of 10 and 20."""
    if options.for_ != "ls-dyna" and options.written_form != "14":
        problem = f"{options.reader.name} takes curves of FORM 14 alone: leave it out"
        raise InputError(None, "--form", problem)
    measure = options.written_measure
    curves = base.fabric_curves(card, options, measure)
    slack = options.compression == "none"
    tables = {"warp": curves.warp[slack:], "fill": curves.fill[slack:], "shear": curves.shear}
    unload = base.unloading_curves(card, options, measure)
    tables |= {f"{name} unloading": from_zero(rows) for name, rows in unload.items()}
    if options.written_form == "-14":
        tables |= base.equibiaxial_curves(card, options, measure)
    if options.for_ == "openradioss" and options.measure is None:
        tables = {name: _before_conversion(name, rows) for name, rows in tables.items()}
    for name in ("shear", "shear unloading"):
        if name in tables:
            tables[name] = _odd(tables[name])
    remarks = _remarks_of_mat34(card, options, curves)
    law = card.law
    e1 = float(law.E1(0.0))
    e2 = float(law.E2(0.0))
    text = render(
        "ls-dyna/mat34.k.j2",
        head=base.heading(card, "LS-DYNA *MAT_FABRIC", remarks, "$", options.unit_system),
        title=base.title_of(card, 80),
        material=MATERIAL,
        density=options.written_density,
        ea=e1,
        eb=e2,
        gab=float(law.G12(0.0)),
        prab=law.nu12,
        prba=law.nu12 * e2 / e1,
        ids={name: number if name in tables else 0 for name, number in CURVES.items()},
        curves=tables,
        form=int(options.written_form),
        cse=float(slack),
        unit=options.unit_system.stress,
        f10=_f10,
    )
    return base.Export({".k": text}, remarks)


def _before_conversion(name: str, rows: Array) -> Array:
    """Return the points (n, 2) that OpenRadioss' converter takes to nominal ones.

    Parameters
    ----------
    name : str
        Name of the curve.
    rows : (n, 2) array
        Nominal strain and stress.
    """
    strain, stress = rows.T
    if name.startswith("shear"):
        return np.column_stack([np.degrees(strain) / CONVERTER_DEGREES, stress])
    return np.column_stack([np.expm1(strain), stress * np.exp(-strain)])


def _remarks_of_mat34(
    card: MaterialCard, options: Mat34Options, curves: base.FabricCurves
) -> base.ExportRemarks:
    """Return what *MAT_FABRIC carries, what it loses, and what is to be confirmed."""
    reader = options.reader
    unloads = card.law.memory is not None
    coupling: dict[str, Any] = {
        "14": "nu12: FORM 14 with curves does not couple warp and fill; " + curves.uncoupled,
        "-14": "nu12 between a strip and equal strain of both yarns, where FORM -14 goes straight "
        "from LCA to LCAA and from LCB to LCBB",
        "24": "nu12 but for PRAB and PRBA, of no strain, which act in FORM 24",
    }
    biaxial = (
        "curves LCAA (warp), LCBB (fill): the card's stress while both yarns have the same strain"
    )
    return base.ExportRemarks(
        carries=(
            f"for {reader.name}: curves LCA (warp), LCB (fill), LCAB (shear): "
            f"{NAMES[options.written_measure]}; of strips free to contract, and of shear with "
            "yarns held at their length",
            *((biaxial,) if options.written_form == "-14" else ()),
            "EA, EB, GAB and the Poisson's ratios of no strain, which LS-DYNA needs for its time "
            "step and contact",
            PUSHED[options.compression],
            *((f"{UNLOADS} (LCUA, LCUB, LCUAB); RL = 0",) if unloads else ()),
        ),
        loses=(
            *(
                ("the stiffness of the law in compression",)
                if options.compression == "none"
                else ()
            ),
            coupling[options.written_form],
            f"stress along the yarns in shear alone (2nd Piola-Kirchhoff, up to "
            f"{curves.largest_yarn_stress:.3g} {options.unit_system.stress} in the card)",
            "membrane elements only (ELFORM 5 or 9): no bending stiffness",
            base.FROM_TOP if unloads else base.TOTAL,
            *options.remarks(card),
        ),
        confirm=(
            f"the measure of the curves: {reader.source}; --measure green, nominal or true writes "
            "another; a strip of one element that is stretched far tells",
            *((SCALED,) if unloads else ()),
            "that LCAB is taken as odd in the shear strain, and that CSE acts on curves of FORM "
            f"{options.written_form}",
            *(
                ("stress of one element while both yarns are stretched alike",)
                if options.written_form != "14"
                else ()
            ),
        ),
    )


def _odd(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a curve (n, 2) from zero with its mirror image at negative strain and stress."""
    return np.concatenate([-rows[:0:-1], rows])


def _f10(value: float) -> str:
    """Return a number in ten characters, with as many digits as they hold."""
    for digits in range(9, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 10:
            return f"{text:>10}"
    return f"{value:10.3E}"


LAW58 = base.ExportFormat(
    "radioss-law58", partial(_radioss, number=58), base.CurveOptions, unloads=True
)
LAW158 = base.ExportFormat("radioss-law158", partial(_radioss, number=158), base.CurveOptions)
MAT34 = base.ExportFormat("ls-dyna-mat34", mat34, Mat34Options, unloads=True)


def fabric(card: MaterialCard, options: base.CurveOptions) -> base.Export:
    """Write *MATERIAL with *FABRIC and three *UNIAXIAL tests, and how to orient it."""
    curves = base.fabric_curves(card, options, "nominal")
    # A curve is shifted to where unloading begins: its own strain begins at the set.
    unload = {
        name: from_zero(rows)[1:] - [rows[0, 0], 0.0]
        for name, rows in base.unloading_curves(card, options, "nominal").items()
    }
    remarks = base.ExportRemarks(
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
            f"stress along the yarns in shear alone (up to {curves.largest_yarn_stress:.3g} "
            f"{options.unit_system.stress} in the card)",
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
        head=base.heading(card, "Abaqus/Explicit *FABRIC", remarks, "**", options.unit_system),
        name=material_name(card),
        density=options.written_density,
        unit=options.unit_system.stress,
        tests=[(1, curves.warp.tolist()), (2, curves.fill.tolist())],
        shear=curves.shear.tolist(),
        unload={name: rows.tolist() for name, rows in unload.items()},
    )
    return base.Export({".inp": text}, remarks)


def material_name(card: MaterialCard) -> str:
    """Return a name for Abaqus and CalculiX: letters, digits and underscores, a letter first."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in card.name.upper())
    name = name.strip("_")[:32]
    return name if name[:1].isalpha() else "FABRIC"


FABRIC = base.ExportFormat("abaqus-fabric", fabric, base.CurveOptions, unloads=True)
