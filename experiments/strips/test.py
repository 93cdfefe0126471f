"""A test of strips: its section, the reading of its load curves, and its models."""

import glob
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, TypeAdapter

from ...errors import InputError
from ...materials.card import State
from ...meshes.strip_models import (
    GRIP_DISTANCE,
    WIDTH,
    UniaxialModel,
    bias_strip,
    refined_quads,
    straight_strip,
)
from ...readers.curves import (
    DIRECTIONS,
    LengthUnit,
    LoadCurve,
    LoadPolynomial,
    LoadUnit,
    fit_load_polynomial,
    read_load_curves,
    read_published_polynomials,
    specimen_deviation,
    split_at_restarts,
)
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.sections import Length, Name, Positive, Section, Size, Weight, whole_in_base_units
from ...storage.reading import is_file, missing_file_reason
from ..base import Reach, Refined, SectionTest
from ..sections import Place, listed_files, named_format
from ..states import state_from_conditioning
from .data import Strip

Mask = NDArray[np.bool_]
FileNames = Annotated[list[str], Field(min_length=1)]
Match = Literal["polynomial", "points"]
Unit = Literal["N", "relative"]


class GaugeSection(Section):
    """Section [strips.warp], fill or bias: the virtual strain gauge at rest and at the end."""

    gauge_length: Size | None = None
    final_length: Size | None = None


class StripColumnsSection(Section):
    """Section [strips.data.columns]: the files' own column names."""

    elongation: str | None = None
    load: str | None = None
    specimen: str | None = None
    direction: str | None = None


class FilesSection(Section):
    """Files by direction, which they need not name."""

    warp: FileNames | None = None
    fill: FileNames | None = None
    bias: FileNames | None = None


def _files(value: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    if isinstance(value, dict):
        return FilesSection.model_validate(value)
    return value if value is None else TypeAdapter(FileNames).validate_python(value, strict=True)


class CurvesSection(Section):
    """Section [strips.data]: load curves, as polynomials or as measured."""

    polynomials: str | None = None
    files: Annotated[list[str] | FilesSection | None, BeforeValidator(_files)] = None
    folder: str = ""
    format: str | None = None
    columns: StripColumnsSection = StripColumnsSection.model_construct()
    load_unit: LoadUnit | None = None
    length_unit: LengthUnit | None = None
    decimal: Literal[".", ","] | None = None
    comment: str = "#"
    sheet: str | None = None
    until_largest_load: bool = False
    order: Annotated[int, Field(ge=1, le=10)] = 4
    through_origin: bool = True
    specimens: Annotated[int, Field(ge=1, le=10000)] | None = None


class WeightsSection(Section):
    """Section [strips.weights]: of each direction's error in the objective."""

    warp: Weight = 1.0
    fill: Weight = 1.0
    bias: Weight = 1.0


class StripsSection(Section):
    """Section [[strips]]: cut strips pulled along warp, fill and across the yarns."""

    name: Name | None = None
    width: Size | None = None
    grip_distance: Size | None = None
    bias_angle: Annotated[float, Field(gt=0, lt=90)] = 45.0
    increments: Annotated[int, Field(ge=1, le=10000)] = 100
    warp: GaugeSection | None = None
    fill: GaugeSection | None = None
    bias: GaugeSection | None = None
    data: CurvesSection
    noise: Positive | None = None
    rate: Length | None = None
    conditioning: Name | None = None
    match: Match = "polynomial"
    objective: Unit = "N"
    weight: Weight = 1.0
    weights: WeightsSection = WeightsSection.model_construct()


@dataclass(frozen=True, eq=False, kw_only=True)
class StripsTest(SectionTest):
    """Cut strips pulled along warp, fill and across the yarns.

    Attributes
    ----------
    width, grip_distance : float, mm
    bias_angle : float, degrees
        From the pull to the warp of strips across the yarns.
    increments : int
    strips : mapping
        By direction.
    match_by : {"polynomial", "points"}
    weights : mapping
        By direction.
    objective : {"N", "relative"}
    specimens : int or None
        Of each direction; None where unknown.
    rate : float, mm a minute, or None
        Between the grips.
    conditioning : str or None
        In words.
    noise : float, N, or None
        Of one load.
    """

    width: float
    grip_distance: float
    bias_angle: float
    increments: int
    strips: Mapping[str, Strip]
    match_by: Match
    weights: Mapping[str, float]
    objective: Unit
    specimens: int | None = None
    rate: float | None = None
    conditioning: str | None = None
    kind: str = "strips"
    reads_files = True

    @property
    def state(self) -> State:
        """Return "first loading" or "conditioned", as the key `conditioning` says; else ""."""
        return state_from_conditioning(self.conditioning)

    @property
    def pace(self) -> Pace:
        """Return rate of strain and hold by the files' times, else the rate by its key."""
        measured = pace_of(
            LoadHistory(Path(), curve.load, curve.elongation / strip.gauge_length, curve.time)
            for strip in self.strips.values()
            for curve in strip.curves
        )
        if math.isfinite(measured.rate):
            return measured
        return Pace() if self.rate is None else Pace(self.rate / 60.0 / self.grip_distance)

    @cached_property
    def reach(self) -> Reach:
        """Return the reach of the gauges, see `reach_of`."""
        return reach_of(self)

    @property
    def matched(self) -> dict[str, Strip]:
        """Return the strips of a weight above 0, by direction."""
        return {d: strip for d, strip in self.strips.items() if self.weights[d] > 0}

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """Return the models by direction; edges of quads, or increments, divided by a factor."""
        quads, steps = (factor, 1.0) if refined == "elements" else (1.0, factor)
        increments = max(1, round(self.increments * steps))
        models = {}
        for d, s in self.strips.items():
            lengths = s.gauge_length, s.final_length, self.thick(thickness), self.width
            if d == "bias":
                across = refined_quads("bias", quads)
                grips = self.grip_distance, self.bias_angle
                models[d] = bias_strip(*lengths, *grips, increments, **across)
            else:
                along = refined_quads("straight", quads)
                yarn: Literal["warp", "fill"] = "warp" if d == "warp" else "fill"
                models[d] = straight_strip(yarn, *lengths, increments, **along)
        return models

    def settings(self) -> Mapping[str, object]:
        return {
            "width": self.width,
            "grip_distance": self.grip_distance,
            "bias_angle": self.bias_angle,
            "increments": self.increments,
            "match_by": self.match_by,
            "objective": self.objective,
            "weight": self.weight,
            "weights": dict(self.weights),
            "lengths": {d: (s.gauge_length, s.final_length) for d, s in self.strips.items()},
        }


def read(section: StripsSection, place: Place, name: str) -> StripsTest:
    """Read the section of a test, and its load curves.

    Raises
    ------
    InputError
        Names the file and the dotted key.
    """
    section = whole_in_base_units(section, place.scales)
    grip_distance = section.grip_distance or GRIP_DISTANCE
    width = section.width or WIDTH
    strips = read_strips(place, section, width)
    weights = section.weights.model_dump()
    if not sum(weights[direction] for direction in strips) > 0:
        raise place.error("weights", "expected one above 0: nothing would be matched")
    if "bias" in strips and strips["bias"].gauge_length > grip_distance:
        problem = f"expected at most the distance of the grips, {grip_distance:g} mm"
        raise place.error("bias.gauge_length", problem)
    if section.match == "points":
        _check_points(strips, place)
    return StripsTest(
        name=name,
        place=place,
        weight=section.weight,
        noise=section.noise,
        width=width,
        grip_distance=grip_distance,
        bias_angle=section.bias_angle,
        increments=section.increments,
        strips=strips,
        match_by=section.match,
        weights=weights,
        objective=section.objective,
        specimens=section.data.specimens,
        rate=section.rate,
        conditioning=section.conditioning,
    )


def _check_points(strips: Mapping[str, Strip], place: Place) -> None:
    """Refuse strips without measured points where these are to be matched."""
    if place.need_data and not all(strip.curves for strip in strips.values()):
        problem = "'points' needs measured points (data.files), not polynomials"
        raise place.error("match", problem)
    for direction, strip in strips.items():
        if strip.curves and not len(strip.points[0]):
            problem = "no measured point lies between the gauge length and this one"
            raise place.error(f"{direction}.final_length", problem)


def reach_of(test: StripsTest, masks: Mapping[str, Mask | None] | None = None) -> Reach:
    """Return the final strains of the strips, and the breaks of their load curves.

    Shear of a strip that keeps its area is 2 sin(2 angle) ln(l_f/l_i). Breaks are shares of the
    strain of the gauge.

    Parameters
    ----------
    test : StripsTest
    masks : mapping or None
        Which points a curve follows, by direction; all unless given.
    """
    ends: dict[str, float] = {}
    breaks: dict[str, tuple[float, float] | None] = {}
    shear_per_strain = 2 * math.sin(math.radians(2 * test.bias_angle))
    for direction, strip in test.strips.items():
        mask = None if masks is None else masks.get(direction)
        if mask is not None and not mask.any():
            continue
        factor = shear_per_strain if direction == "bias" else 1.0
        ends[direction] = factor * strip.strain_by(mask)
        breaks[direction] = strip.break_shares(mask)
    return Reach(
        (ends.get("warp"), ends.get("fill"), ends.get("bias")),
        (breaks.get("warp"), breaks.get("fill"), breaks.get("bias")),
    )


#: A file of a section, its key below the section, and its direction if it is listed for one.
ListedFile = tuple[Path, str, str | None]


def files_of(place: Place, data: CurvesSection, folder: Path) -> list[ListedFile]:
    """Return the files of [strips.data], there or not, in the order of the section."""
    if data.polynomials is not None:
        return [(folder / data.polynomials, "data.polynomials", None)]
    patterns: Any = {None: data.files}
    if isinstance(data.files, FilesSection):
        patterns = data.files.model_dump(exclude_none=True)
    if not patterns:
        problem = "expected files of one direction at least: { warp = [...], fill = [...] }"
        raise place.error("data.files", problem)
    names = {
        direction: [match for pattern in of_direction for match in _matches(folder, pattern)]
        for direction, of_direction in patterns.items()
    }
    return listed_files(place, folder, names, "data.files")


def _matches(folder: Path, name: str) -> list[str]:
    """Return the files that a pattern such as "warp*.csv" matches; else the name itself."""
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
    """Return the specimens' curves by direction, in the order of `DIRECTIONS`.
    A file with one curve in a direction perhaps lists several specimens, one after the other and
    not named: it is split where the elongation starts again. width : of the strips, gauges : by
    direction, mm."""
    format = named_format(place, "data.format", "machine table", data.format)
    columns = data.columns.model_dump(exclude_none=True)
    keys = ("load_unit", "length_unit", "comment", "decimal", "sheet")
    said = {name: getattr(data, name) for name in keys}
    exports: list[Sequence[LoadCurve]] = []
    if place.measured is not None:
        exports.append(place.measured)
    first: dict[Path, LoadCurve] = {}
    for path, field, of in listed:
        curves = read_load_curves(
            path,
            columns=columns or None,
            width=width,
            direction=of,
            gauge_length=gauges,
            format=format,
            **said,
        )
        before = first.setdefault(path, curves[0])
        if before.direction != curves[0].direction and all(
            np.array_equal(getattr(before, name), getattr(curves[0], name))
            for name in ("elongation", "load")
        ):
            problem = f"is listed for {before.direction} too, and does not tell the two apart"
            raise place.error(field, problem)
        exports.append(curves)
    by_direction = {
        direction: tuple(
            curve
            for curves in exports
            for curve in _specimens(curves, direction, data.until_largest_load)
        )
        for direction in DIRECTIONS
    }
    return {direction: curves for direction, curves in by_direction.items() if curves}


def _specimens(
    curves: Sequence[LoadCurve], direction: str, until_largest_load: bool
) -> Sequence[LoadCurve]:
    """Return the curves of a direction in one export, those that are not named told apart."""
    specimens = [curve for curve in curves if curve.direction == direction]
    if len(specimens) == 1:
        parts = split_at_restarts(specimens[0])
        specimens = list(parts) if len(parts) > 1 else specimens
    if until_largest_load:
        return [curve.until_largest_load() for curve in specimens]
    return specimens


def read_strips(place: Place, section: StripsSection, width: float) -> dict[str, Strip]:
    """Return the strips of a section, by direction: those with a table or data.

    Missing data are no error where the place needs none and all lengths are given.

    Parameters
    ----------
    place : Place
    section : StripsSection
        In mm.
    width : float, mm

    Raises
    ------
    InputError
        Data or lengths are missing.
    """
    data = section.data
    tables = {d: getattr(section, d) for d in DIRECTIONS if getattr(section, d) is not None}
    listed: list[ListedFile] = []
    if place.measured is None:
        if _is_without_data(place, data, tables):
            return _without_data(place, tables)
        listed = files_of(place, data, place.folder(data.folder))
    for path, field, _ in listed:
        if is_file(path):
            continue
        if place.need_data or not _has_all_lengths(tables):
            problem = f"{missing_file_reason(path)}; --data DIR names another folder"
            raise place.error(field, problem)
        return _without_data(place, tables)
    if data.polynomials is not None:
        strips = _published(place, data, tables, listed[0][0])
    else:
        strips = _measured(place, data, tables, listed, width)
    if not strips:
        problem = f"these data hold none of the directions {', '.join(tables or DIRECTIONS)}"
        raise place.error("data", problem)
    for direction in tables:
        if direction not in strips:
            problem = f"the data hold no {direction} test; leave this section out or add its data"
            raise place.error(direction, problem)
    return strips


def _is_without_data(place: Place, data: CurvesSection, tables: Mapping[str, GaugeSection]) -> bool:
    """Return whether strips are pulled without data; refuse a section without where it needs any.

    Also refuses two sources of data.
    """
    has_source = data.polynomials is not None or data.files is not None
    if not has_source and not place.need_data and _has_all_lengths(tables):
        return True
    if (data.polynomials is None) == (data.files is None):
        raise place.error("data", "expected exactly one of 'polynomials' and 'files'")
    return False


def _has_all_lengths(tables: Mapping[str, GaugeSection]) -> bool:
    """Return whether the lengths of the gauge are given, at rest and at the end."""
    lengths = [length for t in tables.values() for length in (t.gauge_length, t.final_length)]
    return bool(lengths) and None not in lengths


def _without_data(place: Place, tables: Mapping[str, GaugeSection]) -> dict[str, Strip]:
    """Return strips of given lengths, by direction."""
    return {
        direction: _strip(place, direction, table.gauge_length or 0.0, table.final_length or 0.0)
        for direction, table in tables.items()
    }


def _published(
    place: Place, data: CurvesSection, tables: Mapping[str, GaugeSection], path: Path
) -> dict[str, Strip]:
    """Return the strips of a file of load polynomials, by direction."""
    format = named_format(place, "data.format", "load polynomials", data.format)
    curves = read_published_polynomials(path, format)
    strips = {}
    for direction in DIRECTIONS:
        if direction not in curves or (tables and direction not in tables):
            continue
        curve = curves[direction]
        gauge = tables.get(direction) or GaugeSection()
        strips[direction] = _strip(
            place,
            direction,
            gauge.gauge_length or curve.gauge_length,
            gauge.final_length or curve.final_length,
            curve.polynomial,
            scatter=None if np.isnan(curve.scatter) else curve.scatter,
            published=path,
        )
    return strips


def _measured(
    place: Place,
    data: CurvesSection,
    tables: Mapping[str, GaugeSection],
    listed: Sequence[ListedFile],
    width: float,
) -> dict[str, Strip]:
    """Return the strips of measured curves, by direction."""
    listed_directions = {direction for _, _, direction in listed}
    gauges = {d: t.gauge_length for d, t in tables.items() if t.gauge_length is not None}
    strips = {}
    for direction, curves in measured_curves(place, data, listed, width, gauges).items():
        # A table picks among what a file holds; a file listed for a direction is meant.
        if tables and direction not in tables and direction not in listed_directions:
            continue
        gauge = tables.get(direction) or GaugeSection()
        if gauge.gauge_length is None:
            problem = "this key is missing; the strain follows from it"
            raise place.error(f"{direction}.gauge_length", problem)
        polynomial, scatter = _fitted_polynomial(place, data, direction, curves)
        strips[direction] = _strip(
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
    return strips


def _fitted_polynomial(
    place: Place, data: CurvesSection, direction: str, curves: Sequence[LoadCurve]
) -> tuple[LoadPolynomial, float | None]:
    """Return the polynomial through the curves of a direction, and their scatter (N) about it."""
    elongation = np.concatenate([curve.elongation for curve in curves])
    load = np.concatenate([curve.load for curve in curves])
    try:
        polynomial = fit_load_polynomial(elongation, load, data.order, data.through_origin)
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
    """Return a strip; InputError for a final length (mm) that is too short or beyond the data."""
    key = f"{direction}.final_length"
    data_end = np.inf if polynomial is None else polynomial.end
    # Of the last elongation: a strip breaks between two readings.
    followed_beyond = 0.05
    if end - start > data_end * (1 + followed_beyond):
        expected = f"up to {start + data_end:.5g} mm"
        reason = f"(the data end at an elongation of {data_end:.5g} mm)"
        raise place.error(key, f"expected {expected} {reason}, got {end:g} mm")
    if not end > start:
        expected = f"more than the gauge length {start:g} mm"
        raise place.error(key, f"expected {expected}, got {end:g} mm")
    return Strip(direction, start, end, polynomial, **data)
