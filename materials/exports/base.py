"""What every export gives, and what heads its text."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, one_line
from ...files import __version__
from ...notes import Note, NoteKind
from ..card import LEVEL, MaterialCard, strains_of
from ..forms.base import COMPONENTS, UNLIMITED, ratios_of
from ..law import HypoelasticLaw
from ..responses import Measure, trellis_angle, trellis_curve, uniaxial_curve
from ..tables import POINTS, REACH, modulus_table, piece_constants

#: t/mm3, that of water: where a program must have a density and the user gave none.
DENSITY = 1e-9
#: Strains a modulus at which a card is looked at.
CHECKED = 501
WIDTH = 70
#: What the file of a card's band ends in, beside an export.
BAND_FILE = ".band.csv"
BAND_COLUMNS = "modulus,log_strain,MPa,lower_MPa,upper_MPa"


@dataclass(frozen=True)
class Says:
    """What the target does with the law: carries, loses, and what is to be confirmed there."""

    carries: tuple[str, ...]
    loses: tuple[str, ...] = ()
    confirm: tuple[str, ...] = ()

    @property
    def notes(self) -> list[Note]:
        """What the user should know: all that is lost, and all that is to be confirmed."""
        lost = [Note(NoteKind.LOSES, words) for words in self.loses]
        return [*lost, *(Note(NoteKind.CONFIRM, words) for words in self.confirm)]

    def lines(self) -> list[str]:
        """The same as lines of at most WIDTH characters."""
        found: list[str] = []
        for head, texts in (
            ("carries", self.carries),
            ("loses", self.loses or ("nothing",)),
            ("to confirm", self.confirm),
        ):
            found += [f"{head}:"] if texts else []
            for text in texts:
                found += textwrap.wrap(text, WIDTH, initial_indent="  - ", subsequent_indent="    ")
        return found


@dataclass(frozen=True)
class Export:
    """Files of one export: text by suffix, the one that is asked for first; and what it says."""

    files: Mapping[str, str]
    says: Says


def check_positive(card: MaterialCard) -> None:
    """No program can use a law without stiffness.

    Raises
    ------
    InputError : a modulus is not positive somewhere in the card's range (at zero strain where it
        has none), or 1 - nu12 nu21 is not at zero strain.
    """
    law = card.law
    for name, component in COMPONENTS.items():
        end = law.strain_range[component]
        strain = np.linspace(0.0, end if end < UNLIMITED else 0.0, CHECKED)
        for ratio in ratios_of(law.form, name):
            values = law.modulus(name, strain, ratio)
            if not (values > 0).all():
                worst = int(np.argmin(values))
                problem = f"{name} is {values[worst]:.4g} MPa at log strain {strain[worst]:.4g}"
                words = f"{problem}, where the card is to hold; expected > 0"
                raise InputError(None, "beta", words)
    if not law.nu12**2 * float(law.E2(0.0) / law.E1(0.0)) < 1:
        problem = f"nu12 nu21 is not below 1 at zero strain, for nu12 = {law.nu12:g}"
        raise InputError(None, "nu12", f"{problem} and E2/E1 of the card")


def heading(card: MaterialCard, what: str, says: Says, comment: str) -> str:
    """The comment that begins every file: which card, which format, what it carries and loses."""
    lines = [f"{what}, written by bubblefit {__version__}."]
    for label, text in (("card", card.name), ("source", card.source)):
        # One line each, whatever the card's text holds.
        words = one_line(" ".join(text.split()))
        lines += textwrap.wrap(f"{label}: {words}", WIDTH, subsequent_indent="    ")
    lines += [f"units: mm, N, MPa; thickness {card.thickness:g} mm", *says.lines()]
    lines += band_lines(card)
    ascii_lines = (line.encode("ascii", "replace").decode() for line in lines)
    return "\n".join(f"{comment} {line}" for line in ascii_lines)


def title_of(card: MaterialCard, most: int) -> str:
    """The card's name as a title of at most so many letters of ASCII, on one line."""
    words = " ".join(card.name.encode("ascii", "replace").decode().split())
    return one_line(words)[:most] or "fabric"


def band_lines(card: MaterialCard) -> list[str]:
    """How sure the moduli are, at a few strains; that it is not known where the card has nothing.

    The program that reads the export takes the moduli as they are: this is for people.
    """
    sure, law = card.certainty, card.law
    if sure is None:
        return ["band of the moduli: not known, the card says nothing of it"]
    lines = textwrap.wrap(
        f"band of the moduli ({100 * LEVEL:g} %, more in {BAND_FILE}): {sure.words}",
        WIDTH,
        subsequent_indent="    ",
    )
    for name, strain in strains_of(law).items():
        at = strain[[0, len(strain) // 2, -1]] if len(strain) > 1 else strain
        ends = zip(at, *sure.band(law, name, at), strict=True)
        told = ", ".join(f"{low:.4g} to {high:.4g} at {where:.3g}" for where, low, high in ends)
        lines.append(f"  - {name}, MPa: {told}")
    return lines


def band_table(card: MaterialCard) -> str:
    """Every modulus over the strain that the card holds for, with the ends of its band, as CSV."""
    sure, law = card.certainty, card.law
    assert sure is not None
    words = " ".join(f"{sure.words}".split()).encode("ascii", "replace").decode()
    rows = [f"# {100 * LEVEL:g} % band of the moduli: {words}", BAND_COLUMNS]
    for name, strain in strains_of(law).items():
        values = strain, law.modulus(name, strain), *sure.band(law, name, strain)
        for row in zip(*values, strict=True):
            rows.append(f"{name}," + ",".join(f"{value:.9g}" for value in row))
    return "\n".join(rows) + "\n"


def density_remarks(density: float | None) -> tuple[str, ...]:
    """What a format that needs a density (t/mm3) has to say of it."""
    if density is not None:
        return ()
    return (f"the density: the card has none, {DENSITY:g} t/mm3 stands in (--density)",)


def range_remarks(card: MaterialCard, reach: float) -> tuple[str, ...]:
    """What a tabulated format has to say of strain ranges."""
    if (card.law.strain_range < UNLIMITED).all():
        return ()
    return (
        "the card has no valid_strain in at least one direction: there the curve ends at log "
        f"strain {reach:g}, and the modulus is held beyond",
    )


@dataclass(frozen=True)
class Option:
    """What a command has to know of one option of a format.

    help : one sentence; the default follows in brackets. kind : int, float or str.
    least : smallest value. above, most : excluded and included end of the values.
    choices : the values there are, instead.
    """

    help: str
    kind: type = float
    least: float | None = None
    above: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()


def option(text: str, kind: type = float, **limits: Any) -> dict[str, Option]:
    """Metadata of a field of a format's options; as Option."""
    return {"option": Option(text, kind, **limits)}


@dataclass(frozen=True)
class NoOptions:
    """A format that takes the card as it is."""


@dataclass(frozen=True)
class TableOptions:
    """Of every format with tables or curves."""

    points: int = field(
        default=POINTS, metadata=option(f"Points of a table or curve [{POINTS}].", int, least=2)
    )
    reach: float = field(
        default=REACH,
        metadata=option(
            f"Log strain where a table ends if the card has no range [{REACH}].", above=0, most=10
        ),
    )


@dataclass(frozen=True)
class CurveOptions(TableOptions):
    """Of the fabric materials of explicit programs."""

    density: float | None = field(
        default=None, metadata=option("t/mm3, where the target needs one.", above=0)
    )


@dataclass(frozen=True)
class Format:
    """One way to write a card for another program.

    name : what the command calls it. write : from card and options to the files. options : the
    frozen dataclass of these options, each field with metadata made by `option`. load_ratios :
    whether it takes laws whose moduli depend on the ratio of the loads along warp and fill.
    """

    name: str
    write: Callable[[MaterialCard, Any], Export]
    options: type = NoOptions
    load_ratios: bool = False

    def export(self, card: MaterialCard, **given: Any) -> Export:
        """The files of a card, with the options that are given, and of its band where it has one.

        Raises
        ------
        InputError : an option that means nothing here; a card that the format cannot take, among
            them one without stiffness where it is to hold.
        """
        self.check(given)
        if card.law.of_load_ratio and not self.load_ratios:
            problem = (
                f"the format {self.name} has moduli of strain, and those of a {card.law.form.name} "
                "law depend on the ratio of the loads: export its constants, gsa or rfem"
            )
            raise InputError(None, "form", problem)
        check_positive(card)
        export = self.write(card, self.options(**given))
        if card.certainty is None:
            return export
        return replace(export, files={**export.files, BAND_FILE: band_table(card)})

    def check(self, names: Iterable[str]) -> None:
        """Raise InputError for the name of an option that this format does not take."""
        known = {entry.name for entry in fields(self.options)}
        for name in names:
            if name not in known:
                raise InputError(None, f"--{name}", f"means nothing to the format {self.name}")


def options_of(formats: Iterable[Format]) -> Mapping[str, Option]:
    """Every option of these formats by its name; those of one name mean the same."""
    found: dict[str, Option] = {}
    for each in formats:
        for entry in fields(each.options):
            found.setdefault(entry.name, entry.metadata["option"])
    return found


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


def law_constants(law: HypoelasticLaw) -> tuple[float, ...]:
    """nu12, how many pieces E1, E2 and G12 have, and each piece: its end, four coefficients (MPa).

    4 + 5 numbers a piece.
    """
    return (law.nu12, *piece_constants(law))


def double(value: float) -> str:
    """A double precision literal with every digit."""
    return f"{value:.16e}".replace("e", "d")


def logical(value: bool) -> str:
    """A logical literal."""
    return ".true." if value else ".false."
