"""What is seen of a test of strips before a fit: its load curves as they were read."""

from __future__ import annotations

import numpy as np

from ...reports import Table, plot_curves
from ..exhibit import Exhibit, Output
from .doubts import curves_of
from .test import StripsTest

CURVES = "curves.png"


def exhibit(test: StripsTest, out: Output) -> Exhibit:
    """Write the curves; a table of what each specimen holds."""
    curves = {direction: curves_of(strip) for direction, strip in test.strips.items()}
    plot_curves(out.path(CURVES), curves)
    rows: list[list[object]] = [
        [
            direction,
            name or "polynomial",
            len(load),
            float(elongation[0]),
            float(elongation[-1]),
            float(np.log1p(elongation[-1] / test.strips[direction].gauge_length)),
            float(load[0]),
            float(load.max()),
        ]
        for direction, specimens in curves.items()
        for name, elongation, load in specimens
    ]
    header = [
        "direction", "specimen", "points", "first elongation, mm", "last, mm", "last strain",
        "first load, N", "largest load, N",
    ]  # fmt: skip
    table = Table("Load curves as read", header, rows, text=(1,))
    return Exhibit(figures=[(out.name(CURVES), "load curves as they were read")], tables=[table])
