"""A frame as a comma-separated table with a header line: one row a point, one column a quantity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..frames import QUANTITIES, Frame, FrameOptions
from ..registry import Format, register_format
from ..tables import read_table


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """The one frame of a table; columns that are not asked for are ignored."""
    table = read_table(path, options.comment)
    total = len(table.lines)
    if options.flag_column is not None:
        # Flags first: a doubtful row may hold anything.
        table = table.rows(table.numbers(options.flag_column) == 0)
    names = options.columns or {}
    values = np.full((len(table.lines), len(QUANTITIES)), np.nan)
    for quantity in options.quantities:
        column = table.numbers(names.get(quantity, quantity), holes=options.holes)
        values[:, QUANTITIES.index(quantity)] = column
    with np.errstate(over="ignore"):
        values *= options.length_scale
    return [Frame(values[:, :3], values[:, 3:], path, total - len(values))]


register_format(Format("csv", "frame", "comma-separated columns x, y, z, dx, dy, dz", read))
