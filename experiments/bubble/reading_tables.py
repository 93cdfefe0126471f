"""Read tables of a bubble without a camera: pressures and readings of each specimen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.outline import Outline
from ...readers.frames import FrameSource, frame_files
from ...readers.inflations import branches_of
from ...readers.machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from ...readers.quantities import columns_of
from ...readers.units import LENGTH_UNITS, PRESSURE_UNITS
from ...solvers.base import Array
from ..data_files import DataFile
from ..sections import Place, named_format
from .reading_sections import HeightsSection, TableSection
from .readings import LIMITS, GaugeReadings, Quantity, ReadingSeries
from .section import BubbleSection, outline_of

NO_PRESSURE = "without pressure"
OTHER_INFLATION = "of other inflations or a release"
BEYOND_RIM = "beyond the rim"


@dataclass(frozen=True, eq=False)
class SpecimenTable:
    """Columns of one specimen, in MPa, mm and plain numbers, in the order of its readings.

    Attributes
    ----------
    pressure : (n,) array, MPa
    values : mapping of str to (n,) array
        Further columns by quantity.
    file : Path or None
    source : FrameSource
    """

    pressure: Array
    values: Mapping[str, Array]
    file: Path | None
    source: FrameSource

    def subset(self, rows: NDArray[np.intp]) -> SpecimenTable:
        """Return the table with some of its rows only."""
        values = {name: column[rows] for name, column in self.values.items()}
        return SpecimenTable(self.pressure[rows], values, self.file, self.source)


def read_readings(section: BubbleSection, place: Place) -> GaugeReadings | None:
    """Return the readings of a section in mm, N and MPa; None where it has no table of readings.

    Parameters
    ----------
    section : BubbleSection
    place : Place

    Raises
    ------
    InputError
        A table cannot be read, or does not go with the test.
    """
    _check_nuisance(section, place)
    heights = section.data.heights
    if heights is None:
        return None
    assert section.inflation != "all"
    outline = outline_of(section, place, None)
    places = np.array(heights.places or [[0.0, 0.0]])
    _check_places(places, outline, place)
    tables = _height_tables(heights, place, len(places))
    series = []
    for number, xy in enumerate(places):
        column = f"height {number + 1}"
        label = f"height at ({xy[0]:g}, {xy[1]:g}) mm"
        series.append(
            _series(
                "height", label, column, tables, section.inflation, xy, heights.moves_with_sheet
            )
        )
    return GaugeReadings(
        tuple(s for s in series if len(s.value)),
        _data_files(tables, section.inflation),
    )


def _check_nuisance(section: BubbleSection, place: Place) -> None:
    """Refuse keys that need fields of a camera beside readings, and those of readings elsewhere."""
    nuisance = section.nuisance
    if not section.data.has_readings:
        if nuisance.height_offset is not None:
            problem = "is of gauges: there is no [bubble.data.heights]"
            raise place.error("nuisance.height_offset", problem)
        return
    keys_of_fields = {
        "inflation": section.inflation == "all",
        "radius": section.radius == "clamp",
        "match.by": section.match.by == "surfaces",
        "nuisance.displacement_offset": nuisance.displacement_offset,
        "nuisance.registration": nuisance.registration == "fitted",
        "nuisance.tilt": nuisance.tilt is not None,
        "nuisance.shift": nuisance.shift is not None,
        "sheet.constant_field": bool(section.sheet.constant_field),
        "sheet.from_pressure": section.sheet.from_pressure is not None,
    }
    for key, is_set in keys_of_fields.items():
        if is_set:
            raise place.error(key, "needs fields of a camera, and there are tables of readings")


def _check_places(places: Array, outline: Outline, place: Place) -> None:
    """Refuse places that do not lie on the disk."""
    is_beyond = outline.share(places) >= 1.0
    if is_beyond.any():
        xy = places[is_beyond][0].tolist()
        problem = f"expected places within {outline.words}, got {xy} mm"
        raise place.error("data.heights.places", problem)


def table_files(section: TableSection, place: Place, key: str) -> Sequence[Path]:
    """Return the files of a table; none if no data are needed and they are missing.

    key : dotted key of the table below the test's section
    """
    named_format(place, f"{key}.format", "machine table", section.format)
    if not section.files:
        raise place.error(f"{key}.files", f"this key is missing; or give {key}.values")
    folder = place.folder(section.folder)
    try:
        files, _ = frame_files(section.files, f"{key}.files", folder)
    except InputError as error:
        if not place.need_data:
            return ()
        raise place.error(f"{key}.files", f"{error.problem} in {folder}") from None
    exist = [place.has(file, f"{key}.files") for file in files]
    return files if all(exist) else ()


def read_table(
    path: Path, section: TableSection, columns: Mapping[str, str], quantities: Sequence[str]
) -> MachineTable:
    """Return the table of a file with a column of each quantity; columns : those named."""
    options = TableOptions(columns, quantities, section.comment, section.decimal, section.sheet)
    return read_machine_table(path, options, section.format)


def pressures_in(table: MachineTable, section: TableSection) -> Array:
    """Return the pressures (rows,) MPa of a table."""
    channel = Channel(unit=section.pressure_unit)
    return table.values(table.column("pressure"), PRESSURE_UNITS, channel, "pressure_unit")


def lengths_in(table: MachineTable, section: TableSection, column: str) -> Array:
    """Return the lengths (rows,) mm of a column."""
    return table.values(column, LENGTH_UNITS, Channel(unit=section.length_unit), "length_unit")


def specimen_rows(table: MachineTable) -> list[NDArray[np.intp]]:
    """Return the rows of each specimen: those of a column of specimens, else all."""
    column = table.column("specimen")
    if not column:
        return [np.arange(len(table.table.lines))]
    return rows_by_name(table.table.text(column).tolist())


def rows_by_name(names: Sequence[object]) -> list[NDArray[np.intp]]:
    """Return the rows of each name, in the order in which names come first."""
    return [
        np.array([row for row, label in enumerate(names) if label == name])
        for name in dict.fromkeys(names)
    ]


def _height_tables(section: HeightsSection, place: Place, count: int) -> list[SpecimenTable]:
    """Return the tables of all specimens, with a column of heights for each of `count` places."""
    if section.values is not None:
        heights = np.atleast_2d(np.array(section.values.height, dtype=float))
        pressure = np.array(section.values.pressure)
        if heights.shape != (count, len(pressure)):
            problem = f"expected {count} lists of {len(pressure)} heights, one a place"
            raise place.error("data.heights.values.height", problem)
        columns = {f"height {k + 1}": heights[k] for k in range(count)}
        specimens = SpecimenTable(pressure, columns, None, FrameSource())
        labels = section.values.specimen or [1] * len(pressure)
        if len(labels) != len(pressure):
            problem = f"expected the specimen of each of {len(pressure)} readings"
            raise place.error("data.heights.values.specimen", problem)
        return [specimens.subset(rows) for rows in rows_by_name(labels)]
    columns_named = section.columns.model_dump(exclude_none=True)
    listed = columns_named.pop("height", [])
    names = [listed] if isinstance(listed, str) else listed
    if names:
        columns_named["height"] = names[0]
    tables = []
    for path in table_files(section, place, "data.heights"):
        table = read_table(path, section, columns_named, ("pressure", "height"))
        headings: list[str] = names or [
            table.names[i] for i in columns_of(table.names, "height", {})
        ]
        if len(headings) != count:
            problem = (
                f"expected a column of heights for each of {count} places, got {len(headings)}: "
                f"{', '.join(headings)}; columns.height names them, places gives [x, y] of each"
            )
            raise InputError(path, f"line {table.header}", problem)
        values = {f"height {k + 1}": lengths_in(table, section, h) for k, h in enumerate(headings)}
        pressure = pressures_in(table, section)
        columns_read = dict(zip(values, headings, strict=True))
        columns_read["pressure"] = table.column("pressure")
        source = table.source(columns_read, {"pressure": section.pressure_unit}, table.notes)
        specimens = SpecimenTable(pressure, values, path, source)
        tables += [specimens.subset(rows) for rows in specimen_rows(table)]
    return tables


def loading_rows(pressure: Array, inflation: int, place_words: str = "") -> NDArray[np.intp]:
    """Return the rows of one inflation of a specimen that are under pressure.

    Parameters
    ----------
    pressure : (n,) array, MPa
        In the order of the readings.
    inflation : int
        Number of the inflation, from 1.
    place_words : str
        File, for messages.

    Raises
    ------
    InputError
        There is no such inflation, or no pressure in it.
    """
    inflations = branches_of(pressure)[::2]
    if inflation > len(inflations):
        problem = f"expected at most {len(inflations)}, as many as the pressure of a specimen has"
        raise InputError(None, "inflation", f"{problem}{place_words}")
    rows = inflations[inflation - 1]
    return rows[pressure[rows] > LIMITS.least_pressure * pressure[rows].max()]


def _series(
    quantity: Quantity,
    label: str,
    column: str,
    tables: Sequence[SpecimenTable],
    inflation: int,
    xy: Array,
    moves_with_sheet: bool,
) -> ReadingSeries:
    """Return the readings of all specimens in one column, thinned where they are many."""
    pressures = []
    values = []
    specimens = []
    for number, table in enumerate(tables):
        rows = loading_rows(table.pressure, inflation)
        parts = np.array_split(rows, min(len(rows), LIMITS.max_readings) or 1)
        # The height is about linear in the root: means of both lie on the curve.
        pressures += [np.cbrt(table.pressure[part]).mean() ** 3 for part in parts]
        values += [table.values[column][part].mean() for part in parts]
        specimens += [number] * len(parts)
    positions = np.tile(xy, (len(values), 1))
    return ReadingSeries(
        quantity,
        label,
        np.array(pressures),
        np.array(values),
        positions,
        np.array(specimens, dtype=np.intp),
        moves_with_sheet,
    )


def _data_files(tables: Sequence[SpecimenTable], inflation: int) -> tuple[DataFile, ...]:
    """Return the files that were read, with how many of their rows are used."""
    files = []
    for table in tables:
        if table.file is None:
            continue
        used = len(loading_rows(table.pressure, inflation))
        dropped = {OTHER_INFLATION: len(table.pressure) - used}
        files.append(DataFile(table.file, table.source, used, dropped))
    return tuple(files)
