"""Load polynomials as published: Table 3.1 of the thesis and the 2017 paper's coefficients."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .curves import direction_named
from .load_polynomials import LoadPolynomial
from .tables import Table, read_table


@dataclass(frozen=True, eq=False)
class PublishedPolynomial:
    """One direction's load over gauge elongation.

    direction : warp, fill or bias. gauge_length, final_length : mm, of the virtual strain gauge
    before the test and at its end. polynomial : its end is final - gauge length; R^2, RMSE and
    points are not in the file. scatter : N, standard deviation of the specimens about it, NaN
    where the file has none.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial
    scatter: float


def read_published_polynomials(path: Path | str) -> dict[str, PublishedPolynomial]:
    """Read a row a direction: direction, gauge_length_mm, final_length_mm, c1, c2 ...

    c0 and data_scatter_N may be there; load in N, elongation in mm, of the full strip.

    Raises
    ------
    InputError : naming file, line and column: missing columns, powers left out, cells that are not
        finite numbers, an unknown direction or one given twice, lengths that do not grow.
    """
    table = read_table(path)
    names = [str(name) for name in table.cells.columns]
    found = {int(name[1:]) for name in names if re.fullmatch(r"c\d{1,2}", name)}
    powers = range(1, max(found | {1}) + 1)
    coefficients = np.zeros((len(table.lines), len(powers) + 1))
    for power in [0] * (0 in found) + list(powers):
        coefficients[:, power] = table.numbers(f"c{power}")
    lengths = np.stack([table.numbers(f"{name}_length_mm") for name in ("gauge", "final")], axis=1)
    scatter = np.full(len(table.lines), np.nan)
    if "data_scatter_N" in names:
        scatter = table.numbers("data_scatter_N")
    read: dict[str, PublishedPolynomial] = {}
    for row, line in enumerate(table.lines):
        gauge, final = (float(length) for length in lengths[row])
        direction = _direction(table, row, read)
        if not 0 < gauge < final:
            problem = f"expected 0 < gauge length < final length, got {gauge:g} and {final:g}"
            raise InputError(table.path, f"line {line}", problem)
        fitted = LoadPolynomial(coefficients[row], final - gauge, np.nan, np.nan, 0)
        read[direction] = PublishedPolynomial(direction, gauge, final, fitted, float(scatter[row]))
    return read


def _direction(table: Table, row: int, before: dict[str, PublishedPolynomial]) -> str:
    at = f"line {table.lines[row]}, column 'direction'"
    direction = direction_named(str(table.text("direction").iloc[row]), table.path, at)
    if direction in before:
        raise InputError(table.path, at, f"{direction} is given twice; expected once")
    return direction
