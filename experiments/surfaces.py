"""Polynomial surfaces of displacement fields (Eq. 4.4, any degree)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from .fields import DisplacementField

Array = NDArray[np.float64]

DIRECTIONS = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class DisplacementSurface:
    """Three tensor polynomials of one pressure.

    pressure MPa; degree d; coefficients (3, (d + 1)^2) of (x/scale, y/scale) in the order of
    Eq. 4.4 (y^d x^d first, then falling powers of x, the constant last); scale mm; r_squared (3,)
    the coefficients of determination (Table 4.1).
    """

    pressure: float
    degree: int
    coefficients: Array
    scale: float
    r_squared: Array

    def evaluate(self, points: Array) -> Array:
        """Displacement (n, 3) mm at points (n, 2) mm."""
        return np.asarray(_terms(points / self.scale, self.degree) @ self.coefficients.T)


def _terms(points: Array, degree: int) -> Array:
    x = np.vander(points[:, 0], degree + 1)
    y = np.vander(points[:, 1], degree + 1)
    return np.asarray((y[:, :, None] * x[:, None, :]).reshape(len(points), -1))


def fit_surface(field: DisplacementField, degree: int = 4) -> DisplacementSurface:
    """Least squares fit of a field's three directions (Eq. 4.4).

    Coordinates are divided by the largest |x| or |y|: with millimetres the normal matrix spans
    sixteen decades at degree 4 already.

    Raises
    ------
    InputError : fewer points than coefficients, or points that cannot tell them apart.
    """
    count = (degree + 1) ** 2
    where = f"data at {field.pressure * 1e3:g} kPa"
    if len(field.points) < count:
        problem = f"degree {degree} has {count} coefficients, but there are {len(field.points)}"
        raise InputError(None, where, problem + " points; use a lower match.degree")
    scale = float(np.abs(field.points).max())
    terms = _terms(field.points / scale, degree)
    solution, _, rank, _ = np.linalg.lstsq(terms, field.displacement, rcond=None)
    if rank < count:
        problem = f"the points do not determine a surface of degree {degree}; use a lower one"
        raise InputError(None, where, problem)
    left = ((terms @ solution - field.displacement) ** 2).sum(axis=0)
    spread = ((field.displacement - field.displacement.mean(axis=0)) ** 2).sum(axis=0)
    r_squared = 1.0 - left / np.where(spread > 0, spread, 1.0)
    return DisplacementSurface(
        field.pressure, degree, np.asarray(solution.T, dtype=float), scale, r_squared
    )


def write_surfaces(surfaces: Sequence[DisplacementSurface], path: Path) -> None:
    """CSV, a row a pressure and direction: coefficients of (x/scale, y/scale), C0 first."""
    rows = [
        {
            "pressure_kPa": surface.pressure * 1e3,
            "direction": direction,
            "degree": surface.degree,
            "scale_mm": surface.scale,
            "r_squared": surface.r_squared[i],
            **{f"C{k}": c for k, c in enumerate(surface.coefficients[i])},
        }
        for surface in surfaces
        for i, direction in enumerate(DIRECTIONS)
    ]
    pd.DataFrame(rows).to_csv(path, index=False, float_format="%.17g")


def read_surfaces(path: Path) -> tuple[DisplacementSurface, ...]:
    """What `write_surfaces` wrote.

    Raises
    ------
    InputError : not such a file.
    """
    try:
        table = pd.read_csv(path)
        surfaces = []
        for start in range(0, len(table), 3):
            part = table.iloc[start : start + 3]
            degree = int(part["degree"].iloc[0])
            names = [f"C{k}" for k in range((degree + 1) ** 2)]
            surfaces.append(
                DisplacementSurface(
                    float(part["pressure_kPa"].iloc[0]) * 1e-3,
                    degree,
                    part[names].to_numpy(dtype=float),
                    float(part["scale_mm"].iloc[0]),
                    part["r_squared"].to_numpy(dtype=float),
                )
            )
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, IndexError, pd.errors.ParserError) as error:
        raise InputError(path, "", f"is not a file of surfaces: {error}") from None
    return tuple(surfaces)
