"""The tables of a bubble without a camera: heights at places, profiles along lines, the apex."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...readers import sections

XY = Annotated[
    list[Annotated[sections.Number, sections.Unit("length")]], Field(min_length=2, max_length=2)
]
PressureUnit = Literal["Pa", "hPa", "mbar", "kPa", "psi", "bar", "MPa"]
LengthUnit = Literal["mm", "cm", "m", "µm", "in", "mil"]
Pressures = list[Annotated[sections.Number, sections.Unit("pressure")]]
Lengths = list[Annotated[sections.Number, sections.Unit("length")]]


class TableSection(sections.Section):
    """Files of a table of readings, one a specimen or all in one, and how they are read.
    Units are those of columns whose names have none."""

    files: list[str] = Field(default_factory=list)
    folder: str = ""
    format: str | None = None
    comment: str = "#"
    decimal: Literal[".", ","] | None = None
    sheet: str | None = None
    pressure_unit: PressureUnit | None = None
    length_unit: LengthUnit | None = None


class HeightColumnsSection(sections.Section):
    """Names of columns in the files, where they are not found; a height for each place."""

    pressure: str | None = None
    height: list[str] | str | None = None
    specimen: str | None = None


class HeightValuesSection(sections.Section):
    """GaugeReadings in place of files: pressures, and heights at them, a list for each place.
    specimen: the name or number of each reading's specimen, where there are several."""

    pressure: Pressures
    height: Lengths | list[Lengths]
    specimen: list[str | int] | None = None


class HeightsSection(TableSection):
    """[bubble.data.heights]: pressure and height over one place of the sheet or several.
    Places are those of gauges that stand still; with `moves_with_sheet`, of points of the sheet."""

    places: list[XY] | None = None
    moves_with_sheet: bool = False
    columns: HeightColumnsSection = HeightColumnsSection.model_construct()
    values: HeightValuesSection | None = None
