"""Headings in words for the columns of files, where a page shows their tables.

Strains and relative values are in percent on the page, and fractions in the files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import pandas as pd
from pandas.api.types import is_numeric_dtype

from .content import Table

#: Headings of columns of tables, and factors of their values, by the name of the column in files.
HEADINGS: Mapping[str, tuple[str, float]] = {
    "MPa": ("value, MPa", 1.0),
    "by_sigma": ("−2 log L by the 1 sigma of the fit", 1.0),
    "coefficients": ("number of coefficients", 1.0),
    "cross_validated": ("error at what was left out", 1.0),
    "fit_MPa": ("fit, MPa", 1.0),
    "fit_lower_MPa": ("band of the fit from, MPa", 1.0),
    "fit_sigma_relative": ("1 sigma of the fit, %", 100.0),
    "fit_upper_MPa": ("to, MPa", 1.0),
    "fitted": ("error of the fit", 1.0),
    "fitted_relative": ("relative error, fitted, %", 100.0),
    "fitted_rms": ("RMS error, fitted", 1.0),
    "foretold_relative": ("relative error, predicted, %", 100.0),
    "foretold_rms": ("RMS error, predicted", 1.0),
    "foretold_words": ("why not predicted", 1.0),
    "lower_MPa": ("samples from, MPa", 1.0),
    "median_MPa": ("median, MPa", 1.0),
    "minus_2_log_L": ("−2 log L", 1.0),
    "model": ("test", 1.0),
    "moduli": ("form of the moduli", 1.0),
    "off_finest": ("off the finest", 1.0),
    "off_finest_percent": ("off the finest, %", 1.0),
    "sigma_relative": ("1 sigma of the samples, %", 100.0),
    "size": ("size (edge, mm, or share of the load)", 1.0),
    "strain": ("strain, %", 100.0),
    "to_base": ("relative to the card's nu12", 1.0),
    "to_mean": ("relative to the mean", 1.0),
    "upper_MPa": ("samples to, MPa", 1.0),
    "weight_times": ("weight, times the project's", 1.0),
}


def heading_of(column: str) -> tuple[str, float]:
    """Return the heading of a column of a study's file on the page, and the factor of its values.

    Strains in the names of columns, and relative values, are in percent on the page.
    """
    if column in HEADINGS:
        return HEADINGS[column]
    match = re.fullmatch(r"sigma_(E1|E2|G12)(?:_at_(.+))?", column)
    if match:
        strain = f" at {100 * float(match[2]):.4g} % strain" if match[2] else ""
        return f"1 sigma of {match[1]}{strain}, %", 100.0
    match = re.fullmatch(r"(E1|E2|G12)_MPa at (.+)", column)
    if match:
        return f"{match[1]} at {100 * float(match[2]):.4g} % strain, MPa", 1.0
    if column.startswith("relative "):
        return f"error of {column.removeprefix('relative ')}, %", 100.0
    return column.replace("_", " "), 1.0


def readable(title: str, table: pd.DataFrame, *, closed: bool = False, note: str = "") -> Table:
    """Return a table of the page with the numbers of a table of a file, headed by words."""
    columns = []
    headings = []
    for name in table.columns:
        heading, factor = heading_of(name)
        headings.append(heading)
        columns.append(table[name] if factor == 1.0 else factor * table[name])
    text = [k for k, column in enumerate(columns) if not is_numeric_dtype(column)]
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    return Table(title, headings, rows, note, text, closed=closed or len(rows) > 20)
