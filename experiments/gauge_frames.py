"""Frames of image correlation (DIC) on a tensile specimen, one table a frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .tables import read_table

#: What a file must hold: reference place and displacement; the names in the file may differ.
QUANTITIES = ("x", "y", "z", "dx", "dy", "dz")
PLAIN_COLUMNS: Mapping[str, str] = {name: name for name in QUANTITIES}


@dataclass(frozen=True, eq=False)
class GaugeFrame:
    """The specimen's surface in one frame.

    Parameters
    ----------
    points : (m, 3) mm, reference places; NaN where correlation was lost.
    displacement : (m, 3) mm; NaN where correlation was lost.
    path : the file, None when the frame did not come from one.
    """

    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    path: Path | None = None


def read_gauge_frames(
    files: Sequence[Path | str],
    columns: Mapping[str, str] = PLAIN_COLUMNS,
    flag_column: str | None = None,
    comment: str = "#",
    length_scale: float = 1.0,
) -> tuple[GaugeFrame, ...]:
    """Read one comma-separated file a frame, in the order given.

    Empty cells and "nan" are lost correlation. Exports that write zeros there need a flag column:
    zeros alone cannot be told from a point that did not move.

    Parameters
    ----------
    columns : for each of `x`, `y`, `z`, `dx`, `dy`, `dz` its name in the files.
    flag_column : rows where this column is not zero are lost, whatever they hold.
    comment : lines that start so are skipped.
    length_scale : mm in one unit of length of the files.

    Raises
    ------
    InputError : naming file, line and column: no files, no such file, missing columns, cells that
        are neither finite numbers nor empty.
    """
    if not files:
        raise InputError(None, "files", "expected one file a frame, got none")
    if not 0 < length_scale < math.inf:
        raise InputError(None, "length_scale", f"expected mm per unit, above 0, got {length_scale}")
    unnamed = [name for name in QUANTITIES if name not in columns]
    if unnamed:
        raise InputError(None, "columns", f"expected a name for each of {', '.join(unnamed)}")
    return tuple(_frame(Path(f), columns, flag_column, comment, length_scale) for f in files)


def _frame(
    path: Path,
    columns: Mapping[str, str],
    flag_column: str | None,
    comment: str,
    length_scale: float,
) -> GaugeFrame:
    table = read_table(path, comment)
    if flag_column is not None:
        table = table.rows(table.numbers(flag_column) == 0)
    values = [table.numbers(columns[name], holes=True) for name in QUANTITIES]
    with np.errstate(over="ignore"):
        value = np.stack(values, axis=1) * length_scale
    if np.isinf(value).any():
        raise InputError(path, "", "lengths too large to be mm; is the length unit right?")
    return GaugeFrame(value[:, :3], value[:, 3:], path)
