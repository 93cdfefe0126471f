"""Directions about the rim's centre: angles that repeat, points on all sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def line_angle(degrees: float) -> float:
    """The angle of a line, which repeats after 180 degrees: from -90 to below 90."""
    return (degrees + 90.0) % 180.0 - 90.0


def axes_angle(degrees: float) -> float:
    """The angle of two axes at right angles, which repeats after 90: from -45 to below 45."""
    return (degrees + 45.0) % 90.0 - 45.0


def in_all_quarters(points: NDArray[np.float64]) -> bool:
    """Whether points (n, 2 or 3) about the centre lie in all four quarters of its plane."""
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4
