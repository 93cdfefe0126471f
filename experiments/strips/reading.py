"""The section [[strips]] of a project, and the data that it names, by direction.

Files of a direction hold load curves, or polynomials through them.
"""

import glob
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError, Problems
from ...readers.curves import (
    DIRECTIONS,
    LengthUnit,
    LoadCurve,
    LoadPolynomial,
    LoadUnit,
    cut_of,
    direction_named,
    fit_load_polynomial,
    in_order,
    read_load_curves,
    read_published_polynomials,
    specimen_deviation,
    split_at_restarts,
)
from ...readers.sections import Length, Name, Positive, Section, Size, Weight
from ...storage.reading import is_file, missing_file_reason
from ..sections import FileNames, Place, TableFilesSection, listed_files, named_format
from .data import Strip

Match = Literal["polynomial", "points"]
ErrorUnit = Literal["N", "relative"]


class GaugeSection(Section):
    """Section [strips.warp], fill or bias: the virtual strain gauge at rest and at the end.

    That of "bias" is also the gauge of strips at further angles, such as "15 degrees".
    """

    gauge_length: Size | None = None
    final_length: Size | None = None


class StripColumnsSection(Section):
    """Section [strips.data.columns]: the files' own column names."""

    elongation: str | None = None
    load: str | None = None
    lateral: str | None = None  # engineering strain across the strip
    specimen: str | None = None
    direction: str | None = None


class FilesSection(Section):
    """File names by direction; the files themselves need no column of directions."""

    warp: FileNames | None = None
    fill: FileNames | None = None
    bias: FileNames | None = None


def _files(value: Any) -> Any:
    """Return the files of a section, as a table of names or as a list, checked."""
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    if isinstance(value, dict):
        return FilesSection.model_validate(value)
    return value if value is None else TypeAdapter(FileNames).validate_python(value, strict=True)


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


class CurvesSection(TableFilesSection):
    """Section [strips.data]: load curves, as polynomials or as measured.

    `directions` lists files, or one, by the angle from the warp in degrees.
    """

    polynomials: str | None = None
    files: Annotated[list[str] | FilesSection | None, BeforeValidator(_files)] = None
    directions: dict[str, Annotated[FileNames, BeforeValidator(_as_list)]] | None = None
    columns: StripColumnsSection = StripColumnsSection.model_construct()
    load_unit: LoadUnit | None = None
    length_unit: LengthUnit | None = None
    until_largest_load: bool = False
    order: Annotated[int, Field(ge=1, le=10)] = 4
    through_origin: bool = True
    specimens: Annotated[int, Field(ge=1, le=10000)] | None = None


class WeightsSection(Section):
    """Section [strips.weights]: weight of each direction's error in the objective."""

    warp: Weight = 1.0
    fill: Weight = 1.0
    bias: Weight = 1.0


class StripsSection(GaugeSection):
    """Section [[strips]]: cut strips pulled along warp, fill and across the yarns."""

    name: Name | None = None
    width: Size | None = None
    side_by_side: Annotated[int, Field(ge=1, le=1000)] = 1
    grip_distance: Size | None = None
    bias_angle: Annotated[float, Field(ge=0, le=90)] = 45.0
    increments: Annotated[int, Field(ge=1, le=10000)] = 100
    warp: GaugeSection | None = None
    fill: GaugeSection | None = None
    bias: GaugeSection | None = None
    data: CurvesSection
    noise: Positive | None = None
    compliance: Annotated[float, Field(ge=0)] = 0.0  # mm/N, of machine and grips
    compliance_prior: Positive | None = None  # mm/N, standard deviation of it
    rate: Length | None = None
    conditioning: Name | None = None
    match: Match = "polynomial"
    objective: ErrorUnit = "N"
    weight: Weight = 1.0
    weights: WeightsSection = WeightsSection.model_construct()

    def gauge(self, direction: str) -> GaugeSection:
        """Return the lengths of a direction's gauge, or of all strips where it has none."""
        gauge = getattr(self, cut_of(direction)) or GaugeSection()
        return GaugeSection(
            gauge_length=gauge.gauge_length or self.gauge_length,
            final_length=gauge.final_length or self.final_length,
        )


#: A file that a section lists, its key in the section, and the direction that it is listed for.
ListedFile = tuple[Path, str, str | None]


def files_of(place: Place, data: CurvesSection, folder: Path) -> list[ListedFile]:
    """Return the files that [strips.data] lists, whether they exist or not, in its order."""
    if data.polynomials is not None:
        return [(folder / data.polynomials, "data.polynomials", None)]
    at = "data.files"
    patterns: Any = {None: data.files}
    if isinstance(data.files, FilesSection):
        patterns = data.files.model_dump(exclude_none=True)
    if data.directions is not None:
        at = "data.directions"
        patterns = {}
        for angle, files in data.directions.items():
            direction = direction_named(f"{angle} deg", place.path, f"{place.at}.{at}")
            if direction in patterns:
                raise place.error(f"{at}.{angle}", f"{direction} is listed twice; join the lists")
            patterns[direction] = files
    if not patterns:
        problem = "expected files of one direction at least: { warp = [...], fill = [...] }"
        raise place.error(at, problem)
    names = {
        direction: [match for pattern in of_direction for match in _matches(folder, pattern)]
        for direction, of_direction in patterns.items()
    }
    return listed_files(place, folder, names, at)


def _matches(folder: Path, name: str) -> list[str]:
    """Return the files that match a pattern such as "warp*.csv", or else the name itself."""
    is_pattern = glob.has_magic(name) and not Path(name).is_absolute()
    if not is_pattern or is_file(folder / name):
        return [name]
    matches = glob.glob(name, root_dir=folder, recursive=True)
    return sorted(match for match in matches if is_file(folder / match)) or [name]


def measured_curves(
    place: Place,
    data: CurvesSection,
    listed: Sequence[ListedFile],
    width: float,
    gauges: Mapping[str, float],
) -> dict[str, tuple[LoadCurve, ...]]:
    """Read the load curves of all specimens, by direction: warp, fill, then by the angle.

    A file with one curve in a direction may list several specimens one after the other without
    names: its curve is split where the elongation starts again.

    Parameters
    ----------
    place : Place
        Place of the section in its project, with any curves in memory.
    data : CurvesSection
        Columns, units and format of the files.
    listed : sequence of ListedFile
        Files to read.
    width : float, mm
        Width of the strips.
    gauges : mapping, mm
        Gauge lengths by direction.

    Raises
    ------
    InputError
        A file cannot be read, or is listed for two directions and does not tell them apart.
    """
    exports: list[Sequence[LoadCurve]] = []
    if place.measured is not None:
        exports.append(place.measured)
    format = named_format(place, "data.format", "machine table", data.format)
    first_curves: dict[Path, LoadCurve] = {}
    for path, field, direction in listed:
        curves = read_load_curves(
            path,
            columns=data.columns.model_dump(exclude_none=True) or None,
            width=width,
            direction=direction,
            gauge_length=gauges,
            format=format,
            load_unit=data.load_unit,
            length_unit=data.length_unit,
            comment=data.comment,
            decimal=data.decimal,
            sheet=data.sheet,
        )
        first = first_curves.setdefault(path, curves[0])
        if first.direction != curves[0].direction and _are_equal(first, curves[0]):
            problem = f"is listed for {first.direction} too, and does not tell the two apart"
            raise place.error(field, problem)
        exports.append(curves)
    directions = {curve.direction for curves in exports for curve in curves}
    return {
        direction: tuple(
            curve
            for curves in exports
            for curve in _specimens(place, curves, direction, data.until_largest_load)
        )
        for direction in in_order(directions)
    }


def _are_equal(first: LoadCurve, second: LoadCurve) -> bool:
    """Return whether two curves have the same elongations and loads."""
    has_same_elongation = np.array_equal(first.elongation, second.elongation)
    return has_same_elongation and np.array_equal(first.load, second.load)


def _specimens(
    place: Place, curves: Sequence[LoadCurve], direction: str, until_largest_load: bool
) -> Sequence[LoadCurve]:
    """Return the curves of a direction in one file; unnamed specimens are separated.

    Raise InputError where the loads of a specimen have the sign of compression.
    """
    specimens = [curve for curve in curves if curve.direction == direction]
    for curve in specimens:
        lowest, highest = np.min(curve.load), np.max(curve.load)
        if -lowest > highest:
            problem = (
                f"{direction}, {curve.specimen}: the loads go from {highest:.4g} to {lowest:.4g} N,"
                " and that of a pulled strip is above zero: reverse their sign in the file"
            )
            raise place.error("data", problem)
    if len(specimens) == 1:
        parts = split_at_restarts(specimens[0])
        specimens = list(parts) if len(parts) > 1 else specimens
    if until_largest_load:
        return [curve.until_largest_load() for curve in specimens]
    return specimens


def read_strips(place: Place, section: StripsSection, width: float) -> dict[str, Strip]:
    """Return the strips of a section by direction.

    Missing data are no error where the place needs no data and all lengths are given.

    Parameters
    ----------
    place : Place
        Place of the section in its project.
    section : StripsSection
        Section with all lengths in mm.
    width : float, mm
        Width of the strips.

    Raises
    ------
    InputError
        Data or lengths are missing.
    """
    data = section.data
    tables = {d: section.gauge(d) for d in DIRECTIONS if getattr(section, d) is not None}
    listed: list[ListedFile] = []
    if place.measured is None:
        if _is_without_data(place, data, tables):
            return _without_data(place, tables)
        listed = files_of(place, data, place.folder(data.folder))
    if _is_file_missing(place, listed, tables):
        return _without_data(place, tables)
    if data.polynomials is not None:
        strips = _published(place, section, tables, listed[0][0])
    else:
        strips = _measured(place, section, tables, listed, width)
    if not strips:
        problem = f"these data hold none of the directions {', '.join(tables or DIRECTIONS)}"
        raise place.error("data", problem)
    return strips


def _is_file_missing(
    place: Place, listed: Sequence[ListedFile], tables: Mapping[str, GaugeSection]
) -> bool:
    """Return whether a file is missing; InputError if one is missing that is needed."""
    missing = [(path, field) for path, field, _ in listed if not is_file(path)]
    problems = Problems()
    for path, field in missing:
        if place.need_data or not _has_all_lengths(tables):
            problem = f"{missing_file_reason(path)}; --data DIR names another folder"
            problems.errors.append(place.error(field, problem))
    problems.raise_if_any()
    return bool(missing)


def _is_without_data(place: Place, data: CurvesSection, tables: Mapping[str, GaugeSection]) -> bool:
    """Return whether a section has no data and needs none.

    InputError is raised if it names no source of data and needs one, or if it names two.
    """
    sources = [s for s in (data.polynomials, data.files, data.directions) if s is not None]
    if not sources and not place.need_data and _has_all_lengths(tables):
        return True
    if len(sources) != 1:
        problem = "expected exactly one of 'polynomials' and 'files' (or 'directions')"
        raise place.error("data", problem)
    return False


def _has_all_lengths(tables: Mapping[str, GaugeSection]) -> bool:
    """Return whether each direction has both lengths of its gauge, at rest and at the end."""
    lengths = [length for t in tables.values() for length in (t.gauge_length, t.final_length)]
    return bool(lengths) and None not in lengths


def _without_data(place: Place, tables: Mapping[str, GaugeSection]) -> dict[str, Strip]:
    """Return strips without data, of the given lengths, by direction."""
    return {
        direction: _strip(place, direction, table.gauge_length or 0.0, table.final_length or 0.0)
        for direction, table in tables.items()
    }


def _published(
    place: Place,
    section: StripsSection,
    tables: Mapping[str, GaugeSection],
    path: Path,
) -> dict[str, Strip]:
    """Return the strips of a file of load polynomials, by direction."""
    for key in ("compliance", "compliance_prior"):
        if getattr(section, key):
            raise place.error(key, "needs measured points (data.files), not polynomials")
    format = named_format(place, "data.format", "load polynomials", section.data.format)
    curves = read_published_polynomials(path, format)
    strips = {}
    for direction in in_order(curves):
        if tables and cut_of(direction) not in tables:
            continue
        curve = curves[direction]
        gauge = section.gauge(direction)
        strips[direction] = _strip(
            place,
            direction,
            gauge.gauge_length or curve.gauge_length,
            gauge.final_length or curve.final_length,
            curve.polynomial,
            scatter=None if np.isnan(curve.scatter) else curve.scatter,
            published=path,
        )
    problems = Problems()
    _add_missing_directions(place, tables, curves, problems)
    problems.raise_if_any()
    return strips


def _measured(
    place: Place,
    section: StripsSection,
    tables: Mapping[str, GaugeSection],
    listed: Sequence[ListedFile],
    width: float,
) -> dict[str, Strip]:
    """Return the strips with measured load curves, by direction."""
    data = section.data
    listed_directions = {direction for _, _, direction in listed}
    lengths = {d: section.gauge(d).gauge_length for d in DIRECTIONS}
    gauges = {d: length for d, length in lengths.items() if length is not None}
    strips = {}
    problems = Problems()
    curves_by_direction = measured_curves(place, data, listed, width, gauges)
    for direction, curves in curves_by_direction.items():
        # A section such as [strips.warp] selects among the directions that a file holds; a file
        # that is listed for a direction is always taken.
        if tables and cut_of(direction) not in tables and direction not in listed_directions:
            continue
        gauge = section.gauge(direction)
        # What machine and grips give is no elongation of the strip.
        curves = tuple(
            replace(curve, elongation=curve.elongation - section.compliance * curve.load)
            for curve in curves
        )
        with problems.collected():
            strips[direction] = _measured_strip(place, data, direction, curves, gauge)
    _add_missing_directions(place, tables, curves_by_direction, problems)
    problems.raise_if_any()
    return strips


def _add_missing_directions(
    place: Place, tables: Collection[str], directions: Collection[str], problems: Problems
) -> None:
    """Add a problem for each section of a direction that the data do not hold beside others."""
    cuts = {cut_of(direction) for direction in directions}
    for direction in tables if any(d in cuts for d in tables) else ():
        if direction not in cuts:
            problem = f"the data hold no {direction} test; leave this section out or add its data"
            problems.errors.append(place.error(direction, problem))


def _measured_strip(
    place: Place,
    data: CurvesSection,
    direction: str,
    curves: tuple[LoadCurve, ...],
    gauge: GaugeSection,
) -> Strip:
    """Return the strip of a direction with measured load curves; raise InputError."""
    if gauge.gauge_length is None:
        problem = "this key is missing; the strain follows from it"
        raise place.error(f"{cut_of(direction)}.gauge_length", problem)
    polynomial, scatter = _fitted_polynomial(place, data, direction, curves)
    return _strip(
        place,
        direction,
        gauge.gauge_length,
        gauge.final_length or gauge.gauge_length + polynomial.end,
        polynomial,
        open_end=gauge.final_length is None,
        curves=curves,
        scatter=scatter,
        through_origin=data.through_origin,
    )


def _fitted_polynomial(
    place: Place,
    data: CurvesSection,
    direction: str,
    curves: Sequence[LoadCurve],
    *,
    min_freedom: int = 3,
) -> tuple[LoadPolynomial, float | None]:
    """Return the polynomial through the curves of a direction, and their scatter (N) about it.

    Unless its order is given, it leaves `min_freedom` degrees of freedom to the scatter.
    """
    elongation = np.concatenate([curve.elongation for curve in curves])
    load = np.concatenate([curve.load for curve in curves])
    order = data.order
    if "order" not in data.model_fields_set and len(elongation) >= order:
        # A curve through each of few points would leave no scatter.
        order = max(1, min(order, len(elongation) - min_freedom))
    try:
        polynomial = fit_load_polynomial(elongation, load, order, data.through_origin)
        return polynomial, specimen_deviation(elongation, load, polynomial)
    except InputError as error:
        problem = f"no load curve through the {direction} points: {error.problem}"
        raise place.error(f"data, {error.field}", problem) from None


def _strip(
    place: Place,
    direction: str,
    start: float,
    end: float,
    polynomial: LoadPolynomial | None = None,
    **data: Any,
) -> Strip:
    """Return a strip of gauge length `start` and final length `end` (mm).

    InputError is raised for a final length that is too short or beyond the data.
    """
    key = f"{cut_of(direction)}.final_length"
    data_end = np.inf if polynomial is None else polynomial.end
    # The final length may lie beyond the last elongation by this share of it, because a strip
    # breaks between two readings.
    followed_beyond = 0.05
    if end - start > data_end * (1 + followed_beyond):
        expected = f"up to {start + data_end:.5g} mm"
        reason = f"(the data end at an elongation of {data_end:.5g} mm)"
        raise place.error(key, f"expected {expected} {reason}, got {end:g} mm")
    if not end > start:
        expected = f"more than the gauge length {start:g} mm"
        raise place.error(key, f"expected {expected}, got {end:g} mm")
    return Strip(direction, start, end, polynomial, **data)
