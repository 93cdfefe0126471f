"""Common parts of all exports: formats and their options, headings, curves, and CSV tables."""

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, OutputError, check_one_of, one_line
from ...notes import Note, NoteKind
from ...storage.writing import write_text
from ...version import __version__
from ..card import LEVEL, MaterialCard, strains_of
from ..deformation_curves import (
    Measure,
    equibiaxial_curve,
    trellis_angle,
    trellis_curve,
    uniaxial_curve,
)
from ..forms.base import COMPONENTS, STRAIN_NAMES, UNLIMITED, Array
from ..law import HypoelasticLaw
from ..modulus_tables import (
    POINTS,
    REACH,
    ModulusTable,
    modulus_table,
    modulus_tables,
    piece_constants,
)

LOSES = NoteKind("loses")
CONFIRM = NoteKind("to confirm")

#: t/mm3, that of water: where a program must have a density and the user gave none.
DENSITY = 1e-9
WIDTH = 70
#: A range that ends before this shear strain is of no shear.
SHEARED = 1e-3
#: What the file of a card's band ends in, beside an export.
BAND_FILE = ".band.csv"
BAND_COLUMNS = "modulus,log_strain,MPa,lower_MPa,upper_MPa"


@dataclass(frozen=True)
class UnitSystem:
    """A consistent system of units of an exported file.

    Parameters
    ----------
    names : str
        Units of length, force and stress, as the heading names them.
    length, stress, density, per_width : str
        Names of the units, the last of force per width.
    millimetres, megapascals, tonnes_per_mm3 : float
        One unit of length, stress and density.
    """

    names: str
    length: str = "mm"
    stress: str = "MPa"
    density: str = "t/mm3"
    millimetres: float = 1.0
    megapascals: float = 1.0
    tonnes_per_mm3: float = 1.0
    per_width: str = "kN/m"

    def card(self, card: MaterialCard) -> MaterialCard:
        """Return a card with its moduli, their band and its thickness in these units."""
        certainty = card.certainty
        if certainty is not None:
            # Strains of a band have no unit; its lower and upper ends are stresses.
            scale = np.array([[1.0], [self.megapascals], [self.megapascals]])
            bands = {name: band / scale for name, band in certainty.bands.items()}
            draws = None if certainty.draws is None else certainty.draws / self.megapascals
            directions = certainty.directions / self.megapascals
            certainty = replace(certainty, directions=directions, bands=bands, draws=draws)
        return replace(
            card,
            law=card.law.with_beta(card.law.beta / self.megapascals),
            thickness=card.thickness / self.millimetres,
            certainty=certainty,
        )


MILLIMETRES = UnitSystem("mm, N, MPa")
#: One inch, one pound-force per square inch, and one pound-force s2 per in4.
INCH = 25.4
PSI = 6.894757293168361e-3
UNIT_SYSTEMS: Mapping[str, UnitSystem] = {
    "mm-t-s": MILLIMETRES,
    "mm-g-ms": UnitSystem("mm, N, MPa, g, ms", density="g/mm3", tonnes_per_mm3=1e-6),
    "mm-kg-ms": UnitSystem(
        "mm, kN, GPa",
        stress="GPa",
        density="kg/mm3",
        megapascals=1e3,
        tonnes_per_mm3=1e-3,
        per_width="kN/mm",
    ),
    "m-kg-s": UnitSystem("m, N, Pa", "m", "Pa", "kg/m3", 1e3, 1e-6, 1e-12, "N/m"),
    "in-lbf-s": UnitSystem(
        "in, lbf, psi", "in", "psi", "lbf s2/in4", INCH, PSI, PSI / INCH**2, "lbf/in"
    ),
}


@dataclass(frozen=True)
class ExportRemarks:
    """Remarks on an export: what of the law the file carries, what it loses, what to confirm."""

    carries: tuple[str, ...]
    loses: tuple[str, ...] = ()
    confirm: tuple[str, ...] = ()

    @property
    def notes(self) -> list[Note]:
        losses = [Note(LOSES, words) for words in self.loses]
        return [*losses, *(Note(CONFIRM, words) for words in self.confirm)]

    def lines(self) -> list[str]:
        """Return the remarks as lines of text, under headings."""
        lines: list[str] = []
        for head, texts in (
            ("carries", self.carries),
            ("loses", self.loses or ("nothing",)),
            ("to confirm", self.confirm),
        ):
            lines += [f"{head}:"] if texts else []
            for text in texts:
                lines += textwrap.wrap(text, WIDTH, initial_indent="  - ", subsequent_indent="    ")
        return lines


@dataclass(frozen=True)
class Export:
    """The files of one export by suffix, the requested one first, and its remarks."""

    files: Mapping[str, str]
    remarks: ExportRemarks


def write_export(export: Export, paths: Sequence[Path], overwrite: bool) -> None:
    """Write the files of an export.

    Raises
    ------
    OutputError
        A file is there already, or cannot be written.
    """
    for path in paths:
        if path.exists() and not overwrite:
            raise OutputError(f"{path}: is already there; use --force (overwrite) or another --out")
    for path, text in zip(paths, export.files.values(), strict=True):
        write_text(path, text)


def heading(
    card: MaterialCard,
    description: str,
    remarks: ExportRemarks,
    comment_marker: str,
    units: UnitSystem = MILLIMETRES,
) -> str:
    """Return the comment that begins every file: card, format, what it carries and loses.

    Parameters
    ----------
    description : str
        The format in words.
    remarks : ExportRemarks
        What the file carries and loses, and what to confirm.
    comment_marker : str
        What begins a line of comment in the format, as "**" or "!".
    """
    lines = [f"{description}, written by bubblefit {__version__}."]
    for label, text in (("card", card.name), ("source", card.source)):
        # One line each, whatever the card's text holds.
        words = one_line(" ".join(text.split()))
        lines += textwrap.wrap(f"{label}: {words}", WIDTH, subsequent_indent="    ")
    lines += [f"state of the fabric: {card.state}"] if card.state else []
    lines += [
        f"units: {units.names}; thickness {card.thickness:g} {units.length}",
        *remarks.lines(),
    ]
    lines += band_lines(card, units.stress)
    ascii_lines = (line.encode("ascii", "replace").decode() for line in lines)
    return "\n".join(f"{comment_marker} {line}" for line in ascii_lines)


def title_of(card: MaterialCard, length: int) -> str:
    """Return the card's name in ASCII, cut to a number of characters; "fabric" without one."""
    # A line that begins with one of these is a comment, or a keyword, of some program.
    return one_line(_ascii(card.name)).lstrip("#$*/ ")[:length] or "fabric"


def _ascii(text: str) -> str:
    """Return a text in one line of ASCII."""
    return " ".join(text.encode("ascii", "replace").decode().split())


def band_lines(card: MaterialCard, unit: str) -> list[str]:
    """Return lines of text on the bands of the moduli at start, middle and end of their range."""
    certainty = card.certainty
    law = card.law
    if certainty is None:
        return ["band of the moduli: not known, the card says nothing of it"]
    lines = textwrap.wrap(
        f"band of the moduli ({100 * LEVEL:g} %, more in {BAND_FILE}): {certainty.words}",
        WIDTH,
        subsequent_indent="    ",
    )
    for name, strain in strains_of(law).items():
        places = strain[[0, len(strain) // 2, -1]] if len(strain) > 1 else strain
        ends = zip(places, *certainty.band(law, name, places), strict=True)
        band = ", ".join(f"{low:.4g} to {high:.4g} at {100 * x:.3g} %" for x, low, high in ends)
        lines.append(f"  - {name}, {unit}: {band}")
    return lines


def band_table(card: MaterialCard, unit: str) -> str:
    """Return every modulus over the card's strains, with the ends of its band, as CSV."""
    certainty = card.certainty
    law = card.law
    assert certainty is not None
    rows = [f"# {100 * LEVEL:g} % band of the moduli: {_ascii(str(certainty.words))}"]
    rows += [BAND_COLUMNS.replace("MPa", unit)]
    for name, strain in strains_of(law).items():
        values = strain, law.modulus(name, strain), *certainty.band(law, name, strain)
        lines = (",".join(f"{value:.9g}" for value in row) for row in zip(*values, strict=True))
        rows += [f"{name},{numbers}" for numbers in lines]
    return "\n".join(rows) + "\n"


def range_remarks(card: MaterialCard, reach: float) -> tuple[str, ...]:
    """Return remarks if the card has no end of strain in a direction, or holds without shear.

    Without an end `reach` is used instead.
    """
    ends = card.law.strain_range
    unknown = ("shear: nothing that the card was fitted to sheared the fabric",)
    remarks = unknown if ends[2] < SHEARED else ()
    if (ends < UNLIMITED).all():
        return remarks
    return (
        *remarks,
        "the card has no valid_strain in at least one direction: there the curve ends at "
        f"{100 * reach:g} % of log strain, and the modulus is held beyond",
    )


@dataclass(frozen=True)
class Option:
    """An option of a format: help in one sentence, limits or choices."""

    help: str
    kind: type = float
    smallest: float | None = None
    exclusive_minimum: float | None = None
    largest: float | None = None
    choices: tuple[str, ...] = ()

    def check(self, value: Any, flag: str) -> None:
        """Raise InputError for a value that is no choice or beyond a limit; None is not given."""
        if self.choices:
            check_one_of(value, self.choices, flag)
        if value is None or self.kind is str:
            return
        limits = (
            ("a finite number", math.isfinite(value)),
            (f"{self.smallest} or more", self.smallest is None or value >= self.smallest),
            (
                f"more than {self.exclusive_minimum}",
                self.exclusive_minimum is None or value > self.exclusive_minimum,
            ),
            (f"{self.largest} or less", self.largest is None or value <= self.largest),
        )
        for limit, is_kept in limits:
            if not is_kept:
                raise InputError(None, flag, f"expected {limit}, got {value}")


def option(
    default: Any,
    text: str,
    kind: type = float,
    **limits: Any,
) -> Any:
    """Return a dataclass field for an option with this default; `limits` are fields of `Option`."""
    return field(default=default, metadata={"option": Option(text, kind, **limits)})


@dataclass(frozen=True)
class UnitsOptions:
    """The options that all formats have."""

    units: str = option(
        "mm-t-s",
        "Length, mass and time of the file's units [mm-t-s: mm, N, MPa].",
        str,
        choices=tuple(UNIT_SYSTEMS),
    )

    @property
    def unit_system(self) -> UnitSystem:
        return UNIT_SYSTEMS[self.units]

    @property
    def units_of_card(self) -> UnitSystem:
        """Units of the card that the writer of a format gets."""
        return self.unit_system


@dataclass(frozen=True)
class ExportTableOptions(UnitsOptions):
    points: int = option(POINTS, f"Points of a table or curve [{POINTS}].", int, smallest=2)
    reach: float = option(
        REACH,
        f"Log strain where a table ends if the card has no range [{REACH}].",
        exclusive_minimum=0,
        largest=10,
    )


@dataclass(frozen=True)
class CurveOptions(ExportTableOptions):
    density: float | None = option(
        None, "In the file's units, where the target needs one [1e-9 t/mm3].", exclusive_minimum=0
    )

    @property
    def written_density(self) -> float:
        """Return the density in the units of the export, the usual one unless it is given."""
        if self.density is not None:
            return self.density
        return DENSITY / self.unit_system.tonnes_per_mm3

    def remarks(self, card: MaterialCard) -> tuple[str, ...]:
        """Return what a curve loses of the card's density and range."""
        range_losses = range_remarks(card, self.reach)
        if self.density is not None:
            return range_losses
        density = f"{self.written_density:g} {self.unit_system.density}"
        words = f"the density: the card has none, {density} stands in (--density)"
        return (words, *range_losses)


def flag_of(name: str) -> str:
    """Return the flag of an option by its name; `for_` is `for`, a word of Python."""
    return f"--{name.rstrip('_').replace('_', '-')}"


@dataclass(frozen=True)
class ExportFormat:
    """One way to write a card for another program.

    Attributes
    ----------
    name : str
    write : callable
        Makes the export of a card with options.
    options : type of UnitsOptions
        A dataclass made by `option`.
    load_ratios, unloads : bool
        Whether it carries moduli that depend on the load ratio, and unloading.
    """

    name: str
    write: Callable[[MaterialCard, Any], Export]
    options: type[UnitsOptions] = UnitsOptions
    load_ratios: bool = False
    unloads: bool = False

    def export(self, card: MaterialCard, **options: Any) -> Export:
        """Return the files of a card, and of its band if any; raise InputError if unfit."""
        self.check(options)
        if card.law.of_load_ratio and not self.load_ratios:
            problem = (
                f"the format {self.name} has moduli of strain, and those of a {card.law.form.name} "
                "law depend on the ratio of the loads: export its constants, gsa or rfem"
            )
            raise InputError(None, "form", problem)
        if card.law.memory is not None and not self.unloads:
            problem = (
                f"the format {self.name} has no place for unloading: export to ls-dyna-mat34, "
                "radioss-law58 or abaqus-fabric, or the card without [memory]"
            )
            raise InputError(None, "memory", problem)
        settings = self.options(**options)
        card = settings.units_of_card.card(card)
        export = self.write(card, settings)
        if card.certainty is None:
            return export
        band = band_table(card, settings.units_of_card.stress)
        return replace(export, files={**export.files, BAND_FILE: band})

    def write_files(
        self,
        card: MaterialCard,
        stem: Path,
        overwrite: bool = False,
        **options: Any,
    ) -> list[Path]:
        """Write the files of a card, the stem with a suffix each, and return them."""
        export = self.export(card, **options)
        paths = [stem.with_name(f"{stem.name}{suffix}") for suffix in export.files]
        write_export(export, paths, overwrite)
        return paths

    def check(self, options: Mapping[str, Any]) -> None:
        """Raise InputError for an option, or a value of one, that this format does not take."""
        formal = {entry.name: entry.metadata["option"] for entry in fields(self.options)}
        for name, value in options.items():
            if name not in formal:
                problem = f"means nothing to the format {self.name}"
                raise InputError(None, flag_of(name), problem)
            formal[name].check(value, flag_of(name))


def options_of(formats: Iterable[ExportFormat]) -> Mapping[str, Option]:
    """Return every option of these formats by its name; those of one name mean the same."""
    options: dict[str, Option] = {}
    for export_format in formats:
        for entry in fields(export_format.options):
            options.setdefault(entry.name, entry.metadata["option"])
    return options


#: Log strain of the one point in compression: a curve has to begin somewhere.
COMPRESSION = -0.1
#: Log strain of both yarns at which the loss of nu12 is stated.
BIAXIAL = 0.05
#: Number of points of the curve up to there.
BIAXIAL_POINTS = 5


@dataclass(frozen=True, eq=False)
class FabricCurves:
    """Stress-strain curves of a card in one measure, as (n, 2) strains and stresses (MPa).

    Attributes
    ----------
    warp, fill, shear : (n, 2) arrays
    largest_yarn_stress : float, in the card's unit of stress
        Largest stress along a yarn in shear.
    biaxial_strain : float
        Log strain of both yarns at which `missed_shares` are stated.
    missed_shares : (float, float)
        See `missing_shares`.
    """

    warp: Array
    fill: Array
    shear: Array
    largest_yarn_stress: float
    biaxial_strain: float
    missed_shares: tuple[float, float]

    @property
    def uncoupled(self) -> str:
        """Return a remark on what the curves lack under tension of both yarns."""
        warp, fill = (100 * share for share in self.missed_shares)
        return (
            "under biaxial tension softer than the card, as the contraction of the strips is in "
            f"the curves: by {warp:.2g} % along the warp and {fill:.2g} % along the fill when "
            f"both have {100 * self.biaxial_strain:g} % of log strain"
        )


def curve_of(
    law: HypoelasticLaw,
    name: str,
    strain: Array,
    measure: Measure,
) -> Array:
    """Return strain and stress (n, 2) in a measure: of a strip, or of trellis shear for G12."""
    if name == "G12":
        angle = np.array([trellis_angle(gamma) for gamma in strain])
        return np.column_stack(trellis_curve(law, angle, measure)[:2])
    return np.column_stack(uniaxial_curve(law, COMPONENTS[name], strain, measure))


def fabric_curves(
    card: MaterialCard, options: ExportTableOptions, measure: Measure
) -> FabricCurves:
    """Return the curves of a card, to the end of its range or `options.reach`."""
    strains = {
        name: modulus_table(card.law, name, options.points, options.reach).strain
        for name in COMPONENTS
    }
    pushed = np.array([COMPRESSION])
    warp, fill = (
        np.concatenate(
            [curve_of(card.law, name, strain, measure) for strain in (pushed, strains[name])]
        )
        for name in ("E1", "E2")
    )
    gamma = strains["G12"][strains["G12"] >= 0]
    angle = np.array([trellis_angle(g) for g in gamma])
    x, y, yarns = trellis_curve(card.law, angle, measure)
    equal = min(BIAXIAL, *(strains[name][-1] for name in ("E1", "E2")))
    return FabricCurves(
        warp,
        fill,
        shear=np.stack([x, y], axis=1),
        largest_yarn_stress=np.abs(yarns).max(),
        biaxial_strain=equal,
        missed_shares=missing_shares(card.law, equal),
    )


#: What a total curve makes of a law's history, without a memory and with one.
TOTAL = "hypoelasticity: the curves are total ones; unloading is along the same curve"
FROM_TOP = (
    "hypoelasticity and reloading: the curves are total ones; unloading is that from the end of "
    "the card's range, from smaller strains as the program scales or shifts it"
)


def unloading_curves(
    card: MaterialCard, options: ExportTableOptions, measure: Measure
) -> dict[str, Array]:
    """Return unloading curves (n, 2) of warp, fill and shear: strain and the card's unit of stress.

    They begin at the end of the range, to which the fabric was loaded for the first time, and are
    listed upwards from the permanent set. Empty where the law has no memory.
    """
    law = card.law
    curves: dict[str, Array] = {}
    if law.memory is None:
        return curves
    for k, (name, modulus) in enumerate(zip(STRAIN_NAMES, COMPONENTS, strict=True)):
        end = modulus_table(law, modulus, 2, options.reach).strain[-1]
        path = np.linspace(end, law.memory.kept(k, end), options.points)
        curves[name] = curve_of(law, modulus, path, measure)[::-1]
    return curves


def equibiaxial_curves(
    card: MaterialCard, options: ExportTableOptions, measure: Measure
) -> dict[str, Array]:
    """Return curves (n, 2) of warp and fill while both have the same strain, to the shorter end."""
    ends = [modulus_table(card.law, name, 2, options.reach).strain[-1] for name in ("E1", "E2")]
    strain = np.linspace(0.0, min(ends), options.points)
    return {
        f"{name} biaxial": np.column_stack(equibiaxial_curve(card.law, yarn, strain, measure))
        for yarn, name in enumerate(STRAIN_NAMES[:2])
    }


def missing_shares(law: HypoelasticLaw, log_strain: float) -> tuple[float, float]:
    """Return the share of the biaxial stress along warp and fill that curves of strips miss."""
    path = np.linspace(0.0, log_strain, BIAXIAL_POINTS)
    warp, fill = (
        1 - uniaxial_curve(law, yarn, path, "nominal")[1][-1] / stress[-1]
        for yarn in (0, 1)
        for _, stress in [equibiaxial_curve(law, yarn, path, "nominal")]
    )
    return warp, fill


def law_constants(law: HypoelasticLaw) -> tuple[float, ...]:
    """Return nu12, the numbers of pieces of E1, E2 and G12, and the end and cubic of each piece."""
    return (law.nu12, *piece_constants(law))


def double(value: float) -> str:
    """Return a number as Fortran writes double precision."""
    return f"{value:.16e}".replace("e", "d")


def logical(value: bool) -> str:
    """Return a truth value as Fortran writes it."""
    return ".true." if value else ".false."


CSV_COLUMNS = "direction,log_strain,tangent_modulus_MPa,test_strain,test_stress_MPa"


def csv(card: MaterialCard, options: ExportTableOptions) -> Export:
    """Write tangent modulus and nominal stress by strain: warp, fill, shear."""
    tables = modulus_tables(card.law, options.points, options.reach)
    remarks = ExportRemarks(
        carries=(
            "E1 of eps1, E2 of eps2, G12 of gamma12 (engineering; even in it), at "
            f"{options.points} log strains each",
            "test_strain and test_stress: nominal strain and stress (force over reference area) "
            "of a strip along warp or fill, free to contract; for shear the change of angle in "
            "radians and the stress that does work on it, yarns held at their length",
        ),
        loses=(
            "everything between the points; nu12 is in this heading and in the contraction of "
            "the strips only",
            *range_remarks(card, options.reach),
        ),
    )
    head = [
        heading(card, "Tables of a fabric", remarks, "#", options.unit_system),
        f"# nu12: {float(card.law.nu12)!r}",
        CSV_COLUMNS.replace("MPa", options.unit_system.stress),
    ]
    rows = [row for name in ("E1", "E2", "G12") for row in _csv_rows(card, tables[name])]
    return Export({".csv": "\n".join([*head, *rows]) + "\n"}, remarks)


def _csv_rows(card: MaterialCard, table: ModulusTable) -> list[str]:
    """Return rows of `CSV_COLUMNS` of a modulus in tension.

    They are the direction, log strain, modulus, and the nominal strain and stress of a test.
    """
    is_tension = table.strain >= 0
    strain = table.strain[is_tension]
    modulus = table.modulus[is_tension]
    direction = STRAIN_NAMES[COMPONENTS[table.name]]
    columns = np.column_stack([strain, modulus, curve_of(card.law, table.name, strain, "nominal")])
    return [f"{direction}," + ",".join(f"{v:.12g}" for v in row) for row in columns]


CSV = ExportFormat("csv", csv, ExportTableOptions)
