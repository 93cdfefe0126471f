"""What to type into programs whose material is a form: Oasys GSA's fabric, Dlubal RFEM's membrane.

GSA: stiffnesses per width (its reference on theory, "Fabric Material"). RFEM takes force over area
and a thickness: the stiffness per width over a reference thickness (Dlubal, FAQ 004396).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from ..card import MaterialCard
from .base import Export, Says, heading
from .designers import ConstantsOptions, linear_card
from .formats import Format

WHICH_NU = (
    "which of both Poisson's ratios the program means: pull a strip along the warp and compare its "
    "width"
)


def _sheet(
    card: MaterialCard, what: str, says: Says, rows: Sequence[tuple[str, str, str]]
) -> Export:
    lines = [f"{name:34s}{value:>14s}  {unit}" for name, value, unit in rows]
    text = "\n".join([heading(card, what, says, "#"), *lines]) + "\n"
    return Export({".txt": text}, says)


def _with(says: Says, *confirm: str) -> Says:
    return dataclasses.replace(says, confirm=(*says.confirm, *confirm))


def gsa(card: MaterialCard, options: ConstantsOptions) -> Export:
    """The four fields of Oasys GSA's fabric: nu (warp-fill) is the fill's contraction."""
    linear = linear_card(card, options)
    c = linear.found.constants
    rows = [
        ("Warp modulus", f"{c.warp:.6g}", "kN/m"),
        ("Weft modulus", f"{c.fill:.6g}", "kN/m"),
        ("Poisson's ratio (warp-weft)", f"{c.nu_fill:.6g}", ""),
        ("Shear modulus", f"{c.shear:.6g}", "kN/m"),
    ]
    return _sheet(card, "Fabric of Oasys GSA", _with(linear.says, WHICH_NU), rows)


def rfem(card: MaterialCard, options: ConstantsOptions) -> Export:
    """An orthotropic 2D material of Dlubal RFEM and the thickness of its surface."""
    linear = linear_card(card, options)
    c, t = linear.found.constants, card.thickness
    assert c.shear is not None
    rows = [
        ("E_x (warp)", f"{c.warp / t:.6g}", "N/mm^2"),
        ("E_y (fill)", f"{c.fill / t:.6g}", "N/mm^2"),
        ("nu_xy (fill contracts)", f"{c.nu_fill:.6g}", ""),
        ("nu_yx (warp contracts)", f"{c.nu_warp:.6g}", ""),
        ("G_xy", f"{c.shear / t:.6g}", "N/mm^2"),
        ("thickness d of the surface", f"{t:.6g}", "mm"),
    ]
    says = _with(linear.says, WHICH_NU, "that the surface is a membrane, x along the warp")
    return _sheet(card, "Orthotropic membrane of Dlubal RFEM", says, rows)


FORMATS = (
    Format("gsa", gsa, ConstantsOptions, load_ratios=True),
    Format("rfem", rfem, ConstantsOptions, load_ratios=True),
)
