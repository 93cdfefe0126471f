"""The columns of a test machine's table: which holds what, and its numbers in mm and N."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .column_names import columns_of, scale_of
from .machine_tables import NEEDED, MachineTable


def column_of(
    found: MachineTable,
    quantity: str,
    named: Mapping[str, str],
    needed: Sequence[str] = NEEDED,
) -> str:
    """The name of the one column that holds a quantity; "" where it may be absent and is.

    Times are looked for only where they are named or needed.

    Raises
    ------
    InputError : several columns, or none of one that is needed or was named.
    """
    names = [str(name) for name in found.table.cells.columns]
    if quantity == "time" and quantity not in (*named, *needed):
        return ""
    which = columns_of(names, quantity, named)
    if len(which) == 1 or (not which and quantity not in (*named, *needed)):
        return names[which[0]] if which else ""
    there = ", ".join(name for name in names if name)[:300]
    several = " or ".join(repr(names[i]) for i in which[:6])
    what = f"may be {several}; name one with columns" if which else "is missing"
    if quantity in named:
        what = f"{named[quantity]!r} {'appears twice' if which else 'is missing'}"
    problem = f"the column of {quantity} {what}; the file has: {there}"
    raise InputError(found.table.path, f"line {found.header}", problem)


def measured(
    found: MachineTable, column: str, kind: str, units: dict[str, float], asked: str | None
) -> NDArray[np.float64]:
    """One column (rows,) in mm or N.

    Parameters
    ----------
    kind : length or load, for complaints.
    units : mm or N in one of each unit.
    asked : the unit the caller says, None to take the file's.

    Raises
    ------
    InputError : no unit, an unknown one, or one that differs from `asked`; cells that are not
        finite numbers.
    """
    path, at = found.table.path, f"line {found.header}, column {column!r}"
    if asked is not None and asked not in units:
        problem = f"expected one of {', '.join(units)}, got {asked!r}"
        raise InputError(None, f"{kind}_unit", problem)
    unit = found.units[column]
    if not unit and asked is None:
        problem = f"the file does not name the unit; say {kind}_unit, one of {', '.join(units)}"
        raise InputError(path, at, problem)
    scale = scale_of(unit or asked or "", units)
    if scale is None:
        problem = f"unit {unit[:20]!r} is not one of {', '.join(units)}; convert the column"
        raise InputError(path, at, problem)
    if asked is not None and scale != units[asked]:
        problem = f"the file says {unit!r}, {kind}_unit says {asked!r}; correct one of them"
        raise InputError(path, at, problem)
    with np.errstate(over="ignore"):
        value = found.table.numbers(column) * scale
    if not np.isfinite(value).all():
        raise InputError(path, at, f"numbers too large; is the unit {unit or asked!r} right?")
    return value
