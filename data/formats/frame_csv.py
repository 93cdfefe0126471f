"""A frame as a comma-separated table with a header line: one row a point, one column a quantity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..frames import FLAGGED, QUANTITIES, Frame, FrameOptions, FrameSource
from ..registry import Format, register_format
from ..tables import read_table


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """The one frame of a table; columns that are not asked for are ignored."""
    table = read_table(path, options.comment)
    total = len(table.lines)
    if options.flag_column is not None:
        # Flags first: a doubtful row may hold anything.
        table = table.rows(table.numbers(options.flag_column) == 0)
    names = _names(options, [str(name) for name in table.cells.columns])
    values = np.full((len(table.lines), len(QUANTITIES)), np.nan)
    for quantity, name in names.items():
        column = table.numbers(name, holes=options.holes)
        values[:, QUANTITIES.index(quantity)] = column
    with np.errstate(over="ignore"):
        values *= options.length_scale
    flagged = total - len(values)
    dropped = {FLAGGED: flagged} if flagged else {}
    source = FrameSource("csv", names)
    return [Frame(values[:, :3], values[:, 3:], path, dropped, source=source)]


def _names(options: FrameOptions, there: list[str]) -> dict[str, str]:
    """Names of the columns of what must be there, and of what else is there under its own name."""
    if options.columns is not None:
        return dict(options.columns)
    names = {quantity: quantity for quantity in options.quantities}
    return names | {name: name for name in QUANTITIES if there.count(name) == 1}


register_format(Format("csv", "frame", "comma-separated columns x, y, z, dx, dy, dz", read))
