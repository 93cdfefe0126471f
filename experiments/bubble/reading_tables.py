"""Read tables of a bubble without a camera: heights at places, profiles along lines, the apex."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ...readers.frames import frame_files
from ...readers.inflations import branches_of
from ...readers.machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from ...readers.quantities import FILL, WARP, columns_named, columns_of, is_along_fill
from ...readers.units import CURVATURE_UNITS, LENGTH_UNITS, PRESSURE_UNITS, STRAIN_UNITS
from ...solvers.base import Array
from ..data_files import DataFile
from ..sections import Place, named_format
from .readings import (
    LIMITS,
    ApexSection,
    GaugeReadings,
    HeightsSection,
    ProfilesSection,
    Quantity,
    ReadingSeries,
    TableSection,
)
from .section import BubbleSection, outline_of

#: Units of columns, and the key of those that have none, by the first word of a quantity.
CHANNELS: Mapping[str, tuple[Mapping[str, float], str]] = {
    "pressure": (PRESSURE_UNITS, "pressure_unit"),
    "height": (LENGTH_UNITS, "length_unit"),
    "coordinate": (LENGTH_UNITS, "length_unit"),
    "curvature": (CURVATURE_UNITS, "curvature_unit"),
    "strain": (STRAIN_UNITS, "strain_unit"),
}
#: Directions of lines and curvatures, degrees from the warp.
AXES = dict.fromkeys(WARP, 0.0) | dict.fromkeys(FILL, 90.0)
#: Span of curvatures and strains over the radius, where it is not given.
USUAL_SPAN = 0.2


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
    data = section.data
    if not data.has_readings:
        return None
    assert section.inflation != "all"
    outline = outline_of(section, place, None)
    files: list[DataFile] = []
    series: list[ReadingSeries] = []
    if data.heights is not None:
        series += _heights(data.heights, place, section.inflation, files)
    if data.profiles is not None:
        listed = section.pressures
        series += _profiles(data.profiles, place, listed, section.inflation, files)
    noise: dict[Quantity, float] = {}
    if data.apex is not None:
        span = data.apex.span or USUAL_SPAN * outline.radius
        series += _apex(data.apex, place, section.inflation, files, span)
        for quantity, level in data.apex.noise_of.items():
            noise[quantity] = level
    if place.need_data and not series:
        problem = "no reading is at a pressure above zero: reverse the sign, or exchange columns"
        raise place.error("data", problem)
    is_within = [outline.share(s.positions) < 1.0 for s in series]
    for s, rows in zip(series, is_within, strict=True):
        if not rows.any():
            problem = f"{s.label}: expected places within {outline.words}"
            raise place.error("data", problem)
    parts = [s.subset(rows) for s, rows in zip(series, is_within, strict=True)]
    return GaugeReadings(tuple(parts), tuple(files), noise)


def _check_nuisance(section: BubbleSection, place: Place) -> None:
    """Refuse keys that need fields of a camera beside readings, and those of readings elsewhere."""
    nuisance = section.nuisance
    if section.data.heights is None and section.data.profiles is None:
        for key in ("height_offset", "height_scale"):
            if getattr(nuisance, key) is not None:
                problem = "is of gauges: there is no [bubble.data.heights]"
                raise place.error(f"nuisance.{key}", problem)
    if not section.data.has_readings:
        return
    keys_of_fields = {
        "inflation": section.inflation == "all",
        "radius": section.radius == "clamp",
        "match.by": section.match.by == "surfaces",
        "nuisance.displacement_offset": nuisance.displacement_offset,
        "nuisance.registration": nuisance.registration == "fitted",
        "nuisance.tilt": nuisance.tilt is not None,
        "nuisance.shift": nuisance.shift is not None,
        "nuisance.turn": nuisance.turn is not None,
        "sheet.constant_field": bool(section.sheet.constant_field),
        "sheet.from_pressure": section.sheet.from_pressure is not None,
    }
    for key, is_set in keys_of_fields.items():
        if is_set:
            raise place.error(key, "needs fields of a camera, and there are tables of readings")
    if section.data.apex is not None and section.sheet.modes:
        problem = "cannot be told from readings of the apex: its curvature at rest is not measured"
        raise place.error("sheet.modes", problem)


def _heights(
    section: HeightsSection, place: Place, inflation: int, files: list[DataFile]
) -> list[ReadingSeries]:
    """Return the series of each gauge, and add the files that were read."""
    places = section.places or [[0.0, 0.0]]
    quantities = [f"height {number + 1}" for number in range(len(places))]
    tables = _tables(section, place, "data.heights", ["pressure", *quantities], files)
    table, left_out = _loadings(tables, inflation)
    series = []
    for quantity, xy in zip(quantities, places, strict=True) if len(table) else ():
        label = f"{quantity if places.count(xy) > 1 else 'height'} at ({xy[0]:g}, {xy[1]:g}) mm"
        positions = np.tile(xy, (len(table), 1))
        heights = _series("height", label, table, quantity, positions)
        at_rest = _height_at_rest(tables, quantity)
        series.append(replace(heights, at_rest=at_rest, left_out=left_out))
    return [replace(s, moves_with_sheet=section.moves_with_sheet) for s in series]


def _height_at_rest(tables: Sequence[pd.DataFrame], quantity: str) -> float | None:
    """Return the mean height (mm) without pressure before the largest one; None without any."""
    heights: list[float] = []
    for table in tables:
        pressure = table["pressure"].to_numpy(float)
        before = pressure[: np.argmax(pressure)]
        is_at_rest = before <= LIMITS.least_pressure * pressure.max()
        first_loaded = len(before) if is_at_rest.all() else int(np.argmin(is_at_rest))
        heights += table[quantity].iloc[:first_loaded].dropna().tolist()
    return float(np.mean(heights)) if heights else None


def _profiles(
    section: ProfilesSection,
    place: Place,
    pressures: Sequence[float] | None,
    inflation: int,
    files: list[DataFile],
) -> list[ReadingSeries]:
    """Return the series of each line, and add the files that were read.

    `pressures` (MPa) are those of the files, where these have no such column.
    """
    first = len(files)
    tables = _tables(section, place, "data.profiles", ["coordinate", "height"], files)
    if not tables:
        return []
    along_lines = _with_axes(tables, section, files[first:], place)
    lines = _with_pressures(along_lines, place, pressures)
    points, left_out = _profiles_of_inflation(lines, inflation)
    moves = section.moves_with_sheet
    series = []
    for axis, line in points.groupby("axis", sort=False):
        angle = np.radians(_direction_of_line(str(axis).lower(), place))
        profiles = [_thinned(profile) for _, profile in line.groupby(["pressure", "specimen"])]
        table = pd.concat(profiles)
        positions = np.outer(table["coordinate"], [np.cos(angle), np.sin(angle)])
        heights = _series("height", f"heights along {axis}", table, "height", positions)
        series.append(replace(heights, moves_with_sheet=moves, left_out=left_out))
    return series


def _with_pressures(
    tables: Sequence[pd.DataFrame], place: Place, pressures: Sequence[float] | None
) -> Sequence[pd.DataFrame]:
    """Return tables of profiles with a column of pressures (MPa).

    Where they have none, those of each line are one a table.
    """
    for column in ("pressure", "specimen"):
        _check_in_all(tables, column, place)
    if "pressure" in tables[0]:
        return tables
    by_axis: dict[str, list[pd.DataFrame]] = {}
    for table in tables:
        by_axis.setdefault(table["axis"].iloc[0], []).append(table)
    for axis, along in by_axis.items():
        if pressures is None or len(pressures) != len(along):
            problem = f"expected one for each of {len(along)} tables without such a column"
            raise place.error("pressures", f"{problem}, along {axis}")
    return [
        table.assign(pressure=pressure)
        for along in by_axis.values()
        for table, pressure in zip(along, pressures or (), strict=True)
    ]


def _check_in_all(tables: Sequence[pd.DataFrame], column: str, place: Place) -> None:
    """Refuse a column that some tables of profiles have, and others not."""
    if len({column in table for table in tables}) > 1:
        problem = f"expected a column of the {column} in all tables of [bubble.data.profiles]"
        raise place.error("data.profiles.files", f"{problem} or in none")


def _with_axes(
    tables: Sequence[pd.DataFrame],
    section: ProfilesSection,
    files: Sequence[DataFile],
    place: Place,
) -> Sequence[pd.DataFrame]:
    """Return tables of profiles with a column of axes, that of one line a table if they have none.

    The line is along the fill where the name of its coordinate says that, and the section nothing.
    """
    _check_in_all(tables, "axis", place)
    if "axis" in tables[0]:
        return tables
    axes = [str(section.direction_deg)] * len(tables)
    if "direction_deg" not in section.model_fields_set:
        for number, file in enumerate(files):
            if is_along_fill(file.source.columns["coordinate"]):
                axes[number] = str(AXES["fill"])
    return [table.assign(axis=axis) for table, axis in zip(tables, axes, strict=True)]


def _profiles_of_inflation(
    tables: Sequence[pd.DataFrame], inflation: int
) -> tuple[pd.DataFrame, int]:
    """Return the rows of one inflation of each line of each specimen, and the number of others.

    The specimens get numbers, and rows without pressure do not count.

    Tables of a pressure each are in order of time; one of several pressures begins at rest.
    """
    has_inflations = any(table["pressure"].nunique() > 1 for table in tables)
    recordings = range(len(tables)) if has_inflations else [0] * len(tables)
    points = pd.concat(
        [table.assign(recording=k) for table, k in zip(tables, recordings, strict=True)],
        ignore_index=True,
    )
    specimens = pd.factorize(points["specimen"])[0] if "specimen" in points else 0
    points = points.assign(specimen=specimens)
    parts: list[pd.DataFrame] = []
    for _, line in points.groupby(["recording", "axis", "specimen"], sort=False):
        parts += _runs_of_inflation(line, inflation)
    least = LIMITS.least_pressure * points["pressure"].max()
    loaded = int((points["pressure"] > least).sum())
    points = pd.concat(parts).sort_index()
    points = points[points["pressure"] > least]
    return points, loaded - len(points)


def _runs_of_inflation(line: pd.DataFrame, inflation: int) -> list[pd.DataFrame]:
    """Return the rows of one inflation of a line: its profiles one by one, or place by place."""
    scatter = LIMITS.pressure_scatter * line["pressure"].max()
    profile = (line["pressure"].diff().abs() > scatter).cumsum()
    is_by_place = line["coordinate"].diff().ne(0.0).sum() < 1 + profile.iloc[-1]
    parts = []
    for _, rows in line.groupby("coordinate") if is_by_place else [(0, line)]:
        runs = pd.factorize(profile[rows.index])[0]
        pressures = rows["pressure"].groupby(runs).first().to_numpy(float)
        parts.append(rows[np.isin(runs, loading_rows(pressures, inflation))])
    return parts


def _direction_of_line(name: str, place: Place) -> float:
    """Return the direction of a line in degrees from the warp, by what a column says of it."""
    if name in AXES:
        return AXES[name]
    try:
        return float(name)
    except ValueError:
        problem = f"expected x, y or degrees from the warp in this column, got {name!r}"
        raise place.error("data.profiles.columns.axis", problem) from None


def _thinned(table: pd.DataFrame) -> pd.DataFrame:
    """Return at most `LIMITS.max_points` rows of a profile, evenly spread."""
    count = min(len(table), LIMITS.max_points)
    return table.iloc[np.linspace(0, len(table) - 1, count).round().astype(int)]


def _apex(
    section: ApexSection,
    place: Place,
    inflation: int,
    files: list[DataFile],
    span: float,
) -> list[ReadingSeries]:
    """Return the series of curvatures and strains.

    Parameters
    ----------
    span : float, mm
        Over which they are measured.
    """
    source = section.columns if section.values is None else section.values
    stated = source.model_dump(exclude_none=True)
    quantities = [name for name in stated if name.startswith(("curvature", "strain"))]
    if not quantities:
        problem = "name one: curvature_warp, curvature_fill, strain_warp or strain_fill"
        raise place.error("data.apex.columns", problem)
    tables = _tables(section, place, "data.apex", ["pressure", *quantities], files)
    table, left_out = _loadings(tables, inflation)
    series = []
    for name in quantities if len(table) else ():
        quantity: Quantity = "curvature" if name.startswith("curvature") else "strain"
        yarn = name.rpartition("_")[2]
        angle = np.radians(AXES[yarn])
        label = f"{quantity} of the apex along the {yarn}"
        at_apex = _series(quantity, label, table, name, np.zeros((len(table), 2)))
        series.append(
            replace(
                at_apex,
                value=section.measure(quantity, at_apex.value),
                direction=(float(np.cos(angle)), float(np.sin(angle))),
                span=span,
                left_out=left_out,
            )
        )
    return series


def _tables(
    section: TableSection,
    place: Place,
    key: str,
    quantities: Sequence[str],
    files: list[DataFile],
) -> list[pd.DataFrame]:
    """Return the tables of a section in MPa, mm and plain numbers, one a file; add the files.

    Columns are the quantities, and pressure, axis and specimen where the file has them.

    Parameters
    ----------
    key : str
        Dotted key of the section below the test's.
    """
    if section.values is not None:
        for unit in sorted(name for name in section.model_fields_set if name.endswith("_unit")):
            problem = "is of files; values are in the units of the project, 1/mm and mm/mm"
            raise place.error(f"{key}.{unit}", problem)
        return [_typed_table(section.values.model_dump(exclude_none=True), place, key, quantities)]
    tables = []
    for path in _files(section, place, key):
        table, file = _read_table(path, section, quantities)
        tables.append(table)
        files.append(file)
    return tables


def _typed_table(
    values: dict[str, Any], place: Place, key: str, quantities: Sequence[str]
) -> pd.DataFrame:
    """Return the table of values in the project; its `height` may be a list for each place."""
    if "height 1" in quantities:
        heights = values.pop("height")
        columns = heights if heights and isinstance(heights[0], list) else [heights]
        values |= {f"height {number + 1}": column for number, column in enumerate(columns)}
    sizes = {len(column) for column in values.values()}
    if len(sizes) > 1 or not {*quantities} <= {*values} or len(values) > len(quantities) + 2:
        problem = f"expected lists of equal length: {', '.join(quantities)}"
        raise place.error(f"{key}.values", problem)
    return pd.DataFrame(values)


def _files(section: TableSection, place: Place, key: str) -> Sequence[Path]:
    """Return the files of a table; none if no data are needed and they are missing."""
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


def _read_table(
    path: Path, section: TableSection, quantities: Sequence[str]
) -> tuple[pd.DataFrame, DataFile]:
    """Return the columns of a file by quantity, and the record of the file."""
    named = section.columns.model_dump(exclude_none=True)
    heights = named.pop("height", [])
    if isinstance(heights, str):
        heights = [heights]
    if heights:
        named["height"] = heights[0]
    needed = tuple(dict.fromkeys(name.partition(" ")[0] for name in quantities))
    # The decimal mark is that of all columns that are read.
    further = {f"height {k}": name for k, name in enumerate(heights[1:], start=2)}
    columns = named | further
    options = TableOptions(columns, needed, section.comment, section.decimal, section.sheet)
    table = read_machine_table(path, options, section.format)
    gauges = [name for name in quantities if name.startswith("height ")]
    headings = _gauge_columns(table, gauges, heights) if gauges else {}
    plain = [name for name in needed if not (gauges and name == "height")]
    for name in (*plain, "pressure", "axis", "specimen"):
        if table.column(name):
            headings[name] = table.column(name)
    contents: dict[str, Any] = {}
    stated: dict[str, str | None] = {}
    notes = [*table.notes]
    for name, column in headings.items():
        contents[name], stated[name] = _contents(table, section, name, column)
        notes += _notes_of_holes(table, column, contents[name])
    source = table.source(headings, stated, notes)
    return pd.DataFrame(contents), DataFile(path, source, None)


def _notes_of_holes(table: MachineTable, column: str, contents: Any) -> list[str]:
    """Return a note on missing readings of a column, if any; InputError if all are missing."""
    missing = int(pd.isna(contents).sum())
    if missing == len(contents):
        raise table.error(column, "holds no number")
    return [f"{missing} of {len(contents)} readings of {column!r} missing"] * (missing > 0)


def _contents(
    table: MachineTable, section: TableSection, name: str, column: str
) -> tuple[Any, str | None]:
    """Return the contents of the column of a quantity, and the unit that the section states."""
    if name == "specimen":
        return table.specimens(column), None
    if name == "axis":
        return table.table.text(column), None
    units, unit_key = CHANNELS[name.partition(" ")[0].partition("_")[0]]
    if isinstance(section, ApexSection) and units is CURVATURE_UNITS:
        _check_unit_of_curvature(table, column, section)
    unit = getattr(section, unit_key, None)
    # One instrument may have missed a reading that the others have.
    holes = name not in ("pressure", "coordinate")
    return table.values(column, units, Channel(unit=unit), unit_key, holes), unit


def _check_unit_of_curvature(table: MachineTable, column: str, section: ApexSection) -> None:
    """Refuse a curvature in a length, and a radius in another unit."""
    unit = table.units[column] or section.curvature_unit
    is_radius = section.curvature_is == "radius"
    if unit in CURVATURE_UNITS and (unit in LENGTH_UNITS) != is_radius:
        problem = (
            f"{unit} is no unit of curvature_is = {section.curvature_is!r}: "
            'a "radius" is in mm or m, a "curvature" or "half" of it in 1/mm, 1/m or 1/cm'
        )
        raise table.error(column, problem)


def _gauge_columns(
    table: MachineTable, gauges: Sequence[str], named: Sequence[str]
) -> dict[str, str]:
    """Return the column of each gauge, of those named or else found."""
    columns = _named_columns(table, named)
    if not named:
        columns = [table.names[i] for i in columns_of(table.names, "height", {})]
    if not named and len(columns) < len(gauges):
        # Gauges that are named by their places: all columns of a length.
        columns = [name for name in table.names if table.units[name] in CHANNELS["height"][0]]
    if len(columns) != len(gauges):
        problem = (
            f"expected a column of heights for each of {len(gauges)} places, got {len(columns)}: "
            f"{', '.join(columns)}; columns.height names them, places gives [x, y] of each"
        )
        raise InputError(table.table.path, f"line {table.header}", problem)
    return dict(zip(gauges, columns, strict=True))


def _named_columns(table: MachineTable, named: Sequence[str]) -> list[str]:
    """Return the columns of names, which may be without the unit; InputError unless one each."""
    columns: list[str] = []
    for name in named:
        indices = columns_named(table.names, name.strip())
        if len(indices) != 1:
            problem = "appears twice" if indices else "is missing"
            raise table.error(name, f"{problem}; the file has: {', '.join(table.names)[:300]}")
        column = table.names[indices[0]]
        if column in columns:
            raise table.error(column, "is named by columns.height for two places")
        columns.append(column)
    return columns


def _loadings(tables: Sequence[pd.DataFrame], inflation: int) -> tuple[pd.DataFrame, int]:
    """Return the rows of one inflation of all specimens, and the number of others under pressure.

    The specimens get numbers.

    Of more readings of a specimen than `LIMITS.max_readings`, neighbours are averaged.
    """
    parts: list[pd.DataFrame] = []
    left_out = 0
    for table in tables:
        labels = table["specimen"] if "specimen" in table else np.zeros(len(table))
        for _, specimen in table.groupby(labels, sort=False):
            pressure = specimen["pressure"].to_numpy(float)
            rows = loading_rows(pressure, inflation)
            left_out += int((pressure > LIMITS.least_pressure * pressure.max()).sum()) - len(rows)
            loading = specimen.iloc[rows].drop(columns=["specimen", "axis"], errors="ignore")
            count = len(rows)
            group = np.arange(count) * min(count, LIMITS.max_readings) // max(count, 1)
            # The height is about linear in the root: means of both lie on the curve.
            means = loading.assign(pressure=np.cbrt(loading["pressure"])).groupby(group).mean()
            means["pressure"] **= 3
            parts.append(means.assign(specimen=len(parts)))
    return pd.concat(parts) if parts else pd.DataFrame(), left_out


def loading_rows(pressure: Array, inflation: int) -> NDArray[np.intp]:
    """Return the rows of one inflation of a specimen that are under pressure.

    Parameters
    ----------
    pressure : (n,) array, MPa
        In the order of the readings.
    inflation : int
        Number of the inflation, from 1.

    Raises
    ------
    InputError
        There is no such inflation, or no pressure in it.
    """
    inflations = branches_of(pressure)[::2]
    if inflation > len(inflations):
        problem = f"expected at most {len(inflations)}, as many as the pressure of a specimen has"
        raise InputError(None, "inflation", problem)
    rows = inflations[inflation - 1]
    return rows[pressure[rows] > LIMITS.least_pressure * pressure[rows].max()]


def _series(
    quantity: Quantity,
    label: str,
    table: pd.DataFrame,
    column: str,
    positions: Array,
) -> ReadingSeries:
    """Return the series of a column of a table of readings, without rows that lack one.

    Parameters
    ----------
    positions : (n, 2) array, mm
        Where the readings were taken.
    """
    series = ReadingSeries(
        quantity,
        label,
        table["pressure"].to_numpy(float),
        table[column].to_numpy(float),
        positions,
        table["specimen"].to_numpy(np.intp),
    )
    return series.subset(np.isfinite(series.value))
