"""Plain tables with a row of names: frames (a row a point), load polynomials (a row a direction).

Load polynomials: direction, gauge_length_mm, final_length_mm, c1, c2 ..., c0, data_scatter_N.
"""

import re
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..curves import LoadPolynomial, PublishedPolynomial, direction_named
from ..registry import Format, register_format
from ..tables import TextTable, read_table
from ..text_frames import read_text


def read_polynomials(path: Path) -> dict[str, PublishedPolynomial]:
    """Read a polynomial a direction; load in N, elongation in mm, of the full strip."""
    table = read_table(path)
    coefficients = _coefficients(table)
    gauge_lengths = table.numbers("gauge_length_mm").tolist()
    final_lengths = table.numbers("final_length_mm").tolist()
    scatter = np.full(len(table.lines), np.nan)
    if "data_scatter_N" in table.names:
        scatter = table.numbers("data_scatter_N")
    polynomials: dict[str, PublishedPolynomial] = {}
    for row, line in enumerate(table.lines):
        field = f"line {line}, column 'direction'"
        direction = direction_named(table.text("direction")[row], path, field)
        if direction in polynomials:
            raise InputError(path, field, f"{direction} is given twice; expected once")
        gauge = gauge_lengths[row]
        final = final_lengths[row]
        if not 0 < gauge < final:
            problem = f"expected 0 < gauge length < final length, got {gauge:g} and {final:g}"
            raise InputError(path, f"line {line}", problem)
        fitted = LoadPolynomial(coefficients[row], final - gauge, np.nan, np.nan, 0)
        values = direction, gauge, final, fitted, float(scatter[row])
        polynomials[direction] = PublishedPolynomial(*values)
    return polynomials


def _coefficients(table: TextTable) -> NDArray[np.float64]:
    """Return the coefficients (rows, order + 1) in columns c1, c2 ..., and c0 where it is there."""
    powers = {int(name[1:]) for name in table.names if re.fullmatch(r"c\d{1,2}", name)}
    order = max(powers | {1})
    coefficients = np.zeros((len(table.lines), order + 1))
    for power in range(0 if 0 in powers else 1, order + 1):
        coefficients[:, power] = table.numbers(f"c{power}")
    return coefficients


read_frames = partial(read_text, format="csv")
register_format(Format("csv", "frame", "columns of text in any dialect", read_frames))
register_format(
    Format("csv", "load polynomials", "columns direction, lengths, c1, c2 ...", read_polynomials)
)
