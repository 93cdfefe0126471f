"""Tables of a fit to strips: for the page, and as files and data frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ...reports import Table
from .prepared import FittedStrip


def misfit_table(strips: Sequence[FittedStrip]) -> Table:
    """Misfit strip by strip beside the specimens' scatter (Eqs 3.4 to 3.6)."""
    rows: list[list[object]] = []
    for fitted in strips:
        strip, polynomial = fitted.strip, fitted.strip.polynomial
        rows.append(
            [
                strip.direction,
                fitted.rms,
                strip.scatter,
                polynomial.r_squared if polynomial is not None else None,
                polynomial.rmse if polynomial is not None else None,
                len(fitted.objective.load),
                float(fitted.history.load[-1]),
            ]
        )
    header = ["strip", "RMS error, N", "scatter of specimens, N", "R² of polynomial",
              "its RMSE, N", "points matched", "load at the end, N"]  # fmt: skip
    note = (
        "RMS error: root mean square of modelled less measured load; scatter: standard deviation "
        "of the measured loads about the polynomial"
    )
    return Table("Misfit by strip", header, rows, note)


def load_table(strips: Sequence[FittedStrip]) -> pd.DataFrame:
    """Load curves of the model, and the polynomials where there are any (else NaN)."""
    parts = []
    for fitted in strips:
        u, polynomial = np.array(fitted.model.elongations), fitted.strip.polynomial
        parts.append(
            pd.DataFrame(
                {
                    "direction": fitted.direction,
                    "elongation_mm": u,
                    "engineering_strain": u / fitted.strip.gauge_length,
                    "model_N": fitted.history.load,
                    "polynomial_N": np.nan if polynomial is None else polynomial(u),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def residual_table(strips: Sequence[FittedStrip]) -> pd.DataFrame:
    """Every matched load: part, elongation_mm, quantity, measured, modelled, difference, unit."""
    parts = []
    for fitted in strips:
        modelled, measured = fitted.objective.modelled(fitted.history), fitted.objective.load
        parts.append(
            pd.DataFrame(
                {
                    "part": fitted.direction,
                    "elongation_mm": fitted.objective.elongation,
                    "quantity": "load",
                    "measured": measured,
                    "modelled": modelled,
                    "difference": modelled - measured,
                    "unit": fitted.objective.unit,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)
