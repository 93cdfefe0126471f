"""Readings of a bubble without a camera: series of heights, curvatures or strains by pressure.

The model is run at few pressures, the frames. Between them its displacements are interpolated by
cubics in the cube root of the pressure, in which a sheet rises almost linearly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...inference.objective import NoiseIs
from ...light_dataclasses import dataclass
from ...solvers.base import Array
from ..data_files import DataFile

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
