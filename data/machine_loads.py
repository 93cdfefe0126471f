"""A test machine's loads, and the times of pictures, to put beside a virtual strain gauge."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .column_names import LOAD_UNITS, TIME_UNITS
from .machine_tables import MachineTable, TableOptions, column_of, measured, read_machine_table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MachineLoads:
    """What a machine recorded. load (k,) N; time (k,) s, None unless asked for; path the file."""

    load: Array
    time: Array | None
    path: Path


def read_machine_loads(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    timed: bool = False,
    load_unit: Literal["N", "kN"] | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> MachineLoads:
    """Read the loads of an export, whatever else it holds; the table is found as for curves.

    Parameters
    ----------
    columns : the file's own names of `load` and `time`, where finding is ambiguous.
    timed : read the times too.
    load_unit : needed where the file names none.
    format : name of the file's format; found by its content unless given.

    Raises
    ------
    InputError : as `curves.read_load_curves`; a unit of time that is not known.
    """
    path, named = Path(path), dict(columns or {})
    needed = ("load", "time") if timed else ("load",)
    found = read_machine_table(path, TableOptions(named, needed, comment, decimal), format)
    load = measured(found, column_of(found, "load", named, needed), "load", LOAD_UNITS, load_unit)
    return MachineLoads(load, _times(found, named, needed) if timed else None, path)


def read_times(
    path: Path | str,
    column: str | None = None,
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> Array:
    """Times (n,) in s, one a row: of the pictures, from the camera's log.

    column : its name in the file, where finding is ambiguous.

    Raises
    ------
    InputError : naming file and line: no or several columns of time, no numbers.
    """
    named = {} if column is None else {"time": column}
    found = read_machine_table(path, TableOptions(named, ("time",), comment, decimal), format)
    return _times(found, named, ("time",))


def _times(found: MachineTable, named: Mapping[str, str], needed: tuple[str, ...]) -> Array:
    """The column of times in s; where no unit is named, they are seconds."""
    name = column_of(found, "time", named, needed)
    unit = found.units[name]
    at_the_end = re.search(rf"[_\s]({'|'.join(TIME_UNITS)})$", name)
    if not unit and at_the_end:
        unit = at_the_end[1]
    scale = TIME_UNITS.get(unit or "s")
    if scale is None:
        at = f"line {found.header}, column {name!r}"
        problem = f"unit {unit[:20]!r} is not one of {', '.join(TIME_UNITS)}; convert the column"
        raise InputError(found.table.path, at, problem)
    return found.table.numbers(name) * scale
