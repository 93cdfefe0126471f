"""[[bubble]] of a project, as it is written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...meshes.disk import MAX_ELEMENTS, MIN_ELEMENTS
from ...sections import LengthUnit, Name, Number, Positive, Section
from .correlation_section import CorrelationSection
from .filter_section import FilterSection
from .outline_section import EllipseSection
from .pressure_section import PressureSection
from .registration_section import RegistrationSection
from .sheet_section import SheetSection

Elements = Annotated[int, Field(ge=MIN_ELEMENTS, le=MAX_ELEMENTS)]
Symmetry = Literal["full", "quarter"]


class KnownSolutionSection(Section):
    """[bubble.data.known_solution]: data are computed from these coefficients."""

    beta: list[Number]
    form: str = "cubic"
    elements: Elements | None = None
    increments: list[Positive] | None = None
    symmetry: Symmetry | None = None
    solver: Name | None = None


class ColumnsSection(Section):
    """Names in the files, where they are not found."""

    x: str | None = None
    y: str | None = None
    z: str | None = None
    dx: str | None = None
    dy: str | None = None
    dz: str | None = None


class PointsSection(Section):
    """[bubble.data.points]: files of measured points, one a pressure or all in one."""

    files: list[str] | None = None
    pattern: str | None = None
    indices: list[int] | None = None
    folder: str = ""
    format: str | None = None
    columns: ColumnsSection = ColumnsSection()
    flag_column: str | None = None
    valid_column: str | None = None
    decimal: Literal[".", ","] | None = None
    coordinates: Literal["reference", "deformed"] | None = None
    camera_axes: bool | None = None
    comment: str = "#"
    length_unit: LengthUnit | None = None
    pressure: PressureSection | None = None
    registration: RegistrationSection | None = None
    filter: FilterSection | None = None
    correlation: CorrelationSection = CorrelationSection()


class DataSection(Section):
    """[bubble.data]: one of the two."""

    known_solution: KnownSolutionSection | None = None
    points: PointsSection | None = None


class MatchSection(Section):
    """Whether points or polynomial surfaces through them are matched."""

    by: Literal["surfaces", "points"] = "points"
    degree: Annotated[int, Field(ge=1, le=12)] = 4


class NuisanceSection(Section):
    """What a measurement may be off by, fitted beside the moduli."""

    displacement_offset: bool = False
    pressure_offset: bool = False


class BubbleSection(Section):
    """[[bubble]]: a clamped disk, inflated."""

    name: Name | None = None
    weight: Positive = 1.0
    radius: Positive | None = None
    ellipse: EllipseSection | None = None
    pressures: Annotated[list[Positive], Field(min_length=1)] | None = None
    increments: list[Positive] | None = None
    elements: Elements = 800
    symmetry: Symmetry = "full"
    generator: Literal["blocks", "gmsh"] = "blocks"
    objective: Literal["e", "mm"] = "e"
    noise: Positive | None = None
    match: MatchSection = MatchSection()
    nuisance: NuisanceSection = NuisanceSection()
    sheet: SheetSection = SheetSection()
    data: DataSection
