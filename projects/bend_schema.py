"""The project file of bending cases as it is written, in the file's own units."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .schema import (
    BreaksSection,
    Number,
    Positive,
    ProjectSection,
    Section,
    SolverSection,
    Strain,
    Symmetry,
    UnitsSection,
)

Name = Annotated[str, Field(min_length=1, max_length=300)]
Frames = Annotated[int, Field(ge=1, le=10000)]
FileNames = Annotated[list[str], Field(min_length=1)]
Deflections = Annotated[list[Positive], Field(min_length=1)]
Zero = Literal["none", "first", "line"]


class CollarSection(Section):
    inner_diameter: Positive
    length: Positive
    fillet: Positive | None = None


class GasSection(Section):
    ambient: Positive | None = None
    temperature: Positive | None = None
    density: Positive | None = None


class ShapeSection(Section):
    """What [cylinder] says for all cases and a case may say for itself."""

    length: Positive | None = None
    seam_width: Annotated[float, Field(ge=0, le=1e18)] | None = None
    element_size: Positive | None = None
    symmetry: Symmetry | None = None
    span: Positive | None = None
    support_diameter: Positive | None = None
    collar: CollarSection | None = None
    deflection: Positive | None = None
    frames: Frames | None = None
    deflections: Deflections | None = None
    cap_warp: Literal["x", "y"] | None = None
    gas: GasSection | None = None


class CylinderSection(ShapeSection):
    thickness: Positive | None = None


class ChannelSection(Section):
    column: str | None = None
    unit: str | None = None
    scale: Number = 1.0
    offset: Number = 0.0


class MeasuredSection(Section):
    """How the measured files are to be read, all cases alike."""

    folder: str = ""
    deflection: ChannelSection = ChannelSection()
    load: ChannelSection = ChannelSection()
    repetition: str | None = None
    preload: Number = 0.0
    zero: Zero = "none"
    comment: str = "#"
    decimal: Literal[".", ","] | None = None


class CaseSection(ShapeSection):
    name: Name | None = None
    diameter: Positive
    pressure: Positive
    measured: FileNames | None = None


class CardSection(Section):
    """A material: a card's file, or coefficients as in the thesis' tables."""

    name: Name | None = None
    file: str | None = None
    beta: list[Number] | None = None
    nu12: Annotated[float, Field(ge=0, lt=1)] | None = None
    thickness: Positive | None = None
    thickness_change: Literal["constant", "incompressible"] | None = None
    strain_range: Annotated[list[Strain], Field(min_length=3, max_length=3)] | None = None
    breaks: BreaksSection | None = None
    test: Literal["uniaxial", "bubble", "joint"] | None = None


class RunSection(Section):
    solver: str = "membrane"
    jobs: Annotated[int, Field(ge=1, le=10000)] | None = None


class BendFile(Section):
    """The whole file of bending cases."""

    project: ProjectSection
    units: UnitsSection = UnitsSection()
    cylinder: CylinderSection = CylinderSection()
    measured: MeasuredSection = MeasuredSection()
    cases: Annotated[list[CaseSection], Field(min_length=1, max_length=1000)]
    cards: Annotated[list[CardSection], Field(min_length=1, max_length=100)]
    run: RunSection = RunSection()
    solver: SolverSection = SolverSection()
