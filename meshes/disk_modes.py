"""Shapes of a sheet and strains of its metric, as modes over the disk."""

import numpy as np

from .mesh import Array


def monomials(count: int) -> list[tuple[int, int]]:
    """Return powers (of x, of y) of the first `count` monomials: 1; x, y; x^2, xy, y^2; x^3 ..."""
    powers: list[tuple[int, int]] = []
    degree = 0
    while len(powers) < count:
        powers += [(a, degree - a) for a in range(degree, -1, -1)]
        degree += 1
    return powers[:count]


def disk_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return `count` modes (1 - r^2) x^a y^b at points (n, 2) mm over the radius: z0_1, z0_x ..."""
    x = points[:, 0] / radius
    y = points[:, 1] / radius
    dome = 1.0 - x**2 - y**2
    modes = {}
    for a, b in monomials(count):
        powers = "x" * a + "y" * b or "1"
        modes[f"z0_{powers}"] = dome * x**a * y**b
    return modes


#: Components of a strain of the stress-free sheet.
METRIC = ("warp", "fill", "shear")


def metric_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return strains (n, 3) of one component each, times `count` monomials of x and y.

    Parameters
    ----------
    points : (n, 2) array, mm
        Divided by `radius`, mm, in the monomials.

    Returns
    -------
    dict
        By name: metric_warp_1, metric_warp_x ...
    """
    x, y = points.T / radius
    modes = {}
    for component, direction in zip(METRIC, np.eye(3), strict=True):
        for a, b in monomials(count):
            powers = "x" * a + "y" * b or "1"
            modes[f"metric_{component}_{powers}"] = np.outer(x**a * y**b, direction)
    return modes


def doubly_symmetric(count: int) -> bool:
    """Return whether the first `count` modes are all even in x and in y."""
    return all(a % 2 == 0 and b % 2 == 0 for a, b in monomials(count))
