"""Displacement fields of a bubble, as a stereo image correlation (DIC) exports them."""

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
QUANTITIES = ("x", "y", "dx", "dy", "dz")
PLAIN_COLUMNS: Mapping[str, str] = {name: name for name in QUANTITIES}


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements measured (or computed) at one pressure.

    Parameters
    ----------
    pressure : MPa.
    points : (n, 2) mm, places in the flat reference state; x is warp, y is fill.
    displacement : (n, 3) mm.
    dropped : doubtful points that were left out.
    """

    pressure: float
    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    dropped: int


def read_fields(
    files: Sequence[Path | str],
    pressures: Sequence[float],
    columns: Mapping[str, str] = PLAIN_COLUMNS,
    flag_column: str | None = None,
    comment: str = "#",
    length_scale: float = 1.0,
) -> tuple[DisplacementField, ...]:
    """Read one comma-separated file a pressure.

    Parameters
    ----------
    files : each with a header line; columns that are not asked for are ignored.
    pressures : MPa, one a file.
    columns : for each of `x`, `y`, `dx`, `dy`, `dz` its name in the files.
    flag_column : rows where this column is not zero are doubtful and left out, whatever they
        hold; None keeps every row.
    comment : lines that start so are skipped.
    length_scale : mm in one unit of length of the files.

    Raises
    ------
    InputError : naming file, line and column: no such file, missing columns, an empty table,
        cells that are not finite numbers, nothing left without the doubtful rows.
    """
    if len(files) != len(pressures):
        problem = f"expected one file a pressure, got {len(files)} for {len(pressures)} pressures"
        raise InputError(None, "files", problem)
    if not 0 < length_scale < math.inf:
        raise InputError(None, "length_scale", f"expected mm per unit, above 0, got {length_scale}")
    unnamed = [name for name in QUANTITIES if name not in columns]
    if unnamed:
        raise InputError(None, "columns", f"expected a name for each of {', '.join(unnamed)}")
    return tuple(
        _field(Path(file), float(pressure), columns, flag_column, comment, length_scale)
        for file, pressure in zip(files, pressures, strict=True)
    )


def _field(
    path: Path,
    pressure: float,
    columns: Mapping[str, str],
    flag_column: str | None,
    comment: str,
    length_scale: float,
) -> DisplacementField:
    table = read_table(path, comment)
    total = len(table.lines)
    if flag_column is not None:
        # Flags first: a doubtful row may hold anything.
        table = table.rows(table.numbers(flag_column) == 0)
    if not len(table.lines):
        problem = f"all {total} rows are doubtful ({flag_column!r} is not 0); none is left to use"
        raise InputError(path, "", problem)
    values = np.stack([table.numbers(columns[name]) for name in QUANTITIES], axis=1)
    with np.errstate(over="ignore"):
        values = values * length_scale
    if not np.isfinite(values).all():
        raise InputError(path, "", "lengths too large to be mm; is the length unit right?")
    return DisplacementField(pressure, values[:, :2], values[:, 2:], total - len(values))
