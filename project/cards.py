"""Read the cards that predictions run with: [[card]] of a project, files, or the last fit's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from ..errors import InputError
from ..experiments.kinds import Place
from ..materials.card import MaterialCard, read_card
from ..materials.forms.base import UNLIMITED, form_named
from ..materials.law import HypoelasticLaw
from ..readers.sections import Name, Number, Positive, Section, StrainTriple

#: Keys that a card's own file says.
OF_THE_FILE = ("beta", "form", "nu12", "thickness", "thickness_change", "strain_range")
NU12, FORM = 0.24, "cubic"
#: Cards by name; or names in the project and files; none for the project's own.
Cards = Mapping[str, MaterialCard] | Sequence[str | Path] | None
#: The card that a fit leaves in its folder.
FITTED = "material.toml"


class CardSection(Section):
    """A card's file, or coefficients; keys beyond these (knots, breaks) belong to the form."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    name: Name | None = None
    file: str | None = None
    beta: list[Number] | None = None
    form: str | None = None
    nu12: Annotated[float, Field(ge=0, lt=1)] | None = None
    thickness: Positive | None = None
    thickness_change: Literal["constant", "incompressible"] | None = None
    strain_range: StrainTriple | None = None
    test: str | None = None


def usual_folder(project: Path) -> Path:
    """Return out/NAME below the current folder, after the project's folder and file."""
    name = project.resolve().parent.name
    return Path("out") / (name if project.stem == "project" else f"{name}-{project.stem}")


@dataclass(frozen=True, eq=False)
class NamedCard:
    """A material card and, where it is known, the sort of test that it was fitted to."""

    card: MaterialCard
    test: str | None = None


def read_cards(place: Place, sections: Sequence[CardSection]) -> dict[str, NamedCard]:
    """Return the cards by name, in the order of the file.

    InputError: a card with file and coefficients or neither, no name, the same name twice, what is
    no law; naming the project and the key, or the card's file.
    """
    cards: dict[str, NamedCard] = {}
    for i, section in enumerate(sections):
        at = f"card[{i}]"
        if (section.file is None) == (section.beta is None):
            raise InputError(place.path, at, "expected exactly one of 'file' and 'beta'")
        card = _of_file(place, at, section) if section.file else _of_table(place, at, section)
        if card.name in cards:
            problem = f"{card.name!r} is there twice; name one of them"
            raise InputError(place.path, f"{at}.name", problem)
        cards[card.name] = NamedCard(card, section.test)
    return cards


def _of_file(place: Place, at: str, section: CardSection) -> MaterialCard:
    extra = list(section.model_extra or {})
    for key in (*OF_THE_FILE, *extra):
        if key in extra or getattr(section, key) is not None:
            problem = "is said by the card's file; leave this out"
            raise InputError(place.path, f"{at}.{key}", problem)
    assert section.file is not None
    source = place.path.parent / section.file
    card = read_card(source)
    return replace(card, name=section.name or card.name or source.stem)


def _of_table(place: Place, at: str, section: CardSection) -> MaterialCard:
    if section.name is None:
        raise InputError(place.path, f"{at}.name", "this key is missing; add it")
    thickness = place.fabric.thickness
    if section.thickness is not None:
        thickness = section.thickness * place.scales.length
    ends = section.strain_range or [UNLIMITED] * 3
    try:
        form = form_named(section.form or FORM, section.model_extra or {}, ends)
        law = HypoelasticLaw(
            place.scales.modulus * np.array(section.beta),
            NU12 if section.nu12 is None else section.nu12,
            np.array(ends),
            section.thickness_change or place.fabric.thickness_change,
            form,
        )
    except InputError as error:
        raise InputError(place.path, f"{at}.{error.field}", error.problem) from None
    return MaterialCard(law, thickness, section.name)
