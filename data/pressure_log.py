"""A log of pressures with its own clock, and what it says of the frames of a camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .channels import AS_FOUND, Channel, channel_values
from .column_names import PRESSURE_UNITS, TIME_UNITS
from .frames import Frame
from .machine_tables import TableOptions, column_of, read_machine_table

Array = NDArray[np.float64]

#: The apex of a frame is what moved most; so large a share of the points moved less, lest a stray
#: point be it.
APEX = 0.98


@dataclass(frozen=True, eq=False)
class PressureLog:
    """Readings: time (k,) s, rising; pressure (k,) MPa; path the file."""

    time: Array
    pressure: Array
    path: Path


@dataclass(frozen=True)
class LogOptions:
    """How a log is read; what is not given is found.

    Parameters
    ----------
    pressure : its column; volts become a pressure by its scale, offset and unit.
    time : its column; seconds where neither file nor channel names a unit.
    format, comment, decimal : as for machine tables.
    """

    pressure: Channel = AS_FOUND
    time: Channel = AS_FOUND
    format: str | None = None
    comment: str = "#"
    decimal: str | None = None


def read_pressure_log(path: Path, options: LogOptions = LogOptions()) -> PressureLog:
    """Read a log as a test machine's table.

    Raises
    ------
    InputError : naming file and line: no or several columns, no or unknown units, cells that are
        not numbers, times that go back.
    """
    channels: Mapping[str, Channel] = {"time": options.time, "pressure": options.pressure}
    named = {key: c.column for key, c in channels.items() if c.column is not None}
    needed = ("time", "pressure")
    asked = TableOptions(named, needed, options.comment, options.decimal)
    found = read_machine_table(path, asked, options.format)
    column = column_of(found, "pressure", named, needed)
    pressure = channel_values(found, column, options.pressure, PRESSURE_UNITS)
    column, clock = column_of(found, "time", named, needed), options.time
    if not found.units[column] and clock.unit is None:
        clock = Channel(clock.column, "s", clock.scale, clock.offset)
    time = channel_values(found, column, clock, TIME_UNITS)
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        at = f"line {found.table.lines[back[0] + 1]}, column {column!r}"
        raise InputError(path, at, "times must not go back; is this the log of one test?")
    if len(time) < 2 or not time[-1] > time[0]:
        raise InputError(path, f"column {column!r}", "expected readings at two times or more")
    return PressureLog(time, pressure, path)


def apex_height(frame: Frame) -> float:
    """How far the apex of a frame has moved, mm, whatever axes the camera has; NaN if unknown."""
    moved = np.linalg.norm(frame.displacement, axis=1)
    moved = moved[np.isfinite(moved)]
    return float(np.quantile(moved, APEX)) if len(moved) else float("nan")


def apex_heights(frames: Sequence[Frame]) -> Array:
    """(frames,) mm, see `apex_height`."""
    return np.array([apex_height(frame) for frame in frames])
