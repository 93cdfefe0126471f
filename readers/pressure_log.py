"""Read the log of a pressure sensor with a clock, and the apex heights to compare with it."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from .frames import Array, Frame
from .machine_tables import AS_FOUND, Channel, TableOptions, read_machine_table
from .units import PRESSURE_UNITS, TIME_UNITS


def read_pressure_log(
    path: Path,
    pressure: Channel = AS_FOUND,
    time: Channel = AS_FOUND,
    format: str | None = None,
    comment: str = "#",
    decimal: str | None = None,
) -> tuple[Array, Array]:
    """Read the log of a pressure sensor, a machine table or a table of volts.

    Parameters
    ----------
    path : Path
    pressure, time : Channel
        Columns, units and scales.
    format, comment, decimal
        As in `read_machine_table` and `TableOptions`.

    Returns
    -------
    times : (k,) array, s
        Not falling.
    pressures : (k,) array, MPa

    Raises
    ------
    InputError
        The log cannot be read, or its times go back or stand still.
    """
    channels = {"time": time, "pressure": pressure}
    columns = {key: c.column for key, c in channels.items() if c.column is not None}
    options = TableOptions(columns, ("time", "pressure"), comment, decimal)
    table = read_machine_table(path, options, format)
    column = table.column("time")
    pressures = table.values(table.column("pressure"), PRESSURE_UNITS, pressure)
    times = table.values(column, TIME_UNITS, time)
    falls = np.flatnonzero(np.diff(times) < 0)
    if len(falls):
        field = f"line {table.table.lines[falls[0] + 1]}, column {column!r}"
        raise InputError(path, field, "times must not go back; is this the log of one test?")
    if len(times) < 2 or not times[-1] > times[0]:
        raise InputError(path, f"column {column!r}", "expected readings at two times or more")
    return times, pressures


def apex_height(frame: Frame, quantile: float = 0.98) -> float:
    """Return how far the apex of a frame is displaced.

    Parameters
    ----------
    frame : Frame
    quantile : float
        Share of the points that are displaced less than the apex; below 1, so that an outlier does
        not count as the apex.

    Returns
    -------
    float, mm
        NaN if no displacement is known.
    """
    distances = np.linalg.norm(frame.displacement, axis=1)
    distances = distances[np.isfinite(distances)]
    return float(np.quantile(distances, quantile)) if len(distances) else float("nan")
