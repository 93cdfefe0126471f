"""Directions about the rim's centre: points on all sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def in_all_quarters(points: NDArray[np.float64]) -> bool:
    """Whether points (n, 2 or 3) about the centre lie in all four quarters of its plane."""
    return len(np.unique(points[:, :2] > 0, axis=0)) == 4
