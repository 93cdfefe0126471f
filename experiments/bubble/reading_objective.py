"""Residuals of a bubble without a camera: model less measured heights, curvatures and strains.

Each series of readings is a block. A gauge that stands still at the place x reads the height of
that point X of the sheet which has moved below it: X + u(X) = x, with u the displacement in the
plane. By a change du, dw of the displacements this height changes by dw - g . du, where g is the
slope of the moved sheet, the gradient of w times the inverse of that of X + u.

Curvature and extension are those of three points of the sheet: of the circle through them, and of
the distances between them.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...inference.objective import NoiseIs, Objective
from ...meshes.sampling import SmoothReading
from ...solvers.base import Array, History
from .readings import Quantity, ReadingSeries, frame_weights
from .targets import sample_on_mesh

#: Name of the nuisance unknown of the zero of all gauges of one series, mm, with its number.
HEIGHT_OFFSET = "height_offset"
#: That of the scale of all heights, %.
HEIGHT_SCALE = "height_scale"


@dataclass(frozen=True, eq=False)
class SeriesReader(ABC):
    """Read the values of a series from the displacements of a model's nodes.

    Attributes
    ----------
    series : ReadingSeries
    weights : (n, frames) array
        Weights of the model's frames in each reading.
    reading : SmoothReading
        Interpolation on the model's mesh.
    """

    series: ReadingSeries
    weights: Array
    reading: SmoothReading

    @abstractmethod
    def values(self, displacement: Array) -> Array:
        """Return the values (n,) of a series.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """

    @abstractmethod
    def slopes(self, displacement: Array, slope: Array) -> Array:
        """Return the derivatives (n, k) of the values by k parameters.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        slope : (frames, nodes, 3, k) array
            Their derivatives by the parameters.
        """

    def displaced(self, places: Array, nodal: Array) -> Array:
        """Return displacements, or derivatives of them, at the pressure and the place of readings.

        Parameters
        ----------
        places : (copies n, 2) array, mm
            Points of the sheet before the test, for all readings once or several times.
        nodal : (frames, nodes, 3, ...) array

        Returns
        -------
        (copies n, 3, ...) array
        """
        signs = np.ones((len(places), 3))
        if "symmetry_x" in self.reading.mesh.node_sets:  # a quarter: mirror images
            signs[:, :2] = np.where(places < 0, -1.0, 1.0)
            places = np.abs(places)
        columns = np.moveaxis(nodal, 1, 0).reshape(nodal.shape[1], -1)
        sampled = sample_on_mesh(self.reading, places) @ columns
        by_frame = sampled.reshape(len(places), len(nodal), *nodal.shape[2:])
        weights = np.tile(self.weights, (len(places) // len(self.weights), 1))
        values = np.einsum("nk,nk...->n...", weights, by_frame)
        return values * signs.reshape(*signs.shape, *[1] * (values.ndim - 2))


@dataclass(frozen=True, eq=False)
class RestHeights(SeriesReader):
    """Heights of points of the sheet."""

    def values(self, displacement: Array) -> Array:
        return self.displaced(self.series.positions, displacement)[:, 2]

    def slopes(self, displacement: Array, slope: Array) -> Array:
        return self.displaced(self.series.positions, slope)[:, 2]


@dataclass(frozen=True, eq=False)
class GaugeHeights(SeriesReader):
    """Heights that a gauge reads which stands still while the sheet moves below it."""

    iterations: int = 2  # each leaves the strain's part of the distance; a Newton step follows
    #: Step of the central differences for the slope, over the largest coordinate of the mesh: small
    #: beside an element, large beside rounding.
    step_share: float = 5e-3

    def values(self, displacement: Array) -> Array:
        return self._below_gauge(displacement)[0]

    def slopes(self, displacement: Array, slope: Array) -> Array:
        _, places, tilt = self._below_gauge(displacement)
        change = self.displaced(places, slope)
        return change[:, 2] - np.einsum("ni,nik->nk", tilt, change[:, :2])

    def _below_gauge(self, displacement: Array) -> tuple[Array, Array, Array]:
        """Return heights (n,), the sheet's points (n, 2), mm, and slopes (n, 2) of the moved sheet.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        target = self.series.positions
        places = target
        for _ in range(self.iterations):
            places = target - self.displaced(places, displacement)[:, :2]
        step = self.step_share * float(np.abs(self.reading.mesh.points[:, :2]).max())  # mm
        shifts = step * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        stencil = (places + shifts[:, None]).reshape(-1, 2)
        motion, *sides = np.split(self.displaced(stencil, displacement), len(shifts))
        differences = [sides[0] - sides[1], sides[2] - sides[3]]
        gradient = np.stack(differences, axis=-1) / (2.0 * step)
        stretch = np.eye(2) + gradient[:, :2]
        tilt = np.linalg.solve(stretch.transpose(0, 2, 1), gradient[:, 2, :, None])[..., 0]
        gap = target - places - motion[:, :2]
        return motion[:, 2] + (tilt * gap).sum(axis=1), places, np.asarray(tilt, dtype=float)


@dataclass(frozen=True, eq=False)
class ApexTriples(SeriesReader):
    """Curvature or extension of the sheet by three of its points, a span apart from end to end."""

    def values(self, displacement: Array) -> Array:
        return self._measure(self._triples(displacement))

    def slopes(self, displacement: Array, slope: Array) -> Array:
        triples = self._triples(displacement).astype(complex)
        changes = [self.displaced(points, slope) for points in self._points]
        total = np.zeros(changes[0][:, 0].shape)
        step = 1e-30  # of the derivative along an imaginary step, which has no rounding
        for point, change in enumerate(changes):
            for axis in range(3):
                changed = triples.copy()
                changed[:, point, axis] += 1j * step
                derivative = self._measure(changed).imag / step
                total += derivative[:, None] * change[:, axis]
        return total

    @property
    def _points(self) -> list[Array]:
        """Return the three points (n, 2) of each reading before the test."""
        shift = 0.5 * self.series.span * np.array(self.series.direction)
        return [self.series.positions + sign * shift for sign in (-1.0, 0.0, 1.0)]

    def _triples(self, displacement: Array) -> Array:
        """Return the three points (n, 3, 3) mm of each reading on the moved sheet.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        triples = []
        for points in self._points:
            position = np.column_stack([points, np.zeros(len(points))])
            triples.append(position + self.displaced(points, displacement))
        return np.stack(triples, axis=1)

    def _measure(self, triples: Array) -> Array:
        """Return the curvature (1/mm) of the circle through three points, or their mean extension.

        Parameters
        ----------
        triples : (n, 3, 3) array, mm
            The points of each reading, the apex in the middle.
        """
        first = triples[:, 0] - triples[:, 1]
        second = triples[:, 2] - triples[:, 1]
        lengths = _norm(first) + _norm(second)
        if self.series.quantity == "strain":
            return lengths / self.series.span - 1.0
        area = _norm(np.cross(first, second))
        return 2.0 * area / (_norm(first) * _norm(second) * _norm(first - second))


def _norm(vectors: Array) -> Array:
    """Return the lengths (n,) of vectors (n, 3), real or complex."""
    return np.sqrt((vectors * vectors).sum(axis=1))


def reader_of(
    series: ReadingSeries, pressures: Sequence[float], reading: SmoothReading
) -> SeriesReader:
    """Return what reads a series from a model's displacements at pressures (MPa)."""
    weights = frame_weights(pressures, series.pressure)
    reader: type[SeriesReader] = RestHeights if series.moves_with_sheet else GaugeHeights
    if series.quantity != "height":
        reader = ApexTriples
    return reader(series, weights, reading)


class ReadingObjective(Objective):
    """The residuals of series of readings, a block each.

    Parameters
    ----------
    readers : sequence of SeriesReader
    normalise : {"e", "mm"}
        "e" divides residuals by the largest measured value of their series, "mm" by one mm; of
        other quantities than heights always by the largest.
    weight : float
        Weight of every block in the sum e of their norms.
    noise : mapping of str to float
        Noise that the project states for a quantity, in base units.

    Attributes
    ----------
    noises : tuple of float
        Standard deviation of a value of each series, in base units.
    """

    is_curved_in_shear = True
    weighs_by_noise = True

    def __init__(
        self,
        readers: Sequence[SeriesReader],
        normalise: Literal["e", "mm"],
        weight: float,
        noise: Mapping[Quantity, float],
    ) -> None:
        self.readers = tuple(readers)
        series = [reader.series for reader in readers]
        pooled = {s.quantity: _pooled_noise(s.quantity, series, noise) for s in series}
        self.noises = tuple(pooled[s.quantity][0] for s in series)
        self.noise_is = pooled[series[0].quantity][1]
        self.sizes = tuple(len(s.value) for s in series)
        self.quantities = tuple(s.label for s in series)
        self.correlated_count = max(s.correlated_count for s in series)
        is_comparable = len(series) == 1 and series[0].specimen_count > 1
        self.specimens = series[0].specimens if is_comparable else None
        units = [_unit_error(s, normalise) for s in series]
        divisors = [u * np.sqrt(n) / weight for u, n in zip(units, self.sizes, strict=True)]
        self.divisor = np.repeat(divisors, self.sizes)
        # Series of several quantities are compared in units of their noise.
        factors = [1.0 / level for level in self.noises]
        self.unit = "sigma"
        if len(pooled) == 1:
            self.unit = series[0].unit.name
            factors = [series[0].unit.size] * len(series)
        self.least_noise = self.noises[0] * factors[0]
        self.scale = self.divisor * np.repeat(factors, self.sizes)

    @property
    def data(self) -> tuple[Array, ...]:
        series = [reader.series for reader in self.readers]
        return tuple(array for s in series for array in (s.pressure, s.value, s.positions))

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the places (n, 3), mm, of the values of each block: rise by the pressure, x, y."""
        highest = max(reader.series.pressure.max() for reader in self.readers)
        size = max(np.abs(reader.reading.mesh.points).max() for reader in self.readers)
        return tuple(
            np.column_stack([size * np.cbrt(s.pressure / highest), s.positions])
            for s in (reader.series for reader in self.readers)
        )

    def spread_over_residuals(self, values: Array) -> Array:
        return values

    def shifted(self, external: History, surrogate: History) -> ReadingObjective:
        objective = copy.copy(self)
        shifted = []
        for reader in self.readers:
            difference = reader.values(external.displacement) - reader.values(
                surrogate.displacement
            )
            series = replace(reader.series, value=reader.series.value - difference)
            shifted.append(replace(reader, series=series))
        objective.readers = tuple(shifted)
        return objective

    @property
    def height_offsets(self) -> tuple[str, ...]:
        """Return the names of the offsets of the gauges, one for each series of heights."""
        return tuple(
            f"{HEIGHT_OFFSET}_{number}"
            for number, reader in enumerate(self.readers, start=1)
            if reader.series.quantity == "height"
        )

    def modelled(self, displacement: Array, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the model's values (n,) of each series in base units, as the gauges show them.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        scale = 1.0 + 0.01 * nuisance.get(HEIGHT_SCALE, 0.0)
        return [
            reader.values(displacement) * (scale if reader.series.quantity == "height" else 1.0)
            + nuisance.get(f"{HEIGHT_OFFSET}_{k + 1}", 0.0)
            for k, reader in enumerate(self.readers)
        ]

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        modelled = np.concatenate(self.modelled(history.displacement, nuisance or {}))
        measured = np.concatenate([reader.series.value for reader in self.readers])
        return (modelled - measured) / self.divisor

    def jacobian(self, history: History, slope: Array) -> Array:
        slopes = [reader.slopes(history.displacement, slope) for reader in self.readers]
        return np.concatenate(slopes) / self.divisor[:, None]

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        blocks = np.repeat(np.arange(len(self.sizes)), self.sizes)
        columns = []
        for name in names:
            if name == HEIGHT_SCALE:
                columns.append(0.01 * self._heights(history.displacement))
            else:
                columns.append(blocks == int(name.rpartition("_")[2]) - 1)
        return np.column_stack(columns) / self.divisor[:, None]

    def _heights(self, displacement: Array) -> Array:
        """Return the model's value of each reading in mm, 0 where it is no height."""
        values = [
            reader.values(displacement) * (reader.series.quantity == "height")
            for reader in self.readers
        ]
        return np.concatenate(values)


def _pooled_noise(
    quantity: Quantity, series: Sequence[ReadingSeries], stated: Mapping[Quantity, float]
) -> tuple[float, NoiseIs]:
    """Return the noise of a quantity in all of its series, in base units, and how it is known."""
    noises = [s.noise(stated.get(quantity)) for s in series if s.quantity == quantity]
    level = float(np.sqrt(np.mean([level**2 for level, _ in noises])))
    return level, noises[0][1]


def _unit_error(series: ReadingSeries, normalise: Literal["e", "mm"]) -> float:
    """Return the error of a series that counts as one: its largest value, or one mm."""
    is_in_mm = normalise == "mm" and series.quantity == "height"
    return 1.0 if is_in_mm else float(np.abs(series.value).max())
