"""Measured displacement fields, one file a pressure (stereo DIC exports)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

COLUMNS = ("x", "y", "dx", "dy", "dz")


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements at points of the flat membrane, at one pressure.

    pressure MPa; points (n, 2) and displacement (n, 3) mm; dropped: doubtful points left out.
    """

    pressure: float
    points: Array
    displacement: Array
    dropped: int = 0


def read_fields(
    files: Sequence[Path],
    pressures: Sequence[float],
    columns: Mapping[str, str] | None = None,
    flag_column: str | None = None,
    comment: str = "#",
    length_scale: float = 1.0,
) -> tuple[DisplacementField, ...]:
    """Read CSV files of x, y, dx, dy, dz.

    Parameters
    ----------
    files : one a pressure. pressures : MPa.
    columns : names in the files of x, y, dx, dy, dz (the same names unless given).
    flag_column : rows where it is not zero are doubtful, dropped and counted.
    comment : what a comment line starts with. length_scale : mm per unit of the files.

    Raises
    ------
    InputError : naming the file and the column or line: missing, empty, a column that is not
        there, what is not a finite number, every row doubtful.
    """
    names = {name: name for name in COLUMNS} | dict(columns or {})
    return tuple(
        _read(Path(file), pressure, names, flag_column, comment, length_scale)
        for file, pressure in zip(files, pressures, strict=True)
    )


def _read(
    path: Path,
    pressure: float,
    names: Mapping[str, str],
    flag_column: str | None,
    comment: str,
    scale: float,
) -> DisplacementField:
    table = _table(path, comment)
    wanted = [names[name] for name in COLUMNS] + ([flag_column] if flag_column else [])
    for name in wanted:
        if name not in table.columns:
            there = ", ".join(map(str, table.columns))
            problem = f"no such column; the file has: {there}. Map columns in the project file"
            raise InputError(path, f"column {name!r}", problem)
    numbers = table[wanted].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    keep = np.ones(len(numbers), dtype=bool)
    if flag_column:
        keep = numbers[:, -1] == 0
        unknown = np.flatnonzero(~np.isfinite(numbers[:, -1]))
        if len(unknown):
            raise InputError(path, *_where(table, unknown[0], flag_column, path, comment))
    bad = np.argwhere(~np.isfinite(numbers[:, :5]) & keep[:, None])
    if len(bad):
        row, column = bad[0]
        raise InputError(path, *_where(table, row, wanted[column], path, comment, len(bad)))
    if not keep.any():
        raise InputError(path, f"column {flag_column!r}", "every row is flagged doubtful")
    kept = numbers[keep]
    return DisplacementField(
        pressure, kept[:, :2] * scale, kept[:, 2:5] * scale, int((~keep).sum())
    )


def _table(path: Path, comment: str) -> pd.DataFrame:
    try:
        table = pd.read_csv(
            path, comment=comment or None, dtype=str, skipinitialspace=True, encoding="utf-8"
        )
    except pd.errors.EmptyDataError:
        raise InputError(path, "", "is empty; expected a header and rows of numbers") from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror or error}") from None
    except (pd.errors.ParserError, UnicodeDecodeError, ValueError) as error:
        raise InputError(path, "", f"is not a CSV table: {str(error).strip()}") from None
    table.columns = [str(name).strip() for name in table.columns]
    if not len(table):
        raise InputError(path, "", "has a header but no rows")
    if not table.columns.is_unique:
        raise InputError(path, "header", "has the same column twice")
    if not isinstance(table.index, pd.RangeIndex):
        raise InputError(path, "header", "the rows have more fields than the header has names")
    return table


def _where(
    table: pd.DataFrame, row: int, column: str, path: Path, comment: str, count: int = 1
) -> tuple[str, str]:
    """Field and problem of a bad number: the line as an editor counts it."""
    found = table[column].iloc[row]
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    text = [line.split(comment)[0] if comment else line for line in lines]
    data = [i for i, line in enumerate(text, 1) if line.strip()]
    line = data[row + 1] if row + 1 < len(data) else row + 2
    more = f" ({count} such values in all)" if count > 1 else ""
    shown = "nothing" if pd.isna(found) else repr(found)
    return f"line {line}, column {column!r}", f"expected a finite number, got {shown}{more}"
