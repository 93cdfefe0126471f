"""Plain tables with a row of names: frames (a row a point), load polynomials (a row a direction).

Load polynomials: direction, gauge_length_mm, final_length_mm, c1, c2 ..., c0, data_scatter_N.
"""

import re
from functools import partial
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..curves import LoadPolynomial, PublishedPolynomial, direction_named
from ..registry import Format, register_format
from ..tables import read_table
from ..text_frames import read_text


def read_polynomials(path: Path) -> dict[str, PublishedPolynomial]:
    """Read a polynomial a direction; load in N, elongation in mm, of the full strip."""
    table = read_table(path)
    names = [str(name) for name in table.cells.columns]
    found = {int(name[1:]) for name in names if re.fullmatch(r"c\d{1,2}", name)}
    powers = range(1, max(found | {1}) + 1)
    coefficients = np.zeros((len(table.lines), len(powers) + 1))
    for power in [0] * (0 in found) + list(powers):
        coefficients[:, power] = table.numbers(f"c{power}")
    gauges, finals = (table.numbers(f"{name}_length_mm").tolist() for name in ("gauge", "final"))
    scatter = np.full(len(table.lines), np.nan)
    if "data_scatter_N" in names:
        scatter = table.numbers("data_scatter_N")
    read: dict[str, PublishedPolynomial] = {}
    for row, (line, gauge, final) in enumerate(zip(table.lines, gauges, finals, strict=True)):
        at = f"line {line}, column 'direction'"
        direction = direction_named(str(table.text("direction").iloc[row]), path, at)
        if direction in read:
            raise InputError(path, at, f"{direction} is given twice; expected once")
        if not 0 < gauge < final:
            problem = f"expected 0 < gauge length < final length, got {gauge:g} and {final:g}"
            raise InputError(path, f"line {line}", problem)
        fitted = LoadPolynomial(coefficients[row], final - gauge, np.nan, np.nan, 0)
        read[direction] = PublishedPolynomial(direction, gauge, final, fitted, float(scatter[row]))
    return read


plain = partial(read_text, format="csv")
register_format(Format("csv", "frame", "columns of text in any dialect", plain))
register_format(
    Format("csv", "load polynomials", "columns direction, lengths, c1, c2 ...", read_polynomials)
)
