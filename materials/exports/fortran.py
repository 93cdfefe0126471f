"""The law as constants of Fortran subroutines (templates/fortran/law.f.j2)."""

from __future__ import annotations

from ..law import HypoelasticLaw
from ..pieces import piece_constants


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
