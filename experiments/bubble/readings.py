"""Readings of a bubble without a camera: heights, curvatures or strains by pressure; their tables.

The model is run at few pressures, the frames. Between them its displacements are interpolated by
cubics in the cube root of the pressure, in which a sheet rises almost linearly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...inference.objective import NoiseIs
from ...light_dataclasses import dataclass
from ...readers import sections
from ...solvers.base import Array
from ..data_files import DataFile
from ..sections import TableFilesSection

Quantity = Literal["height", "curvature", "strain"]


@dataclass(frozen=True)
class ReadingUnit:
    """The unit in which a quantity is shown, and what its instruments usually leave as noise.

    Attributes
    ----------
    name : str
    size : float
        Units in one base unit (mm, 1/mm, 1).
    noise : float
        Usual standard deviation of one value, in base units; of a curvature, over the largest.
    """

    name: str
    size: float
    noise: float


UNITS: dict[Quantity, ReadingUnit] = {
    "height": ReadingUnit("mm", 1.0, 0.05),  # a dial or laser gauge over a moving sheet
    "curvature": ReadingUnit("1/m", 1e3, 0.01),
    "strain": ReadingUnit("%", 100.0, 1e-4),
}


@dataclass(frozen=True)
class ReadingLimits:
    """Which readings are used, and at how many pressures the model is run for them."""

    least_pressure: float = 1e-3  # over the largest: a reading below is one without pressure
    pressure_scatter: float = 0.01  # over the largest: profiles within it are at one pressure
    max_frames: int = 12
    max_points: int = 40  # of a profile at one pressure
    max_readings: int = 200  # of a specimen at one place; of more, neighbours are averaged
    #: Independent readings along the curve of one specimen: it is stiffer or softer as a whole.
    independent: float = 1.25


LIMITS = ReadingLimits()


@dataclass(frozen=True, eq=False)
class ReadingSeries:
    """Values of one quantity at one place, or along one line, by pressure.

    Attributes
    ----------
    quantity : {"height", "curvature", "strain"}
    label : str
        What is measured where, in words.
    pressure : (n,) array, MPa
    value : (n,) array
        Height in mm above the sheet before the test, curvature in 1/mm, or engineering strain.
    positions : (n, 2) array, mm
        Places of the readings.
    specimens : (n,) array of int
        Number of the specimen of each reading.
    moves_with_sheet : bool
        Whether positions are those of points of the sheet before the test; otherwise a gauge stands
        still while the sheet moves below it.
    direction : (float, float)
        Unit vector along which a curvature or a strain is measured.
    span : float, mm
        Length over which a curvature or a strain is measured.
    at_rest : float, mm, or None
        Mean height that was read without pressure before the first inflation.
    left_out : int
        Number of readings under pressure that are of releases and of other inflations.
    """

    quantity: Quantity
    label: str
    pressure: Array
    value: Array
    positions: Array
    specimens: NDArray[np.intp]
    moves_with_sheet: bool = False
    direction: tuple[float, float] = (1.0, 0.0)
    span: float = 0.0
    at_rest: float | None = None
    left_out: int = 0

    @property
    def unit(self) -> ReadingUnit:
        """Return the unit in which the values are shown."""
        return UNITS[self.quantity]

    @property
    def specimen_count(self) -> int:
        """Return the number of specimens."""
        return len(np.unique(self.specimens))

    def subset(self, rows: NDArray[np.bool_]) -> ReadingSeries:
        """Return the series with some of its readings only.

        Parameters
        ----------
        rows : (n,) array of bool
            The readings that stay.
        """
        return replace(
            self,
            pressure=self.pressure[rows],
            value=self.value[rows],
            positions=self.positions[rows],
            specimens=self.specimens[rows],
        )

    def noise(self, stated: float | None) -> tuple[float, NoiseIs]:
        """Return the standard deviation of one value, and how it is known.

        It is the stated one, else the scatter of the specimens about the cubic through all of them
        in the cube root of the pressure, else a usual one.

        Parameters
        ----------
        stated : float or None
            The noise that the project gives, in base units.
        """
        if stated is not None:
            return stated, "given"
        if self.specimen_count > 1:
            terms = np.cbrt(self.pressure)[:, None] ** [1, 2, 3]
            solution = np.linalg.lstsq(terms, self.value, rcond=1e-10)[0]
            return float(np.std(self.value - terms @ solution, ddof=1)), "specimens' scatter"
        usual = self.unit.noise
        if self.quantity == "curvature":
            usual *= float(np.abs(self.value).max())
        return usual, "assumed"

    @property
    def correlated_count(self) -> float:
        """Return how many readings share one error: those of a specimen, where there are several.

        Those of a single specimen count as independent, unless the fit leaves more than noise.
        """
        if self.specimen_count < 2:
            return 1.0
        return max(1.0, len(self.value) / (LIMITS.independent * (self.specimen_count - 1)))


@dataclass(frozen=True, eq=False)
class GaugeReadings:
    """All readings of a test, with the files that they were read from.

    Attributes
    ----------
    series : tuple of ReadingSeries
        Empty where a forward analysis does not need the data.
    files : tuple of DataFile
    noise : mapping of str to float
        Noise that the section states for a curvature and for a strain, in base units.
    recorded : None
        Always None: there are no recorded frames to choose among.
    """

    series: tuple[ReadingSeries, ...]
    files: tuple[DataFile, ...] = ()
    noise: Mapping[Quantity, float] = field(default_factory=dict)
    recorded: ClassVar[None] = None

    def frame_pressures(self, listed: Sequence[float] | None) -> tuple[float, ...] | None:
        """Return the pressures (MPa) at which the model is run: those listed, else a few.

        They are those of the readings where these are at few pressures, else they are evenly spread
        over the cube root of the pressure. None where there are neither.
        """
        if listed is not None or not self.series:
            return None if listed is None else tuple(listed)
        levels = np.unique(np.concatenate([series.pressure for series in self.series]))
        is_distinct = np.diff(levels, prepend=0.0) > 1e-6 * levels[-1]
        levels = levels[is_distinct]
        if len(levels) > LIMITS.max_frames:
            first, last = np.cbrt(levels[[0, -1]]).tolist()
            levels = np.linspace(first, last, LIMITS.max_frames) ** 3
        return tuple(levels.tolist())

    def within(self, pressures: Sequence[float] | None) -> GaugeReadings:
        """Return the readings at pressures (MPa) from the first to the last frame."""
        if pressures is None:
            return self
        first, last = pressures[0] * (1 - 1e-6), pressures[-1] * (1 + 1e-6)
        parts = [s.subset((s.pressure >= first) & (s.pressure <= last)) for s in self.series]
        return replace(self, series=tuple(part for part in parts if len(part.value)))


def frame_weights(frames: Sequence[float], pressure: Array) -> Array:
    """Return the weights (n, frames) of the model's frames at pressures (n,), MPa.

    They are those of the cubic in the cube root of the pressure through the four frames around it.
    The sheet without pressure, which has not moved, is one of these.

    Parameters
    ----------
    frames : sequence of float, MPa
        Pressures of the frames, rising.
    pressure : (n,) array, MPa
        Pressures of the readings.
    """
    knots = np.cbrt([0.0, *frames])
    place = np.cbrt(pressure)
    order = min(4, len(knots))
    first = np.clip(np.searchsorted(knots, place) - order // 2, 0, len(knots) - order)
    weights = np.zeros((len(place), len(knots)))
    rows = np.arange(len(place))
    for k in range(order):
        factor = np.ones(len(place))
        for i in range(order):
            if i != k:
                knot = knots[first + i]
                factor *= (place - knot) / (knots[first + k] - knot)
        weights[rows, first + k] = factor
    return weights[:, 1:]


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
