"""Smooth shapes of a surface over a disk that vanish at its rim: (1 - r^2) times monomials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def monomials(count: int) -> list[tuple[int, int]]:
    """Powers (of x, of y) of the first `count` monomials: 1; x, y; x^2, xy, y^2; x^3 ..."""
    powers: list[tuple[int, int]] = []
    degree = 0
    while len(powers) < count:
        powers += [(a, degree - a) for a in range(degree, -1, -1)]
        degree += 1
    return powers[:count]


def disk_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """The first `count` modes at points (n, 2) mm, (n,) each, by name: z0_1, z0_x, z0_y, z0_xx ...

    A mode is (1 - r^2) x^a y^b with all lengths over the radius (mm), so that z0_1 is the height
    of a paraboloid at the centre. z0_1, z0_xx, z0_yy, z0_xxxx ... are doubly symmetric; the others
    are not.
    """
    x, y = points[:, 0] / radius, points[:, 1] / radius
    dome = 1.0 - x**2 - y**2
    return {
        f"z0_{'x' * a}{'y' * b}" if a + b else "z0_1": dome * x**a * y**b
        for a, b in monomials(count)
    }


def doubly_symmetric(count: int) -> bool:
    """Whether the first `count` modes are all even in x and in y."""
    return all(a % 2 == 0 and b % 2 == 0 for a, b in monomials(count))
