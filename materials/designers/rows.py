"""What tables say of evaluations: a row of one, the spread over several."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .linear import Evaluation

#: The constants of an evaluation whose spread is told.
CONSTANTS = ("warp", "fill", "nu_warp", "nu_fill")


def row_of(one: Evaluation) -> dict[str, Any]:
    """Options and constants of both forms: E and A (direct form) in kN/m, squares in %^2."""
    c, o = one.constants, one.options
    direct = c.stiffness if c.nu_warp * c.nu_fill < 1 else np.full((2, 2), np.nan)
    return {
        "minimise": o.minimise,
        "reciprocal": o.reciprocal,
        "unloaded_yarns": o.unloaded,
        "ratios": " ".join(o.ratios) or "all",
        "paths": one.paths,
        "E_warp_kN_per_m": c.warp,
        "E_fill_kN_per_m": c.fill,
        "nu_warp": c.nu_warp,
        "nu_fill": c.nu_fill,
        "A_warp_kN_per_m": direct[0, 0],
        "A_fill_kN_per_m": direct[1, 1],
        "A_warp_fill_kN_per_m": direct[0, 1],
        "A_fill_warp_kN_per_m": direct[1, 0],
        "squares_percent2": one.squares,
    }


def spread_of(evaluations: Iterable[Evaluation]) -> dict[str, tuple[float, float]]:
    """Least and largest of each of `CONSTANTS` over the evaluations."""
    every = [one.constants for one in evaluations]
    return {
        name: (min(getattr(c, name) for c in every), max(getattr(c, name) for c in every))
        for name in CONSTANTS
    }
