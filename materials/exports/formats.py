"""What a format is: a name, what writes it, and the options it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ...errors import InputError
from ..card import MaterialCard
from ..tables import POINTS, REACH
from .base import BAND_FILE, Export, band_table, check_positive


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
