"""Read what a deck is compared with: readings of a quantity over another, or fields of DIC."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...readers.frames import FrameOptions, frame_files, read_frames
from ...readers.machine_tables import (
    Channel,
    MachineTable,
    TableOptions,
    read_machine_table,
)
from ...readers.units import LENGTH_UNITS, LOAD_UNITS
from ...solvers.base import Array
from ..data_files import DataFile, joined
from ..sections import Place
from .results import FieldReading, Probe, QuantityReading, Reading
from .section import CompareSection, QuantitySection

#: Units of a measured column by the quantity of the results, that of calculations first.
UNITS = {"displacement": LENGTH_UNITS, "reaction": LOAD_UNITS}
AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Compared:
    """Measured values (n,) in the order of the values of their reading, in `unit`, with files."""

    section: CompareSection
    name: str
    reading: Reading
    load: Array
    unit: str
    data: tuple[DataFile, ...]


def read_compared(section: CompareSection, place: Place, at: str, folder: str) -> Compared:
    """Read measured values of all files; InputError where files, columns, or keys are wrong.

    Parameters
    ----------
    at : str
        Dotted key of the section below the test's.
    folder : str
        Of the files, from the project's.
    """
    paths = _files(section.measured, place, f"{at}.measured", folder)
    read = _read_curve if section.quantity is None else _read_fields
    compared = read(section, place, at, paths)
    if not compared.load.any():
        problem = f"the measured values of {compared.name} are all zero"
        raise place.error(f"{at}.measured", problem)
    return compared


def _read_curve(section: CompareSection, place: Place, at: str, paths: list[Path]) -> Compared:
    """Return the readings of a quantity over another one, file after file."""
    if section.x is None or section.y is None:
        raise place.error(at, 'expected x and y, or quantity = "displacement" with set and times')
    axes = {"elongation": section.x, "load": section.y}
    probes = probe_of(section.x, place, f"{at}.x"), probe_of(section.y, place, f"{at}.y")
    named = {quantity: axis.column for quantity, axis in axes.items() if axis.column}
    columns = []
    data = []
    for path in paths:
        table = read_machine_table(path, TableOptions(named))
        values = [
            _numbers(table, table.column(quantity), probe.quantity, axis.unit)
            for (quantity, axis), probe in zip(axes.items(), probes, strict=True)
        ]
        columns.append(values)
        data.append(DataFile(path, table.source({}, {}), len(values[0])))
    x, y = np.hstack(columns)
    name = section.name or section.y.column or probes[1].quantity
    unit = section.y.unit or {"displacement": "mm", "reaction": "N"}.get(probes[1].quantity, "1")
    return Compared(section, name, QuantityReading(*probes, x), y, unit, tuple(data))


def _read_fields(section: CompareSection, place: Place, at: str, paths: list[Path]) -> Compared:
    """Return the displacements of all points and axes that were measured, frame after frame."""
    frames = read_frames(paths, FrameOptions(("x", "y", "dx", "dy")))
    if not section.set or len(section.times) != len(frames):
        problem = f"expected a node set (set), and a time of the analysis for each of {len(frames)}"
        raise place.error(f"{at}.times", f"{problem} frames (times)")
    blocks = []
    values = []
    data = []
    for time, frame in zip(section.times, frames, strict=True):
        points = np.nan_to_num(frame.points)
        for axis, measured in enumerate(frame.displacement.T):
            is_correlated = np.isfinite(measured)
            if is_correlated.any():
                blocks.append((time, axis, points[is_correlated]))
                values.append(measured[is_correlated])
        assert frame.path is not None
        data.append(DataFile(frame.path, frame.source, len(points)))
    name = section.name or f"displacement of {section.set}"
    reading = FieldReading(section.set, tuple(blocks))
    return Compared(section, name, reading, np.concatenate(values), "mm", tuple(joined(data)))


def _files(measured: str | list[str], place: Place, field: str, folder: str) -> list[Path]:
    """Return the files that names or patterns stand for; InputError where one is missing."""
    names = [measured] if isinstance(measured, str) else measured
    with place.errors_name(field=field):
        paths, _ = frame_files(names, "measured", place.folder(folder))
    for path in paths:
        place.has(path, field)
    return paths


def _numbers(table: MachineTable, column: str, quantity: str, unit: str | None) -> Array:
    """Return the numbers (n,) of a column, in the unit of the quantity if that has one."""
    if quantity not in UNITS:
        return table.table.numbers(column)
    return table.values(column, UNITS[quantity], Channel(unit=unit))


def probe_of(section: QuantitySection, place: Place, at: str) -> Probe:
    """Return the number of the results that a section describes; InputError."""
    keys = ("displacement", "reaction", "time", "result")
    chosen = [key for key in keys if getattr(section, key) is not None]
    if len(chosen) != 1:
        raise place.error(at, f"expected one of {', '.join(keys)}")
    if section.time is not None:
        return Probe("time", scale=section.time)
    if not section.place:
        raise place.error(at, "expected a node set (set), or a place (node = [x, y, z])")
    return Probe(chosen[0], section.place, AXES.index(section.axis), section.scale)
