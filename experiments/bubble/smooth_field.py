"""Smooth polynomials through measured displacements, and how a misalignment changes them.

A misalignment is a small error of the coordinate system: a shift of positions, or a tilt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from ...meshes.mesh import strain_of_tangents
from ...solvers.base import Array

#: Fewest points of which the strain is computed: of an inflated disk, polynomials of degree 7 give
#: it to 0.1 % of strain (RMS), those of degree 4 to 0.5 %.
MIN_STRAIN_POINTS = 192


@dataclass(frozen=True, eq=False)
class SmoothField:
    """A least-squares fit of displacements by products of Legendre polynomials of x and y.

    Attributes
    ----------
    positions : (n, 2) array, mm
        Positions of the displacements that were fitted.
    size : float, mm
        Largest absolute coordinate of the positions; polynomials are of x / size and y / size.
    amplitudes : (terms, k) array, mm
        Coefficients of the products, for each of k columns: the components of a displacement.
    """

    positions: Array
    size: float
    amplitudes: Array

    @classmethod
    def through(
        cls,
        positions: Array,
        values: Array,
        *,
        max_degree: int = 8,
        points_per_term: int = 3,
    ) -> SmoothField:
        """Fit displacements at positions by least squares.

        Parameters
        ----------
        positions : (n, 2) array, mm
        values : (n, k) array, mm
        max_degree : int
            Degree in x, and in y; it is lower where there are few points.
        points_per_term : int
            Fewest points for each product of polynomials.
        """
        size = float(np.abs(positions).max())
        degree = min(max_degree, math.isqrt(len(positions) // points_per_term) - 1)
        shapes = _shapes(positions / size, (max(degree, 1) + 1) ** 2)
        amplitudes, *_ = np.linalg.lstsq(shapes, values, rcond=1e-6)
        return cls(positions, size, np.asarray(amplitudes))

    def shapes(self, positions: Array) -> Array:
        """Return the products of polynomials, (n, terms), at positions (n, 2), mm."""
        return _shapes(positions / self.size, len(self.amplitudes))

    @property
    def values(self) -> Array:
        """Return the field, (n, k) mm, at the positions."""
        return self.shapes(self.positions) @ self.amplitudes

    def growth(self, shift: Array) -> Array:
        """Return the change of the field, (n, 3) mm, from positions less a shift to positions.

        Parameters
        ----------
        shift : (2,) array, mm
        """
        difference = self.shapes(self.positions) - self.shapes(self.positions - shift)
        return difference @ self.amplitudes

    def slopes(self, shift: Array | float = 0.0, step: float = 1e-4) -> tuple[Array, Array]:
        """Return the derivatives by x and by y, (n, k) each, at the positions less a shift.

        Parameters
        ----------
        shift : (2,) array, mm, or 0
        step : float
            Step of the central differences, as a share of the size.
        """
        scaled = (self.positions - shift) / self.size
        count = len(self.amplitudes)
        by_x, by_y = (
            (_shapes(scaled + change, count) - _shapes(scaled - change, count))
            @ self.amplitudes
            / (2 * step * self.size)
            for change in step * np.eye(2)
        )
        return by_x, by_y


def smooth_strains(
    positions: Array,
    heights: Array,
    displacements: Sequence[Array],
    warp: Array | None = None,
) -> list[Array]:
    """Return the log strain of a sheet that smooth polynomials through displacements have.

    Parameters
    ----------
    positions : (n, 2) array, mm
    heights : (n,) array, mm
        Heights z of the sheet before the test.
    displacements : sequence of (n, 3) arrays, mm
        Several fields, each of which is differentiated in the same way.
    warp : (3,) array, optional
        Direction of the warp; x unless given.

    Returns
    -------
    list of (n, 3) arrays
        eps1 along the warp, eps2 along the fill, and the engineering shear gamma12 of each field.
    """
    smooth = SmoothField.through(positions, np.column_stack([heights, *displacements]))
    height_slope, *slopes = np.split(
        np.stack(smooth.slopes(), axis=-1), np.arange(1, 1 + 3 * len(displacements), 3), axis=1
    )
    tangents = np.tile(np.eye(3, 2), (len(positions), 1, 1))
    tangents[:, 2] = height_slope[:, 0]
    return [strain_of_tangents(tangents, tangents + slope, warp) for slope in slopes]


def _shapes(scaled: Array, terms: int) -> Array:
    """Return products of Legendre polynomials, (n, terms), at points.

    Parameters
    ----------
    scaled : (n, 2) array
        Coordinates from -1 to 1.
    """
    x, y = (legvander(coordinate, math.isqrt(terms) - 1) for coordinate in scaled.T)
    products = x[:, :, None] * y[:, None]
    return products.reshape(len(scaled), -1)


def tilt_rotation(degrees: Array) -> tuple[Array, tuple[Array, Array]]:
    """Return the rotation of a tilt about x and y, and its derivatives by both angles.

    Parameters
    ----------
    degrees : (2,) array
        Angles about x and about y.

    Returns
    -------
    rotation : (3, 3) array
        Matrix that rotates about y first, then about x.
    derivatives : two (3, 3) arrays, 1/degree
        By the angle about x, and by that about y.
    """
    c, b = np.cos(np.radians(degrees))
    s, a = np.sin(np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_y = np.array([[b, 0, a], [0, 1, 0], [-a, 0, b]])
    by_x = np.array([[0, 0, 0], [0, -s, -c], [0, c, -s]])
    by_y = np.array([[-a, 0, b], [0, 0, 0], [-b, 0, -a]])
    degree = np.pi / 180
    return about_x @ about_y, (degree * by_x @ about_y, degree * about_x @ by_y)
