"""The section [[bubble]] of a project file, and its units turned into mm, N and MPa."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StringConstraints

from ...meshes.bubble_model import SheetCord
from ...meshes.disk import MAX_ELEMENTS, MIN_ELEMENTS, MOST_SLENDER, Outline, doubly_symmetric
from ...meshes.mesh import Facet
from ...readers import sections
from ...readers.sections import Name as Name_of_sections
from ..sections import ChannelSection, MemberSection, Place, Scales
from .registration import PlaneOf, RegistrationOptions

Words = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=300, pattern=r"^[^\r\n]*$"),
]


class CorrelationSection(sections.Section):
    """Words with their units, as they are to stand in a report; no result depends on them.
    Titles are of those that exports of image correlation do not hold, as the page calls them."""

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
    """Return the facet, None without one; raises InputError."""
    given = None if section.data.points is None else section.data.points.filter
    if given is None:
        return None
    at = "data.points.filter"
    if section.symmetry == "quarter":
        problem = 'a facet reaches over the edge of a quarter; expected symmetry = "full"'
        raise place.error(at, problem)
    if section.match.by != "points":
        raise place.error(at, "surfaces are matched, not points: leave this out")
    with place.naming(at):
        return Facet(given.facet, given.order, given.smoothing, given.step)


class EllipseSection(sections.Section):
    """[bubble.ellipse]: the clamped edge is an ellipse, in place of `radius`."""

    major: sections.Size
    minor: sections.Size
    angle: Annotated[float, Field(ge=-90, le=90)] = 0.0


def outline_of(section: BubbleSection, place: Place, clamp: float | None) -> Outline:
    """Return the edge in mm; raises InputError for a bad ellipse, or one beside a radius.
    clamp : mm, its radius where the section asks for it."""
    ellipse = section.ellipse
    if section.radius is not None and ellipse is not None:
        raise place.error("radius", "expected a radius or [bubble.ellipse], not both")
    if section.radius is not None:
        known = clamp if section.radius == "clamp" else section.radius
        assert known is not None
        outline = Outline.circle(known)
    elif ellipse is not None:
        outline = Outline(ellipse.major, ellipse.minor, ellipse.angle)
    else:
        problem = "this key is missing; give the radius of the disk, or [bubble.ellipse]"
        raise place.error("radius", problem)
    major = outline.major
    minor = outline.minor
    thickness = place.fabric.thickness
    least = f"at least the {MOST_SLENDER:g}th part of the major {major:g} mm"
    of_major = "; 'angle' is that of the major semi-axis"
    for wrong, expected, more in (
        (minor > major, f"at most the major {major:g} mm", of_major),
        (major > MOST_SLENDER * minor, least, ""),
        (thickness >= minor, f"more than the fabric's thickness {thickness:g} mm", ""),
    ):
        if wrong:
            key = "radius" if ellipse is None else "ellipse.minor"
            raise place.error(key, f"expected {expected}, got {minor:g} mm{more}")
    if section.symmetry == "quarter" and not outline.doubly_symmetric:
        axes = f"the axes of the ellipse lie at {outline.angle:g} degrees from the yarns"
        raise place.error("symmetry", f"{axes}: needs 'full'")
    return outline


Unit = Literal["Pa", "hPa", "mbar", "kPa", "psi", "bar", "MPa"]
Name = Annotated[str, Field(min_length=1)]


class LogSection(sections.Section):
    """[bubble.data.points.pressure.log]: readings by a clock of their own."""

    file: Name
    format: str | None = None
    comment: str = "#"
    decimal: Literal[".", ","] | None = None
    pressure: ChannelSection = ChannelSection.model_construct()
    time: ChannelSection = ChannelSection.model_construct()
    rate: sections.Positive | None = None
    times: Name | None = None
    times_column: Name | None = None
    time_in_name: bool | Name | None = None
    offset: sections.Number | None = None


class PressureSection(sections.Section):
    """One of `from_name`, `column` and `log` says the pressures; `frames` are evenly spread."""

    from_name: bool | Name = False
    column: Name | None = None
    unit: Unit | None = None
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
    """Return the given steps in mm, None without a section; scale: mm per unit of the files."""
    if section is None:
        return None
    said = section.model_dump(exclude={"warp_is", "centre", "warp_points"})
    centre, *marks = (
        None if one is None else tuple(scale * value for value in one)
        for one in (section.centre, *(section.warp_points or ()))
    )
    said |= {"centre": centre, "warp_points": tuple(marks) or None}
    with place.naming("data.points.registration"):
        return RegistrationOptions(**said, warp_is_stiff=section.warp_is == "stiff")


def with_units(said: Mapping[str, Any], scales: Scales) -> dict[str, Any]:
    """Return a section that says the units which its files have by [units] where it does not."""
    data = said.get("data", {})
    if "points" not in data:
        return dict(said)
    points = {"length_unit": scales.length_unit, **data["points"]}
    if points.get("pressure", {}).get("from_name"):
        points["pressure"] = {"unit": scales.pressure_unit, **points["pressure"]}
    return {**said, "data": {**data, "points": points}}


Direction = Literal["dx", "dy", "dz"]
DIRECTIONS: tuple[Direction, ...] = ("dx", "dy", "dz")
FULL = "a sheet that is not doubly symmetric needs symmetry = 'full'"


class SheetSection(sections.Section):
    """The sheet of the test: flat and taut unless something is said."""

    surface: Literal["flat", "measured"] = "flat"
    degree: Annotated[int, Field(ge=2, le=14)] = 8
    modes: Annotated[int, Field(ge=0, le=45)] = 0
    prior: sections.Length | None = None
    slack: bool = False
    slack_prior: sections.Positive = 0.3
    metric: Annotated[int, Field(ge=0, le=15)] = 0
    metric_prior: sections.Positive = 0.3
    misfit: sections.Length | None = None
    rim: Literal["fixed", "measured"] = "fixed"
    constant_field: list[Direction] = Field(default_factory=list)
    from_pressure: sections.Pressure | None = None


@dataclass(frozen=True)
class SheetSettings:
    """The first shape of the sheet, and its unknowns.
    measured : the measured z is the reference surface. degree : of the polynomials through measured
    heights and rims. modes : number of unknown shapes; prior : mm, one standard deviation of each.
    slack_prior : %, one standard deviation. misfit : mm RMS of a good model, against which priors
    are weighed. moving_rim : the rim follows the measurement. constant : directions (0 to 2) in
    which a field that is the same at all pressures is projected out. since : number of the frame
    from which displacements are counted, None for the reference picture. metric : monomials of x
    and y in the unknown strain of warp, fill and shear; metric_prior : %, as slack_prior."""

    measured: bool = False
    degree: int = 8
    modes: int = 0
    prior: float = 3.0
    slack: bool = False
    slack_prior: float = 0.3
    misfit: float = 0.5
    moving_rim: bool = False
    constant: tuple[int, ...] = ()
    since: int | None = None
    metric: int = 0
    metric_prior: float = 0.3

    @property
    def unknown(self) -> bool:
        """Return whether the fit has unknowns of the sheet."""
        return bool(self.modes or self.slack or self.metric)

    @property
    def known(self) -> bool:
        """Return whether anything makes up for a sheet that is not flat."""
        return bool(self.measured or self.modes or self.constant or self.since is not None)


#: One standard deviation of what a registration leaves open: degrees, degrees, mm.
LEFT_OPEN = {"turn": 10.0, "tilt": 3.0, "shift": 3.0}


def fitted_registration(section: BubbleSection, place: Place) -> dict[str, float]:
    """Return one standard deviation of each unknown of the registration (degrees, mm).
    Raises InputError where such an unknown needs more of the test than there is."""
    usual = LEFT_OPEN if section.nuisance.registration == "fitted" else {}
    given = {name: getattr(section.nuisance, name) for name in LEFT_OPEN}
    said = {name: own for name, own in given.items() if own is not None}
    found = {**usual, **said}
    if found and section.symmetry == "quarter":
        key = next(iter(said), "registration")
        raise place.error(f"nuisance.{key}", "a quarter cannot be turned: needs symmetry = 'full'")
    return {name: found[name] for name in LEFT_OPEN if name in found}


def sheet_of(of: BubbleSection, place: Place, pressures: Sequence[float]) -> SheetSettings:
    """Return the sheet; pressures in MPa; raises InputError for keys at odds."""
    section = of.sheet
    offset = of.nuisance.displacement_offset
    for key in ("surface", "rim"):
        if of.data.points is None and getattr(section, key) == "measured":
            raise place.error(f"sheet.{key}", "nothing is measured here: no files are read")
    given = section.model_fields_set
    since = None
    if section.from_pressure is not None:
        near = np.isclose(pressures, section.from_pressure, rtol=1e-6)
        if not near.any() or len(pressures) < 2:
            asked = section.from_pressure / place.scales.pressure
            problem = f"expected one of several 'pressures', got {asked:g}"
            raise place.error("sheet.from_pressure", problem)
        since = int(np.argmax(near))
    quarter = of.symmetry == "quarter"
    measured = section.surface == "measured"
    unknown = section.modes or section.slack or section.metric
    taken = since is not None or section.constant_field
    stressed = "a surface measured under pressure is not without stress: use modes instead"
    out = "takes up what from_pressure and constant_field take out; use one of them"
    twice = "takes out what from_pressure takes out already; use one of them"
    no = "not asked for"
    few = "nothing is left of the data of one pressure"
    modes = quarter and not doubly_symmetric(section.modes)
    slack = "slack_prior" in given and not section.slack
    metric = "metric_prior" in given and not section.metric
    holds = "holds slack as its mean: leave slack out"
    for wrong, key, problem in (
        (quarter and measured, "sheet.surface", f"a measured surface: {FULL}"),
        (modes, "sheet.modes", f"{section.modes} modes: {FULL}"),
        ("prior" in given and not section.modes, "sheet.prior", f"belongs to modes, {no}"),
        (slack, "sheet.slack_prior", f"belongs to slack, {no}"),
        (quarter and section.metric, "sheet.metric", f"a metric: {FULL}"),
        (section.slack and section.metric, "sheet.metric", holds),
        (metric, "sheet.metric_prior", f"belongs to metric, {no}"),
        ("misfit" in given and not unknown, "sheet.misfit", f"belongs to modes or slack, {no}"),
        (since is not None and measured, "sheet.from_pressure", stressed),
        (offset and taken, "nuisance.displacement_offset", out),
        (since is not None and section.constant_field, "sheet.constant_field", twice),
        (section.constant_field and len(pressures) < 2, "sheet.constant_field", few),
    ):
        if wrong:
            raise place.error(key, problem)
    return SheetSettings(
        measured=measured,
        degree=section.degree,
        modes=section.modes,
        prior=section.prior or 3.0,
        slack=section.slack,
        slack_prior=section.slack_prior,
        misfit=section.misfit or 0.5,
        moving_rim=section.rim == "measured",
        constant=tuple(sorted({DIRECTIONS.index(d) for d in section.constant_field})),
        since=since,
        metric=section.metric,
        metric_prior=section.metric_prior,
    )


XY = Annotated[
    list[Annotated[sections.Number, sections.Unit("length")]], Field(min_length=2, max_length=2)
]


class SheetCordSection(MemberSection):
    """A cord bonded to the sheet: force by strain, or stiffness EA (N); N and plain strains."""

    ends: Annotated[list[XY], Field(min_length=2, max_length=2)]


def cords_of(section: BubbleSection, place: Place, outline: Outline) -> tuple[SheetCord, ...]:
    """Return the cords of a section in mm; InputError names their keys."""
    found = []
    for i, own in enumerate(section.cord):
        at = f"cord[{i}]"
        table = own.table(place, at)
        with place.naming(at):
            cord = SheetCord(np.array(own.ends), table, own.prestrain, own.tension_only)
        for end in cord.ends[outline.share(cord.ends) > 1 + 1e-6]:
            problem = f"expected places on the disk, got {end.tolist()} mm beyond its edge"
            raise place.error(f"{at}.ends", problem)
        found.append(cord)
    return tuple(found)


Elements = Annotated[int, Field(ge=MIN_ELEMENTS, le=MAX_ELEMENTS)]
Symmetry = Literal["full", "quarter"]


class KnownSolutionSection(sections.Section):
    """[bubble.data.known_solution]: data are computed from these coefficients."""

    beta: list[sections.Modulus]
    form: str = "cubic"
    elements: Elements | None = None
    increments: list[sections.Pressure] | None = None
    symmetry: Symmetry | None = None
    solver: Name_of_sections | None = None


class PointColumnsSection(sections.Section):
    """Names of columns in the files, where they are not found."""

    x: str | None = None
    y: str | None = None
    z: str | None = None
    dx: str | None = None
    dy: str | None = None
    dz: str | None = None


class PointsSection(sections.Section):
    """[bubble.data.points]: files of measured points, one a pressure or all in one."""

    files: list[str] | None = None
    pattern: str | None = None
    indices: list[int] | None = None
    folder: str = ""
    reference: Name | None = None
    format: str | None = None
    columns: PointColumnsSection = PointColumnsSection.model_construct()
    flag_column: str | None = None
    valid_column: str | None = None
    decimal: Literal[".", ","] | None = None
    coordinates: Literal["reference", "deformed"] | None = None
    camera_axes: bool | None = None
    comment: str = "#"
    length_unit: sections.LengthUnit | None = None
    pressure: PressureSection | None = None
    registration: RegistrationSection | None = None
    filter: FilterSection | None = None
    correlation: CorrelationSection = CorrelationSection.model_construct()


class DataSection(sections.Section):
    """[bubble.data]: one of the two sources."""

    known_solution: KnownSolutionSection | None = None
    points: PointsSection | None = None


class MatchSection(sections.Section):
    """Points or polynomial surfaces through them, to be matched."""

    by: Literal["surfaces", "points"] = "points"
    degree: Annotated[int, Field(ge=1, le=12)] = 4


class NuisanceSection(sections.Section):
    """Offsets of a measurement, and its registration, fitted beside the moduli.
    turn, tilt (degrees), shift : one standard deviation of each around what was registered."""

    displacement_offset: bool = False
    pressure_offset: bool = False
    registration: Literal["given", "fitted"] = "given"
    turn: sections.Positive | None = None
    tilt: sections.Positive | None = None
    shift: sections.Length | None = None


class BubbleSection(sections.Section):
    """[[bubble]]: a clamped disk, inflated."""

    name: Name_of_sections | None = None
    weight: sections.Weight = 1.0
    radius: sections.Size | Literal["clamp"] | None = None
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
