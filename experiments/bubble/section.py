"""The section [[bubble]] of a project file, and its units turned into mm, N and MPa."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StringConstraints

from ...light_dataclasses import dataclass
from ...meshes.bubble_model import SheetCord
from ...meshes.disk import MAX_ELEMENTS, MIN_ELEMENTS, Outline, check_outline, doubly_symmetric
from ...meshes.sampling import Facet
from ...readers import sections
from ..sections import ChannelSection, FormatSection, MemberSection, Place, Scales
from .readings import XY, ApexSection, HeightsSection, PressureUnit, ProfilesSection
from .registration import PlaneOf, Point, RegistrationOptions

Words = Annotated[
    str,
    StringConstraints(
        strip_whitespace=True,
        min_length=1,
        max_length=300,
        pattern=r"^[^\r\n]*$",
    ),
]


class CorrelationSection(sections.Section):
    """Words with their units, as they are to stand in a report; no result depends on them.

    Those that exports of image correlation do not hold have a title, by which the page calls them.
    """

    software: Words | None = None
    camera: Words | None = Field(default=None, title="camera")
    resolution: Words | None = Field(default=None, title="image resolution")
    lens: Words | None = Field(default=None, title="lens and aperture")
    field_of_view: Words | None = Field(default=None, title="field of view")
    scale: Words | None = Field(default=None, title="image scale")
    stereo: Words | None = Field(default=None, title="stereo angle and stand-off")
    exposure: Words | None = Field(default=None, title="exposure and frame rate")
    pattern: Words | None = Field(default=None, title="patterning technique")
    pattern_size: Words | None = Field(default=None, title="pattern feature size")
    subset: Words | None = Field(default=None, title="subset size")
    step: Words | None = Field(default=None, title="step size")
    strain_window: Words | None = Field(default=None, title="strain window, virtual gauge length")
    matching: Words | None = Field(
        default=None, title="shape function, matching criterion, interpolant"
    )
    prefilter: Words | None = Field(default=None, title="prefilter and data filter")


class FilterSection(sections.Section):
    """The camera's filter: the model is read as the camera reads the fabric."""

    facet: sections.Length
    order: Literal[1, 2] = 1
    smoothing: int = 1
    step: sections.Length | None = None


def facet_of(section: BubbleSection, place: Place) -> Facet | None:
    """Return the filter of the image correlation (its facet) that a section gives, or None.

    Raises
    ------
    InputError
        A facet goes with neither a quarter nor surfaces.
    """
    filter_section = None if section.data.points is None else section.data.points.filter
    if filter_section is None:
        return None
    key = "data.points.filter"
    if section.symmetry == "quarter":
        problem = 'a facet reaches over the edge of a quarter; expected symmetry = "full"'
        raise place.error(key, problem)
    if section.match.by != "points":
        raise place.error(key, "surfaces are matched, not points: leave this out")
    with place.errors_name(key):
        return Facet(
            filter_section.facet,
            filter_section.order,
            filter_section.smoothing,
            filter_section.step,
        )


class EllipseSection(sections.Section):
    """[bubble.ellipse]: the clamped edge is an ellipse, in place of `radius`."""

    major: sections.Size
    minor: sections.Size
    angle: Annotated[float, Field(ge=-90, le=90)] = 0.0


def outline_of(section: BubbleSection, place: Place, clamp: float | None) -> Outline:
    """Return the rim that a section describes.

    Parameters
    ----------
    section : BubbleSection
        In mm.
    place : Place
    clamp : float, mm, or None
        Radius of the clamp, where the section asks for it.

    Raises
    ------
    InputError
        There is no edge or there are two; or the ellipse is a bad one.
    """
    outline = _circle_or_ellipse(section, place, clamp)
    with place.errors_name(keys={"minor": "ellipse.minor"}):
        check_outline(outline, section.symmetry)
    thickness = place.fabric.thickness
    if thickness >= outline.minor:
        key = "radius" if section.ellipse is None else "ellipse.minor"
        expected = f"more than the fabric's thickness {thickness:g} mm"
        raise place.error(key, f"expected {expected}, got {outline.minor:g} mm")
    return outline


def _circle_or_ellipse(section: BubbleSection, place: Place, clamp: float | None) -> Outline:
    """Return the circle or the ellipse of a section."""
    ellipse = section.ellipse
    if section.radius is not None and ellipse is not None:
        raise place.error("radius", "expected a radius or [bubble.ellipse], not both")
    if ellipse is not None:
        return Outline(ellipse.major, ellipse.minor, ellipse.angle)
    if section.radius is None:
        problem = "this key is missing; give the radius of the disk, or [bubble.ellipse]"
        raise place.error("radius", problem)
    radius = clamp if section.radius == "clamp" else section.radius
    assert radius is not None
    return Outline.circle(radius)


Text = Annotated[str, Field(min_length=1)]


class LogSection(FormatSection):
    """[bubble.data.points.pressure.log]: readings by a clock of their own.

    One of `rate`, `times` and `time_in_name` says when the frames were taken; `recorded_frames`
    checks it.

    Attributes
    ----------
    file
        Name of the log.
    pressure, time
        Columns of the log.
    rate
        Frames a second.
    times, times_column
        Table of the frames' times, and its column.
    time_in_name
        Whether the names of the files hold the times, or a pattern whose group is the time.
    offset
        Clock of the log less that of the camera, s.
    """

    file: Text
    pressure: ChannelSection = ChannelSection.model_construct()
    time: ChannelSection = ChannelSection.model_construct()
    rate: sections.Positive | None = None
    times: Text | None = None
    times_column: Text | None = None
    time_in_name: bool | Text | None = None
    offset: sections.Number | None = None


class PressureSection(sections.Section):
    """Say where the pressures of frames stand: `from_name`, `column` or `log`, one of them.

    Attributes
    ----------
    from_name
        Whether the names of the files hold them, or a pattern whose group is the pressure.
    column
        Column, or value, of the files of the frames.
    unit, scale, offset
        Unit of the pressures, or factor and offset of a column.
    log
        Log of a sensor.
    frames
        Number of frames that are taken, evenly spread.
    tolerance
        Largest difference between the pressure of a frame and the one asked for.
    """

    from_name: bool | Text = False
    column: Text | None = None
    unit: PressureUnit | None = None
    scale: sections.Number | None = None
    offset: sections.Number = 0.0
    log: LogSection | None = None
    frames: Annotated[int, Field(ge=1, le=10000)] | None = None
    tolerance: sections.Pressure | None = None


Triple = Annotated[list[sections.Number], Field(min_length=3, max_length=3)]
Degrees = Annotated[float, Field(ge=-180, le=180)]


class RegistrationSection(sections.Section):
    """The given steps of a registration of files in the camera's coordinates."""

    plane: PlaneOf = "found"
    centre: Triple | None = None
    warp: Degrees | None = None
    warp_points: Annotated[list[Triple], Field(min_length=2, max_length=2)] | None = None
    warp_is: Literal["stiff", "soft"] = "stiff"
    remove_clamp_motion: bool = True


def registration_options(
    section: RegistrationSection | None, place: Place, scale: float
) -> RegistrationOptions | None:
    """Return the steps of the registration that a section gives, in mm; None without a section.

    Parameters
    ----------
    scale : float
        mm per unit of length of the files.
    """
    if section is None:
        return None
    marks = None
    if section.warp_points is not None:
        first, second = section.warp_points
        marks = (_scaled_point(first, scale), _scaled_point(second, scale))
    with place.errors_name("data.points.registration"):
        return RegistrationOptions(
            plane=section.plane,
            centre=None if section.centre is None else _scaled_point(section.centre, scale),
            warp=section.warp,
            warp_points=marks,
            warp_is_stiff=section.warp_is == "stiff",
            remove_clamp_motion=section.remove_clamp_motion,
        )


def _scaled_point(point: Sequence[float], scale: float) -> Point:
    """Return a point (x, y, z) times a scale."""
    x, y, z = point
    return scale * x, scale * y, scale * z


def with_units(section: Mapping[str, Any], scales: Scales) -> dict[str, Any]:
    """Return a section that names the units of its files; those that it lacks are of [units].

    A unit of pressure is added only for pressures from file names, which carry none
    (`recorded_frames`); a column or a log names its unit. Needed where a test of a file becomes an
    object, which has no [units].
    """
    data = section.get("data", {})
    if "points" not in data:
        return dict(section)
    points = {"length_unit": scales.length_unit, **data["points"]}
    if points.get("pressure", {}).get("from_name"):
        points["pressure"] = {"unit": scales.pressure_unit, **points["pressure"]}
    return {**section, "data": {**data, "points": points}}


Tensions = Annotated[list[Annotated[float, Field(ge=0)]], Field(min_length=2, max_length=2)]
Direction = Literal["dx", "dy", "dz"]
DIRECTIONS: tuple[Direction, ...] = ("dx", "dy", "dz")
FULL = "a sheet that is not doubly symmetric needs symmetry = 'full'"


class SheetSection(sections.Section):
    """The sheet of the test: flat and taut unless something is said."""

    surface: Literal["flat", "measured"] = "flat"
    degree: Annotated[int, Field(ge=2, le=14)] | None = None
    modes: Annotated[int, Field(ge=0, le=45)] = 0
    prior: sections.Length | None = None
    slack: bool = False
    slack_prior: sections.Positive = 0.3
    tension: Tensions = Field(default=[0.0, 0.0])
    tension_prior: sections.Positive | None = None
    metric: Annotated[int, Field(ge=0, le=15)] = 0
    metric_prior: sections.Positive = 0.3
    misfit: sections.Length | None = None
    rim: Literal["fixed", "measured"] = "fixed"
    constant_field: list[Direction] = Field(default_factory=list)
    from_pressure: sections.Pressure | None = None


@dataclass(frozen=True)
class SheetSettings:
    """Hold what is measured and what is unknown of the sheet before the test: shape and strain.

    Attributes
    ----------
    measured : bool
        Whether the measured heights z are the surface of the sheet before the test.
    degree : int or None
        Degree of the polynomials fitted to measured heights and motions of the rim; None for 8, or
        up to 10 with a measured rim.
    modes : int
        Number of unknown modes of the shape.
    prior : float, mm
        Standard deviation of the prior of each mode.
    slack : bool
        Whether warp and fill have an unknown slack.
    slack_prior : float, %
        Standard deviation of its prior.
    misfit : float, mm
        RMS of model less measured displacements of a good model, against which priors are weighed.
    moving_rim : bool
        Whether the rim of the model moves as measured.
    constant : tuple of int
        Components (0 to 2) of the displacement of which a field that is the same at all pressures
        is taken out.
    reference_frame : int or None
        Index, from 0, in the pressures of the test: the frame from which displacements are
        counted; None for the reference picture.
    metric : int
        Number of monomials of x and y in the unknown strains of warp, fill and shear.
    metric_prior : float, %
        Standard deviation of the prior of each of their coefficients.
    tension : (float, float), N/mm
        Force per width along warp and fill under which the sheet is clamped, or the mean of its
        prior.
    tension_prior : float, N/mm, or None
        Standard deviation of the prior of both tensions; None where they are known.
    """

    measured: bool = False
    degree: int | None = None
    modes: int = 0
    prior: float = 3.0
    slack: bool = False
    slack_prior: float = 0.3
    misfit: float = 0.5
    moving_rim: bool = False
    constant: tuple[int, ...] = ()
    reference_frame: int | None = None
    metric: int = 0
    metric_prior: float = 0.3
    tension: tuple[float, float] = (0.0, 0.0)
    tension_prior: float | None = None

    @property
    def clamped_under_tension(self) -> bool:
        """Return whether the sheet is clamped under a known or an unknown tension."""
        return any(self.tension) or self.tension_prior is not None

    @property
    def has_unknowns(self) -> bool:
        """Return whether the fit has unknowns of the sheet."""
        return bool(self.modes or self.slack or self.metric or self.tension_prior)

    @property
    def allows_for_shape(self) -> bool:
        """Return whether anything makes up for a sheet that is not flat."""
        return bool(
            self.measured or self.modes or self.constant or self.reference_frame is not None
        )


def fitted_registration(section: BubbleSection, place: Place) -> dict[str, float]:
    """Return the standard deviation of the prior of each unknown of the registration.

    Keys are "turn" and "tilt" (degrees) and "shift" (mm), those that are fitted.

    Raises
    ------
    InputError
        A quarter cannot be turned.
    """
    nuisance = section.nuisance
    stated = {"turn": nuisance.turn, "tilt": nuisance.tilt, "shift": nuisance.shift}
    usual = {"turn": 10.0, "tilt": 3.0, "shift": 3.0}  # degrees, degrees, mm
    is_fitted = nuisance.registration == "fitted"
    deviations = {
        name: usual[name] if deviation is None else deviation
        for name, deviation in stated.items()
        if deviation is not None or is_fitted
    }
    if deviations and section.symmetry == "quarter":
        keys = [name for name, deviation in stated.items() if deviation is not None]
        key = keys[0] if keys else "registration"
        raise place.error(f"nuisance.{key}", "a quarter cannot be turned: needs symmetry = 'full'")
    return deviations


#: Whether a key is wrong, the key, and what is wrong with it.
Rule = tuple[Any, str, str]


def sheet_of(bubble: BubbleSection, place: Place, pressures: Sequence[float]) -> SheetSettings:
    """Return the settings of the sheet that a section describes.

    Parameters
    ----------
    bubble : BubbleSection
    place : Place
    pressures : sequence of float, MPa

    Raises
    ------
    InputError
        Keys are at odds with each other.
    """
    section = bubble.sheet
    if bubble.data.points is None:
        for key, value in (("surface", section.surface), ("rim", section.rim)):
            if value == "measured":
                raise place.error(f"sheet.{key}", "nothing is measured here: no files are read")
    reference_frame = _reference_frame(section, place, pressures)
    for is_wrong, key, problem in (
        *_shape_rules(section, bubble.symmetry == "quarter"),
        *_counting_rules(bubble, reference_frame, len(pressures)),
    ):
        if is_wrong:
            raise place.error(key, problem)
    return SheetSettings(
        measured=section.surface == "measured",
        degree=section.degree,
        modes=section.modes,
        prior=section.prior or 3.0,
        slack=section.slack,
        slack_prior=section.slack_prior,
        tension=(section.tension[0], section.tension[1]),
        tension_prior=section.tension_prior,
        misfit=section.misfit or 0.5,
        moving_rim=section.rim == "measured",
        constant=tuple(sorted({DIRECTIONS.index(d) for d in section.constant_field})),
        reference_frame=reference_frame,
        metric=section.metric,
        metric_prior=section.metric_prior,
    )


def _reference_frame(section: SheetSection, place: Place, pressures: Sequence[float]) -> int | None:
    """Return the index in pressures (from 0) of the frame from which displacements are counted.

    None for the reference picture, where no frame is named.
    """
    if section.from_pressure is None:
        return None
    is_close = np.isclose(pressures, section.from_pressure, rtol=1e-6)
    if not is_close.any() or len(pressures) < 2:
        pressure = section.from_pressure / place.scales.pressure
        problem = f"expected one of several 'pressures', got {pressure:g}"
        raise place.error("sheet.from_pressure", problem)
    return int(np.argmax(is_close))


def _shape_rules(section: SheetSection, is_quarter: bool) -> Iterator[Rule]:
    """Yield what the unknown or measured shape of a sheet must not be."""
    keys_set = section.model_fields_set
    yield (
        is_quarter and section.surface == "measured",
        "sheet.surface",
        f"a measured surface: {FULL}",
    )
    has_asymmetric_modes = is_quarter and not doubly_symmetric(section.modes)
    yield has_asymmetric_modes, "sheet.modes", f"{section.modes} modes: {FULL}"
    no = "not asked for"
    yield "prior" in keys_set and not section.modes, "sheet.prior", f"belongs to modes, {no}"
    has_slack_prior = "slack_prior" in keys_set and not section.slack
    yield has_slack_prior, "sheet.slack_prior", f"belongs to slack, {no}"
    yield is_quarter and section.metric, "sheet.metric", f"a metric: {FULL}"
    problem = "holds slack as its mean: leave slack out"
    yield section.slack and section.metric, "sheet.metric", problem
    has_metric_prior = "metric_prior" in keys_set and not section.metric
    yield has_metric_prior, "sheet.metric_prior", f"belongs to metric, {no}"
    problem = "is the opposite of slack and metric, which hold it: leave one of them out"
    has_slack = section.slack or section.metric
    yield section.tension_prior and has_slack, "sheet.tension_prior", problem
    has_unknowns = section.modes or section.slack or section.metric or section.tension_prior
    problem = f"belongs to modes, slack or tension_prior, {no}"
    yield "misfit" in keys_set and not has_unknowns, "sheet.misfit", problem


def _counting_rules(
    bubble: BubbleSection, reference_frame: int | None, frames: int
) -> Iterator[Rule]:
    """Yield what must not be beside a field that is taken out, or beside a loaded reference."""
    section = bubble.sheet
    has_loaded_reference = reference_frame is not None
    problem = "a surface measured under pressure is not without stress: use modes instead"
    is_stressed = has_loaded_reference and section.surface == "measured"
    yield is_stressed, "sheet.from_pressure", problem
    problem = "takes up what from_pressure and constant_field take out; use one of them"
    has_offset_twice = has_loaded_reference or section.constant_field
    yield (
        bubble.nuisance.displacement_offset and has_offset_twice,
        "nuisance.displacement_offset",
        problem,
    )
    problem = "takes out what from_pressure takes out already; use one of them"
    yield has_loaded_reference and section.constant_field, "sheet.constant_field", problem
    problem = "nothing is left of the data of one pressure"
    yield section.constant_field and frames < 2, "sheet.constant_field", problem


class SheetCordSection(MemberSection):
    """A cord bonded to the sheet: force by strain, or stiffness EA (N); N and plain strains."""

    ends: Annotated[list[XY], Field(min_length=2, max_length=2)]


def cords_of(section: BubbleSection, place: Place, outline: Outline) -> tuple[SheetCord, ...]:
    """Return the cords of a section in mm; InputError names their keys."""
    cords = []
    for i, member in enumerate(section.cord):
        key = f"cord[{i}]"
        table = member.table(place, key)
        with place.errors_name(key):
            cord = SheetCord(np.array(member.ends), table, member.prestrain, member.tension_only)
        for end in cord.ends[outline.share(cord.ends) > 1 + 1e-6]:
            problem = f"expected places on the disk, got {end.tolist()} mm beyond its edge"
            raise place.error(f"{key}.ends", problem)
        cords.append(cord)
    return tuple(cords)


Elements = Annotated[int, Field(ge=MIN_ELEMENTS, le=MAX_ELEMENTS)]
Symmetry = Literal["full", "quarter"]


class KnownSolutionSection(sections.Section):
    """[bubble.data.known_solution]: data are computed from these coefficients."""

    beta: list[sections.Modulus]
    form: str = "cubic"
    elements: Elements | None = None
    increments: list[sections.Pressure] | None = None
    symmetry: Symmetry | None = None
    solver: sections.Name | None = None


class PointColumnsSection(sections.Section):
    """Names of columns in the files, where they are not found."""

    x: str | None = None
    y: str | None = None
    z: str | None = None
    dx: str | None = None
    dy: str | None = None
    dz: str | None = None


class PointsSection(FormatSection):
    """[bubble.data.points]: files of measured points, one a pressure or all in one."""

    files: list[str] | None = None
    pattern: str | None = None
    indices: list[int] | None = None
    folder: str = ""
    reference: Text | None = None
    columns: PointColumnsSection = PointColumnsSection.model_construct()
    flag_column: str | None = None
    valid_column: str | None = None
    coordinates: Literal["reference", "deformed"] | None = None
    camera_axes: bool | None = None
    length_unit: sections.LengthUnit | None = None
    pressure: PressureSection | None = None
    registration: RegistrationSection | None = None
    filter: FilterSection | None = None
    correlation: CorrelationSection = CorrelationSection.model_construct()


class DataSection(sections.Section):
    """[bubble.data]: a known solution, points of a camera, or tables of readings."""

    known_solution: KnownSolutionSection | None = None
    points: PointsSection | None = None
    heights: HeightsSection | None = None
    profiles: ProfilesSection | None = None
    apex: ApexSection | None = None

    @property
    def has_readings(self) -> bool:
        """Return whether there is a table of readings."""
        return not (self.heights is None and self.profiles is None and self.apex is None)


class MatchSection(sections.Section):
    """Points or polynomial surfaces through them, to be matched."""

    by: Literal["surfaces", "points"] = "points"
    degree: Annotated[int, Field(ge=1, le=12)] = 4


class NuisanceSection(sections.Section):
    """Offsets of a measurement, and its registration, fitted beside the moduli.

    Attributes
    ----------
    displacement_offset, pressure_offset
        Whether displacements, or pressures, have an unknown offset.
    height_offset
        Standard deviation of the zero of each gauge.
    height_scale
        Standard deviation of the scale of all heights, as a share of them.
    registration
        Whether the registration is fitted, too.
    turn, tilt, shift
        Standard deviations (degrees, degrees, a length) around what was registered.
    """

    displacement_offset: bool = False
    pressure_offset: bool = False
    height_offset: sections.Length | None = None
    height_scale: Annotated[float, Field(gt=0.0, le=0.1)] | None = None
    registration: Literal["given", "fitted"] = "given"
    turn: sections.Positive | None = None
    tilt: sections.Positive | None = None
    shift: sections.Length | None = None


class BubbleSection(sections.Section):
    """[[bubble]]: a clamped disk, inflated."""

    name: sections.Name | None = None
    weight: sections.Weight = 1.0
    radius: sections.Size | Literal["clamp"] | None = None
    nominal_radius: sections.Size | None = None
    ellipse: EllipseSection | None = None
    pressures: Annotated[list[sections.Pressure], Field(min_length=1)] | None = None
    inflation: Literal["all"] | Annotated[int, Field(ge=1)] = 1
    increments: list[sections.Pressure] | None = None
    elements: Elements = 800
    symmetry: Symmetry = "full"
    generator: Literal["blocks", "gmsh"] = "blocks"
    objective: Literal["e", "mm"] = "e"
    noise: sections.Length | None = None
    match: MatchSection = MatchSection.model_construct()
    nuisance: NuisanceSection = NuisanceSection.model_construct()
    sheet: SheetSection = SheetSection.model_construct()
    cord: list[SheetCordSection] = Field(default_factory=list)
    data: DataSection
