"""Tables of a fit to a biaxial test: for the page, and as files and data frames."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from ...reports import Table
from .objective import PERCENT
from .prepared import FittedPath

YARNS = ("warp", "fill")


def misfit_table(paths: Sequence[FittedPath]) -> Table:
    """Misfit ratio by ratio."""
    rows: list[list[object]] = [
        [
            p.path.ratio, *p.rms, f"{p.path.cycle.number} of {p.path.cycles}", len(p.path.load),
            float(p.path.load[0].max()), float(p.path.load[-1].max()),
            *(PERCENT * p.path.residual).tolist(),
        ]
        for p in paths
    ]  # fmt: skip
    header = [
        "ratio", "RMS error warp, %", "RMS error fill, %", "cycle", "points matched",
        "from load, kN/m", "to load, kN/m", "strain kept before it, warp, %", "fill, %",
    ]  # fmt: skip
    note = (
        "RMS error: root mean square of modelled less measured strain since the beginning of the "
        "loading; loads: the larger of both"
    )
    return Table("Misfit by ratio", header, rows, note, text=(0, 3))


def path_table(paths: Sequence[FittedPath]) -> pd.DataFrame:
    """Loads and strains of every ratio, measured and modelled, since the beginning of the path."""
    parts = []
    for p in paths:
        measured, modelled = PERCENT * p.objective.strain, PERCENT * p.objective.modelled(p.history)
        parts.append(
            pd.DataFrame(
                {
                    "ratio": p.path.ratio,
                    "warp_load_kN_per_m": p.path.load[:, 0],
                    "fill_load_kN_per_m": p.path.load[:, 1],
                    "warp_strain_percent": measured[:, 0],
                    "fill_strain_percent": measured[:, 1],
                    "warp_model_percent": modelled[:, 0],
                    "fill_model_percent": modelled[:, 1],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def residual_table(paths: Sequence[FittedPath]) -> pd.DataFrame:
    """Every matched strain: part, loads, quantity, measured, modelled, difference, unit."""
    parts = []
    for p in paths:
        measured, modelled = PERCENT * p.objective.strain, PERCENT * p.objective.modelled(p.history)
        for k, yarn in enumerate(YARNS):
            parts.append(
                pd.DataFrame(
                    {
                        "part": p.path.ratio,
                        "warp_load_kN_per_m": p.path.load[1:, 0],
                        "fill_load_kN_per_m": p.path.load[1:, 1],
                        "quantity": f"{yarn}_strain",
                        "measured": measured[1:, k],
                        "modelled": modelled[1:, k],
                        "difference": (modelled - measured)[1:, k],
                        "unit": "%",
                    }
                )
            )
    return pd.concat(parts, ignore_index=True)
