"""Linear constants per width, for programs that designers of membrane structures type them into."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ...errors import InputError
from ..biaxial_reach import largest_load
from ..card import MaterialCard
from ..designers.linear import Evaluation, Options
from ..designers.of_law import LawConstants, constants_of_law
from ..designers.ratios import RATIOS, shares
from ..designers.rows import spread_of
from ..forms.base import UNLIMITED
from .base import Says
from .formats import option

#: Engineering shear strain up to which G is averaged where the card has no range; and the least
#: range that is one: no test of the card's fit sheared the fabric where it ends before.
SHEAR, SHEARED = 0.1, 1e-3
#: Of what a spread is told.
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu_warp", "nu_fill": "nu_fill"}


@dataclass(frozen=True)
class ConstantsOptions:
    """Over which loads the law is made linear, and how."""

    lowest: float = field(
        default=0.0, metadata=option("kN/m, where the paths of each load ratio begin [0].", least=0)
    )
    highest: float | None = field(
        default=None,
        metadata=option(
            "kN/m, of the larger load of each ratio, where they end [the end of the card's range].",
            above=0,
        ),
    )
    shear: float | None = field(
        default=None,
        metadata=option(
            "Shear strain up to which G is averaged [the end of the card's range].", above=0, most=1
        ),
    )
    paths: Literal["8", "10"] = field(
        default="8",
        metadata=option(
            "Strain paths of five ratios: 10 with unloaded yarns, 8 without [8].",
            str,
            choices=("8", "10"),
        ),
    )
    minimise: Literal["strain", "load"] = field(
        default="strain",
        metadata=option("Whose squares are least [strain].", str, choices=("strain", "load")),
    )


@dataclass(frozen=True, eq=False)
class Linear:
    """A card as constants, with the loads (kN/m) and the shear strain they are of."""

    card: MaterialCard
    found: LawConstants
    lowest: float
    highest: float
    shear: float

    @property
    def says(self) -> Says:
        """What constants carry and lose."""
        found = self.found
        least, largest = found.shear
        unknown: tuple[str, ...] = ()
        if self.card.law.strain_range[2] < SHEARED:
            unknown = (
                "G: nothing that the card was fitted to sheared the fabric; type in another",
            )
        spread = ", ".join(
            f"{NAMES[name]} {low:.4g} to {high:.4g}"
            for name, (low, high) in spread_of(evaluations(self)).items()
        )
        lost = ", ".join(f"{name} {rms:.3g} of {found.largest[name]:.3g} %"
                         for name, rms in found.lost.items())  # fmt: skip
        return Says(
            carries=(
                f"straight lines of load over strain from {self.lowest:g} to {self.highest:.4g} "
                f"kN/m: least squares of the {found.evaluation.options.minimise}s of "
                f"{found.evaluation.paths} paths of ratios {', '.join(found.lost)}, reciprocal",
                f"G: mean tangent to a shear strain of {self.shear:.3g}",
            ),
            loses=(
                *unknown,
                f"what is not straight: RMS of strain, by ratio: {lost}; {found.rms:.3g} % over "
                "all",
                f"over {1 + len(found.others)} choices of paths, squares and reciprocity: {spread}",
                f"G from {least:.4g} to {largest:.4g} kN/m along the shear",
            ),
        )


def linear_card(card: MaterialCard, options: ConstantsOptions) -> Linear:
    """The constants of a card.

    Raises
    ------
    InputError : no end of the loads is said or known, a law that does not carry them, or constants
        that no program takes (nu_warp nu_fill of 1 or more).
    """
    law, thickness = card.law, card.thickness
    highest = options.highest
    if highest is None:
        highest = _end_of_range(card)
    shear = options.shear
    if shear is None:
        end = float(law.strain_range[2])
        shear = end if SHEARED <= end < UNLIMITED else SHEAR
    chosen = Options(options.paths == "10", True, options.minimise)
    found = constants_of_law(law, thickness, options.lowest, highest, shear, chosen)
    c = found.constants
    if not c.nu_warp * c.nu_fill < 1:
        problem = (
            f"nu_warp nu_fill is {c.nu_warp * c.nu_fill:.3g} between {options.lowest:g} and "
            f"{highest:.4g} kN/m; no program takes 1 or more: choose other loads"
        )
        raise InputError(None, "--highest", problem)
    return Linear(card, found, options.lowest, highest, shear)


def evaluations(linear: Linear) -> list[Evaluation]:
    """That was asked for, then the others."""
    return [linear.found.evaluation, *linear.found.others]


def _end_of_range(card: MaterialCard) -> float:
    """kN/m, the largest load that every ratio carries within the card's strains.

    Raises
    ------
    InputError : the card has no range along warp or fill.
    """
    ends = card.law.strain_range[:2]
    if not (ends < UNLIMITED).all():
        problem = "the card does not say how far its strains hold (valid_strain): give --highest"
        raise InputError(None, "--highest", problem)
    return largest_load(card.law, card.thickness, [shares(ratio) for ratio in RATIOS], ends)
