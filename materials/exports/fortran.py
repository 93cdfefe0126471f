"""The law as constants of Fortran subroutines (templates/fortran/law.f.j2)."""

from __future__ import annotations

from ..law import HypoelasticLaw
from ..moduli import UNLIMITED

#: beta (12), nu12, ends of the range (3), form, breaks (6).
CONSTANTS = 23


def law_constants(law: HypoelasticLaw) -> tuple[float, ...]:
    """(23,) beta (MPa), nu12, ends of eps1, eps2, gamma12, 1 if tri-linear, breaks."""
    # Breaks that the range ends before are never reached.
    breaks = law.limits[3:].tolist() if law.breaks is not None else [UNLIMITED] * 6
    form = 0.0 if law.breaks is None else 1.0
    return (*law.beta.tolist(), law.nu12, *law.strain_range.tolist(), form, *breaks)


def double(value: float) -> str:
    """A double precision literal with every digit."""
    return f"{value:.16e}".replace("e", "d")


def logical(value: bool) -> str:
    """A logical literal."""
    return ".true." if value else ".false."
