"""Tensor polynomials in two variables, terms in the order of the thesis' Eq. 4.4."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def powers(points: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Terms (n, (degree + 1)^2) of Eq. 4.4 at points (n, 2): x^d y^d first, the constant last."""
    x = np.vander(points[:, 0], degree + 1)
    y = np.vander(points[:, 1], degree + 1)
    return (y[:, :, None] * x[:, None, :]).reshape(len(points), -1)


def total_power(degree: int) -> NDArray[np.intp]:
    """i + j of each term x^i y^j, ((degree + 1)^2,)."""
    falling = np.arange(degree, -1, -1)
    return (falling[:, None] + falling).ravel()
