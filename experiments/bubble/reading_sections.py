"""The tables of a bubble without a camera: heights at places, profiles along lines, the apex."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...readers import sections
from ...solvers.base import Array
from ..sections import TableFilesSection

XY = Annotated[
    list[Annotated[sections.Number, sections.Unit("length")]], Field(min_length=2, max_length=2)
]
PressureUnit = Literal["Pa", "hPa", "mbar", "kPa", "psi", "bar", "MPa"]
LengthUnit = Literal["mm", "cm", "m", "µm", "in", "mil"]
Pressures = list[Annotated[sections.Number, sections.Unit("pressure")]]
Lengths = list[Annotated[sections.Number, sections.Unit("length")]]


class TableSection(TableFilesSection):
    """Files of a table of readings, one a specimen or all in one, and how they are read.

    Units are those of columns whose names have none. `columns` are names that are not found,
    `values` numbers in place of files.
    """

    files: list[str] = Field(default_factory=list)
    pressure_unit: PressureUnit | None = None
    length_unit: LengthUnit | None = None
    columns: Any = None
    values: Any = None


class HeightColumnsSection(sections.Section):
    """Names of columns; a height for each place."""

    pressure: str | None = None
    height: list[str] | str | None = None
    specimen: str | None = None


class HeightValuesSection(sections.Section):
    """Pressures, and heights at them, a list for each place.

    `specimen` is the name or number of each reading's specimen, where there are several.
    """

    pressure: Pressures
    height: Lengths | list[Lengths]
    specimen: list[str | int] | None = None


class HeightsSection(TableSection):
    """[bubble.data.heights]: pressure and height over one place of the sheet or several.

    Places are those of gauges that stand still; with `moves_with_sheet`, of points of the sheet.
    """

    places: list[XY] | None = None
    moves_with_sheet: bool = False
    columns: HeightColumnsSection = HeightColumnsSection.model_construct()
    values: HeightValuesSection | None = None


class ProfileColumnsSection(sections.Section):
    """Names of columns.

    `axis` holds x, y, or degrees from the warp, where there are several lines.
    """

    axis: str | None = None
    coordinate: str | None = None
    height: str | None = None
    pressure: str | None = None


class ProfileValuesSection(sections.Section):
    """A row for each point: the pressure, the line, the place on it, and the height."""

    pressure: Pressures
    coordinate: Lengths
    height: Lengths
    axis: list[str] | None = None


class ProfilesSection(TableSection):
    """[bubble.data.profiles]: heights along lines through the centre, one a pressure or all.

    `direction_deg` is that of the line from the warp, where no column has it.
    """

    direction_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    moves_with_sheet: bool = False
    columns: ProfileColumnsSection = ProfileColumnsSection.model_construct()
    values: ProfileValuesSection | None = None


class ApexColumnsSection(sections.Section):
    """Names of columns, which are not found by themselves but for that of the pressure."""

    pressure: str | None = None
    curvature_warp: str | None = None
    curvature_fill: str | None = None
    strain_warp: str | None = None
    strain_fill: str | None = None
    specimen: str | None = None


class ApexValuesSection(sections.Section):
    """A row for each reading: curvatures in 1/mm, strains as plain numbers."""

    pressure: Pressures
    curvature_warp: list[sections.Number] | None = None
    curvature_fill: list[sections.Number] | None = None
    strain_warp: list[sections.Number] | None = None
    strain_fill: list[sections.Number] | None = None
    specimen: list[str | int] | None = None


class ApexSection(TableSection):
    """[bubble.data.apex]: curvature and strain of the apex along warp and fill by pressure.

    `curvature_is` says what columns hold: "curvature", 1/R of either sign; "half" of it, the a of
    z = a x^2; or "radius", R. `span` is the length over which they are measured. Noise is in 1/mm,
    that of a strain a plain number.
    """

    curvature_unit: Literal["1/m", "1/mm", "1/cm", "mm", "m"] | None = None
    curvature_is: Literal["curvature", "half", "radius"] = "curvature"
    strain_unit: Literal["%", "‰", "mm/mm"] | None = None
    strain_is: Literal["engineering", "logarithmic"] = "engineering"
    span: sections.Length | None = None
    curvature_noise: sections.Positive | None = None
    strain_noise: sections.Positive | None = None
    columns: ApexColumnsSection = ApexColumnsSection.model_construct()
    values: ApexValuesSection | None = None

    @property
    def noise_of(self) -> dict[Literal["curvature", "strain"], float]:
        """Return the noise that is given, by quantity."""
        noise: dict[Literal["curvature", "strain"], float] = {}
        if self.curvature_noise is not None:
            noise["curvature"] = self.curvature_noise
        if self.strain_noise is not None:
            noise["strain"] = self.strain_noise
        return noise

    def measure(self, quantity: str, values: Array) -> Array:
        """Return curvatures 1/R, positive, or engineering strains, from what the table has.

        Parameters
        ----------
        values : (n,) array
            Column of the table: curvatures, their halves, radii, or strains.
        """
        if quantity == "strain":
            return np.expm1(values) if self.strain_is == "logarithmic" else values
        if self.curvature_is == "radius":
            return np.abs(1.0 / values)
        return np.abs(values) * (2.0 if self.curvature_is == "half" else 1.0)
