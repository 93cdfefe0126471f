"""The cards of a bending project: files, or coefficients as in the thesis' tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from ..materials.card import MaterialCard, read_card
from ..materials.law import HypoelasticLaw
from .bend_schema import BendFile, CardSection
from .schema import LENGTH_UNITS, MODULUS_UNITS

Test = Literal["uniaxial", "bubble", "joint"]
#: Keys that a card's own file says.
OF_THE_FILE = ("beta", "nu12", "thickness", "thickness_change", "strain_range", "breaks")
NU12 = 0.24


@dataclass(frozen=True, eq=False)
class BendCard:
    """A material card and, where it is known, the sort of test that it was fitted to."""

    card: MaterialCard
    test: Test | None = None


def read_cards(path: Path, file: BendFile) -> dict[str, BendCard]:
    """The cards by name, in the order of the file.

    Raises
    ------
    InputError : naming the project and the key, or the card's file: a card with file and
        coefficients or neither, no name, the same name twice, no thickness, what is no law.
    """
    found: dict[str, BendCard] = {}
    for i, section in enumerate(file.cards):
        at = f"cards[{i}]"
        if (section.file is None) == (section.beta is None):
            raise InputError(path, at, "expected exactly one of 'file' and 'beta'")
        card = _of_file(path, at, section) if section.file else _of_table(path, at, section, file)
        if card.name in found:
            raise InputError(path, f"{at}.name", f"{card.name!r} is there twice; name one of them")
        found[card.name] = BendCard(card, section.test)
    return found


def _of_file(path: Path, at: str, section: CardSection) -> MaterialCard:
    for key in OF_THE_FILE:
        if getattr(section, key) is not None:
            raise InputError(path, f"{at}.{key}", "is said by the card's file; leave this out")
    assert section.file is not None
    source = path.parent / section.file
    card = read_card(source)
    name = section.name or card.name or source.stem
    return MaterialCard(card.law, card.thickness, name, card.source)


def _of_table(path: Path, at: str, section: CardSection, file: BendFile) -> MaterialCard:
    if section.name is None:
        raise InputError(path, f"{at}.name", "this key is missing; add it")
    length = LENGTH_UNITS[file.units.length]
    own = section.thickness or file.cylinder.thickness
    if own is None:
        problem = "this key is missing; give it here or in [cylinder]"
        raise InputError(path, f"{at}.thickness", problem)
    breaks = section.breaks
    rows = None if breaks is None else [breaks.warp, breaks.fill, breaks.shear]
    try:
        law = HypoelasticLaw(
            MODULUS_UNITS[file.units.modulus] * np.array(section.beta),
            NU12 if section.nu12 is None else section.nu12,
            None if section.strain_range is None else np.array(section.strain_range),  # type: ignore[arg-type]
            section.thickness_change or "constant",
            None if rows is None else np.array(rows),
        )
    except InputError as error:
        raise InputError(path, f"{at}.{error.field}", error.problem) from None
    return MaterialCard(law, own * length, section.name)
