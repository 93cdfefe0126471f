"""What every export gives, and what heads its text."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ... import __version__
from ...errors import InputError, one_line
from ...notes import Note, NoteKind
from ..card import MaterialCard
from ..certainty import LEVEL, strains_of
from ..forms.base import COMPONENTS, UNLIMITED, ratios_of

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
