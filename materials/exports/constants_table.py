"""Designers' constants as a table, with what every other choice of the evaluation gives."""

from __future__ import annotations

from typing import Any

from ..card import MaterialCard
from ..designers.rows import row_of
from .base import Export, heading
from .designers import ConstantsOptions, evaluations, linear_card
from .formats import Format

COLUMNS = (
    "chosen", "minimise", "reciprocal", "unloaded_yarns", "ratios", "paths", "E_warp_kN_per_m",
    "E_fill_kN_per_m", "nu_warp", "nu_fill", "A_warp_kN_per_m", "A_fill_kN_per_m",
    "A_warp_fill_kN_per_m", "G_kN_per_m", "squares_percent2",
)  # fmt: skip


def constants(card: MaterialCard, options: ConstantsOptions) -> Export:
    """Inverse form (E, nu) and direct form (A), G, and the same by every other choice."""
    linear = linear_card(card, options)
    rows = []
    for number, one in enumerate(evaluations(linear)):
        row = {
            "chosen": "yes" if number == 0 else "",
            "G_kN_per_m": linear.found.constants.shear,
            **row_of(one),
        }
        rows.append(",".join(_text(row[name]) for name in COLUMNS))
    meaning = (
        "# nu_warp: contraction of the warp when the fill is pulled (nu_xy beside E_x, x the "
        "warp); nu_fill: of the fill when the warp is pulled (nu12 of the card's law)"
    )
    head = heading(card, "Constants per width", linear.says, "#")
    return Export(
        {".csv": "\n".join([head, meaning, ",".join(COLUMNS), *rows]) + "\n"}, linear.says
    )


def _text(value: Any) -> str:
    """As the table has it: yes or no, nine digits, words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


FORMAT = Format("constants", constants, ConstantsOptions, load_ratios=True)
