"""What readings of a sensor mean: a straight line from what was recorded to a unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .column_names import scale_of
from .machine_tables import MachineTable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """What a column of readings means: scale * reading + offset, in `unit`.

    Parameters
    ----------
    column : its name in the file; found by what names mean unless given.
    unit : such as mm, N or kPa. The file's own unless given; needed with a scale.
    scale, offset : of a sensor, such as 200 mm per volt. None: the readings are no volts.
    """

    column: str | None = None
    unit: str | None = None
    scale: float | None = None
    offset: float = 0.0


#: A column that is found by what names mean, in the unit that the file says.
AS_FOUND = Channel()


def channel_values(
    found: MachineTable, column: str, channel: Channel, units: Mapping[str, float]
) -> Array:
    """A column (rows,) in the unit of which `units` says how many each unit has.

    Raises
    ------
    InputError : naming file and line: as `in_unit`; cells that are not finite numbers.
    """
    path, at = found.table.path, f"line {found.header}, column {column!r}"
    return in_unit(found.table.numbers(column), found.units[column], channel, units, path, at)


def in_unit(
    readings: Array, own: str, channel: Channel, units: Mapping[str, float], path: Path, at: str
) -> Array:
    """Readings (rows,) in the unit of which `units` says how many each unit has.

    Parameters
    ----------
    own : the unit that the file names, "" for none.
    path, at : where they stand, for complaints.

    Raises
    ------
    InputError : no unit, one that is not known, a scale for what needs none, two units.
    """
    known = dict(units)
    said = scale_of(own, known) if own else None
    raw = channel.scale is not None
    factor = 1.0 if channel.scale is None else channel.scale
    if factor != 1.0 and said is not None:
        problem = f"is in {own} already: leave the scale {factor:g} out"
        raise InputError(path, at, problem)
    unit = channel.unit or ("" if raw and said is None else own)
    if not unit:
        what = "after scaling" if raw else "of the readings"
        raise InputError(path, at, f"say the unit {what}, one of {', '.join(known)}")
    scale = scale_of(unit, known)
    if scale is None:
        advice = "a sensor in volts needs scale and unit" if unit in ("V", "mV") else "convert it"
        raise InputError(path, at, f"unit {unit[:20]!r} is not one of {', '.join(known)}; {advice}")
    if channel.unit and own and (not raw or said is not None) and said != scale:
        problem = f"the file says {own!r}, the project {channel.unit!r}; correct one of them"
        raise InputError(path, at, problem)
    return (factor * readings + channel.offset) * scale
