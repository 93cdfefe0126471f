"""Designers' constants as a table, with what every other choice of the evaluation gives."""

from __future__ import annotations

import numpy as np

from ..card import MaterialCard
from .base import Export, heading
from .designers import ConstantsOptions, evaluations, linear_card
from .formats import Format

COLUMNS = (
    "chosen,minimise,reciprocal,unloaded_yarns,ratios,paths,E_warp_kN_per_m,E_fill_kN_per_m,"
    "nu_warp,nu_fill,A_warp_kN_per_m,A_fill_kN_per_m,A_warp_fill_kN_per_m,G_kN_per_m,"
    "squares_percent2"
)


def constants(card: MaterialCard, options: ConstantsOptions) -> Export:
    """Inverse form (E, nu) and direct form (A), G, and the same by every other choice."""
    linear = linear_card(card, options)
    rows = []
    for number, one in enumerate(evaluations(linear)):
        c, o = one.constants, one.options
        direct = c.stiffness if c.nu_warp * c.nu_fill < 1 else np.full((2, 2), np.nan)
        numbers = [c.warp, c.fill, c.nu_warp, c.nu_fill, direct[0, 0], direct[1, 1], direct[0, 1]]
        shear = linear.found.constants.shear
        flags = ["yes" if flag else "no" for flag in (o.reciprocal, o.unloaded)]
        first = "yes" if number == 0 else ""
        words = [first, o.minimise, *flags, " ".join(o.ratios) or "all", str(one.paths)]
        rows.append(",".join([*words, *(f"{x:.9g}" for x in [*numbers, shear, one.squares])]))
    meaning = (
        "# nu_warp: contraction of the warp when the fill is pulled (nu_xy beside E_x, x the "
        "warp); nu_fill: of the fill when the warp is pulled (nu12 of the card's law)"
    )
    head = heading(card, "Constants per width", linear.says, "#")
    return Export({".csv": "\n".join([head, meaning, COLUMNS, *rows]) + "\n"}, linear.says)


FORMAT = Format("constants", constants, ConstantsOptions, load_ratios=True)
