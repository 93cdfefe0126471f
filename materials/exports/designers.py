"""Export linear constants per width: Oasys GSA ("Fabric Material"), Dlubal RFEM (FAQ 004396)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from .. import designers
from ..biaxial_patch import biaxial_response, largest_load
from ..card import MaterialCard
from ..forms.base import UNLIMITED
from .base import (
    MILLIMETRES,
    SHEARED,
    Export,
    ExportFormat,
    ExportRemarks,
    UnitsOptions,
    UnitSystem,
    heading,
    option,
)

#: Shear strain to which G is averaged without a range.
SHEAR = 0.1
#: Constants with a spread.
YARNS = ("warp", "fill")
#: Relative difference up to which a load or a strain counts as the end of the card's range.
ROUNDING = 1e-9
HELD = "the card does not hold so far, and its moduli stay as at the end of its range"
BESIDE_VALUES = UnitSystem("as beside each value")
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu_warp", "nu_fill": "nu_fill"}


@dataclass(frozen=True)
class ConstantsOptions(UnitsOptions):
    """The loads over which the law is made linear, and how."""

    lowest: float = option(0.0, "kN/m, where the paths of each load ratio begin [0].", smallest=0)
    highest: float | None = option(
        None,
        "kN/m, of the larger load of each ratio, where they end [the end of the card's range].",
        exclusive_minimum=0,
    )
    shear: float | None = option(
        None,
        "Shear strain up to which G is averaged [the end of the card's range].",
        exclusive_minimum=0,
        largest=1,
    )
    paths: Literal["8", "10"] = option(
        "8",
        "Strain paths of five ratios: 10 with unloaded yarns, 8 without [8].",
        str,
        choices=("8", "10"),
    )
    minimise: Literal["strain", "load"] = option(
        "strain", "Whose squares are least [strain].", str, choices=("strain", "load")
    )

    @property
    def units_of_card(self) -> UnitSystem:
        return MILLIMETRES


def _yarn(description: str, yarn: str, lower: float | None = None) -> Any:
    """Return an option of warp or fill that need not be given."""
    return option(None, f"{description}, {yarn} [not given].", smallest=lower)


@dataclass(frozen=True)
class SheetOptions(ConstantsOptions):
    """Numbers that a design program needs beside the stiffness; a card has neither."""

    prestress_warp: float | None = _yarn("kN/m, prestress", "warp", lower=0)
    prestress_fill: float | None = _yarn("kN/m, prestress", "fill", lower=0)
    kept_warp: float | None = _yarn("%, strain kept after load cycles", "warp")
    kept_fill: float | None = _yarn("%, strain kept after load cycles", "fill")


@dataclass(frozen=True, eq=False)
class LinearisedCard:
    """A card as constants, with the loads (kN/m) and the shear strain they are of."""

    card: MaterialCard
    evaluated: designers.LawConstants
    lowest: float
    highest: float
    shear: float

    @property
    def _beyond_range(self) -> list[str]:
        """Say which loads and shear lie beyond the card's range of strain."""
        ends = self.card.law.strain_range
        beyond = []
        if (ends[:2] < UNLIMITED).all():
            largest = _end_of_range(self.card)
            if self.highest > largest * (1 + ROUNDING):
                beyond.append(f"loads above {largest:.4g} kN/m: {HELD}")
        if SHEARED <= ends[2] < self.shear * (1 - ROUNDING):
            beyond.append(f"shear above {100 * ends[2]:.3g} %: {HELD}")
        return beyond

    @property
    def remarks(self) -> ExportRemarks:
        """Say what the constants carry and lose of the law."""
        constants = self.evaluated
        smallest, largest = constants.shear
        unknown: tuple[str, ...] = ()
        if self.card.law.strain_range[2] < SHEARED:
            unknown = (
                "G: nothing that the card was fitted to sheared the fabric; type in another",
            )
        spread = ", ".join(
            f"{NAMES[name]} {low:.4g} to {high:.4g}"
            for name, (low, high) in designers.spread_of(evaluations(self)).items()
        )
        losses = ", ".join(
            f"{name} {rms:.3g} of {constants.largest[name]:.3g} %"
            for name, rms in constants.misfit.items()
        )
        return ExportRemarks(
            carries=(
                f"straight lines of load over strain from {self.lowest:g} to {self.highest:.4g} "
                f"kN/m: least squares of the {constants.evaluation.options.minimise}s of "
                f"{constants.evaluation.paths} paths of ratios {', '.join(constants.misfit)}, "
                "reciprocal",
                f"G: mean tangent to a shear strain of {100 * self.shear:.3g} %",
            ),
            loses=(
                *unknown,
                *self._beyond_range,
                f"what is not straight: RMS of strain, by ratio: {losses}; "
                f"{constants.rms:.3g} % over all",
                f"over {1 + len(constants.alternatives)} choices of paths, squares and "
                f"reciprocity: {spread}",
                *(
                    []
                    if f"{smallest:.4g}" == f"{largest:.4g}"
                    else [f"G from {smallest:.4g} to {largest:.4g} kN/m along the shear"]
                ),
            ),
        )


def linear_card(card: MaterialCard, options: ConstantsOptions) -> LinearisedCard:
    """Return the constants of a card; InputError for loads that it does not carry."""
    law = card.law
    thickness = card.thickness
    highest = options.highest
    if highest is None:
        highest = _end_of_range(card)
    shear = options.shear
    if shear is None:
        end = law.strain_range[2]
        shear = end if SHEARED <= end < UNLIMITED else SHEAR
    chosen = designers.Options(options.paths == "10", True, options.minimise)
    constants = designers.constants_of_law(
        law,
        thickness,
        options.lowest,
        highest,
        shear,
        chosen,
    )
    c = constants.constants
    if not c.nu_warp * c.nu_fill < 1:
        problem = (
            f"nu_warp nu_fill is {c.nu_warp * c.nu_fill:.3g} between {options.lowest:g} and "
            f"{highest:.4g} kN/m; no program takes 1 or more: choose other loads"
        )
        raise InputError(None, "--highest", problem)
    return LinearisedCard(card, constants, options.lowest, highest, shear)


def evaluations(linear: LinearisedCard) -> list[designers.ConstantsEvaluation]:
    """Return the constants of the chosen options, then those of all others."""
    return [linear.evaluated.evaluation, *linear.evaluated.alternatives]


def _end_of_range(card: MaterialCard) -> float:
    """Return the largest load (kN/m) up to which all usual ratios stay in the card's strain range.

    InputError if the card does not say how far it holds.
    """
    ends = card.law.strain_range[:2]
    if not (ends < UNLIMITED).all():
        problem = "the card does not say how far its strains hold (valid_strain): give --highest"
        raise InputError(None, "--highest", problem)
    return largest_load(
        card.law, card.thickness, [designers.shares(ratio) for ratio in designers.RATIOS], ends
    )


WHICH_NU = (
    "which of both Poisson's ratios the program means: pull a strip along the warp and compare its "
    "width"
)

#: What it is, of warp and fill, and its unit.
Row = tuple[str, Sequence[float | None], str]


def _sheet(
    linear: LinearisedCard,
    description: str,
    stiffness: Sequence[tuple[str, float | None, str]],
    options: SheetOptions,
    *confirm: str,
) -> Export:
    """Return the stiffness, then prestress and compensation, each row with its unit."""
    card = linear.card
    remarks = linear.remarks
    missing = "not given"
    loads = options.prestress_warp, options.prestress_fill
    kept_strains = options.kept_warp, options.kept_fill
    strain: Sequence[float | None] = (None, None)
    for words, pressures_or_strains in (("prestress", loads), ("kept", kept_strains)):
        if sum(value is None for value in pressures_or_strains) == 1:
            field = f"--{words}-warp, --{words}-fill"
            raise InputError(None, field, "expected both yarns, got one")
    carries = remarks.carries
    loses = remarks.loses
    if None in loads:
        loses += ("prestress: a card has none (--prestress-warp, --prestress-fill)",)
    else:
        path = np.linspace(0.0, 1.0, designers.STEPS + 1)[1:, None] * np.array(loads, dtype=float)
        response = biaxial_response(card.law, path, card.thickness)
        if response.reached < len(path):
            problem = "the law does not carry it: choose a lower prestress"
            raise InputError(None, "--prestress-warp", problem)
        strain = (100 * response.elongation[-1]).tolist()
        carries += ("strain at the prestress: of the law itself, from the unloaded fabric",)
        if (np.log1p(response.elongation[-1]) > card.law.strain_range[:2]).any():
            loses += (f"strain at the prestress: {HELD}",)
    if None in kept_strains:
        loses += (
            "compensation: a card knows no strain kept after load cycles; `bubblefit biaxial` "
            "measures it (--kept-warp, --kept-fill)",
        )
    rows = [*stiffness]
    compensation: Row = ("compensation (strain kept)", kept_strains, "%")
    prestress: Row = ("prestress", loads, "kN/m")
    elastic: list[Row] = [("strain at the prestress", strain, "%")] if None not in strain else []
    for words, pair, unit in (prestress, *elastic, compensation):
        rows += [(f"{words}, {yarn}", value, unit) for yarn, value in zip(YARNS, pair, strict=True)]
    lines = []
    for name, value, unit in rows:
        size, unit_name = _unit(unit, options.unit_system)
        text = missing if value is None else f"{value / size:.6g}"
        lines.append(f"{name:34s}{text:>14s}  {unit_name}")
    remarks = ExportRemarks(carries, loses, (*remarks.confirm, WHICH_NU, *confirm))
    text = "\n".join([heading(card, description, remarks, "#", BESIDE_VALUES), *lines]) + "\n"
    return Export({".txt": text}, remarks)


def _unit(unit: str, units: UnitSystem) -> tuple[float, str]:
    """Return the size of a unit of these systems over ours, and its name."""
    if units is MILLIMETRES:
        return 1.0, unit
    named = {
        "kN/m": (units.megapascals * units.millimetres, units.per_width),
        "N/mm^2": (units.megapascals, units.stress),
        "mm": (units.millimetres, units.length),
    }
    return named.get(unit, (1.0, unit))


def gsa(card: MaterialCard, options: SheetOptions) -> Export:
    """Write the four fields of Oasys GSA's fabric: nu (warp-fill) is the fill's contraction."""
    linear = linear_card(card, options)
    c = linear.evaluated.constants
    rows = [
        ("Warp modulus", c.warp, "kN/m"),
        ("Weft modulus", c.fill, "kN/m"),
        ("Poisson's ratio (warp-weft)", c.nu_fill, "no unit"),
        ("Shear modulus", c.shear, "kN/m"),
    ]
    return _sheet(linear, "Fabric of Oasys GSA", rows, options)


def rfem(card: MaterialCard, options: SheetOptions) -> Export:
    """Write an orthotropic 2D material of Dlubal RFEM and the thickness of its surface."""
    linear = linear_card(card, options)
    c = linear.evaluated.constants
    t = card.thickness
    assert c.shear is not None
    rows = [
        ("E_x (warp)", c.warp / t, "N/mm^2"),
        ("E_y (fill)", c.fill / t, "N/mm^2"),
        ("nu_xy (fill contracts)", c.nu_fill, "no unit"),
        ("nu_yx (warp contracts)", c.nu_warp, "no unit"),
        ("G_xy", c.shear / t, "N/mm^2"),
        ("thickness d of the surface", t, "mm"),
    ]
    surface = "that the surface is a membrane, x along the warp"
    return _sheet(linear, "Orthotropic membrane of Dlubal RFEM", rows, options, surface)


COLUMNS = (
    "chosen",
    "minimise",
    "reciprocal",
    "unloaded_yarns",
    "ratios",
    "paths",
    "E_warp_kN_per_m",
    "E_fill_kN_per_m",
    "nu_warp",
    "nu_fill",
    "A_warp_kN_per_m",
    "A_fill_kN_per_m",
    "A_warp_fill_kN_per_m",
    "G_kN_per_m",
    "squares_percent2",
)


def constants(card: MaterialCard, options: ConstantsOptions) -> Export:
    """Write inverse form (E, nu) and direct form (A), G, and the same by every other choice."""
    linear = linear_card(card, options)
    size, unit = _unit("kN/m", options.unit_system)
    columns = ",".join(COLUMNS).replace("kN_per_m", unit.replace("/", "_per_"))
    rows = []
    for number, evaluation in enumerate(evaluations(linear)):
        row = {
            "chosen": "yes" if number == 0 else "",
            "G_kN_per_m": linear.evaluated.constants.shear,
            **designers.row_of(evaluation),
        }
        rows.append(",".join(_text(_scaled(name, row[name], size)) for name in COLUMNS))
    meaning = (
        "# nu_warp: contraction of the warp when the fill is pulled (nu_xy beside E_x, x the "
        "warp); nu_fill: of the fill when the warp is pulled (nu12 of the card's law)"
    )
    head = heading(card, "Constants per width", linear.remarks, "#", BESIDE_VALUES)
    return Export({".csv": "\n".join([head, meaning, columns, *rows]) + "\n"}, linear.remarks)


def _scaled(column: str, value: Any, size: float) -> Any:
    """Return a value of a column; loads in kN/m are divided by a size."""
    is_load = column.endswith("kN_per_m") and isinstance(value, float)
    return value / size if is_load else value


def _text(value: Any) -> str:
    """Return a value of a table as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


FORMATS = (
    ExportFormat("constants", constants, ConstantsOptions, load_ratios=True),
    ExportFormat("gsa", gsa, SheetOptions, load_ratios=True),
    ExportFormat("rfem", rfem, SheetOptions, load_ratios=True),
)
