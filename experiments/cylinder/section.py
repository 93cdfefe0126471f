"""[[cylinder]] of a project, as it is written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...readers.sections import Name, Number, Positive, Section
from ..keys import ChannelSection

Frames = Annotated[int, Field(ge=1, le=10000)]
FileNames = Annotated[list[str], Field(min_length=1)]
Lengths = Annotated[list[Positive], Field(min_length=1)]
NotNegative = Annotated[float, Field(ge=0, le=1e18)]


class CollarSection(Section):
    """The ring that bends the cylinder; by its diameter unless given."""

    inner_diameter: Positive
    length: Positive
    fillet: Positive | None = None


class GasSection(Section):
    """The gas that fills the cylinder."""

    ambient: Positive | None = None
    temperature: Positive | None = None
    density: Positive | None = None


class MeasuredSection(Section):
    """Measured loads: a file a repetition, or a column that tells repetitions apart."""

    files: FileNames | None = None
    folder: str = ""
    format: str | None = None
    deflection: ChannelSection = ChannelSection()
    load: ChannelSection = ChannelSection()
    repetition: str | None = None
    preload: Number = 0.0
    zero: Literal["none", "first", "line"] = "none"
    comment: str = "#"
    decimal: Literal[".", ","] | None = None


class CylinderSection(Section):
    """Section [[cylinder]]: inflated, laid on two supports, bent by a collar."""

    name: Name | None = None
    diameter: Positive
    pressure: Positive
    length: Positive | None = None
    seam_width: NotNegative | None = None
    element_size: Positive | None = None
    symmetry: Literal["full", "quarter"] = "quarter"
    span: Positive | None = None
    support_diameter: Positive | None = None
    collar: CollarSection | None = None
    deflection: Positive | None = None
    frames: Frames | None = None
    deflections: Lengths | None = None
    places: Lengths | None = None
    slope_over: Positive | None = None
    cap_warp: Literal["x", "y"] = "x"
    gas: GasSection = GasSection()
    measured: MeasuredSection = MeasuredSection()
