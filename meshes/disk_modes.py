"""Modes over a disk for the initial height and the stress-free strain of a sheet."""

import numpy as np

from .mesh import Array


def monomials(count: int) -> list[tuple[int, int]]:
    """Return the powers of x and of y in the first monomials: 1; x, y; x^2, xy, y^2; x^3 ..."""
    powers: list[tuple[int, int]] = []
    degree = 0
    while len(powers) < count:
        powers += [(a, degree - a) for a in range(degree, -1, -1)]
        degree += 1
    return powers[:count]


def disk_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return the first modes (1 - x^2 - y^2) x^a y^b of the initial height at points, by name.

    points : (n, 2) mm, which are divided by `radius` (mm). Names are z0_1, z0_x ... for the powers
    a and b.
    """
    x = points[:, 0] / radius
    y = points[:, 1] / radius
    dome = 1.0 - x**2 - y**2
    modes = {}
    for a, b in monomials(count):
        powers = "x" * a + "y" * b or "1"
        modes[f"z0_{powers}"] = dome * x**a * y**b
    return modes


#: Names of the components of the strain of a stress-free sheet.
METRIC = ("warp", "fill", "shear")


def metric_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return modes (n, 3) of the stress-free strain: one component times a monomial of x and y.

    Parameters
    ----------
    points : (n, 2) array, mm
        Their coordinates are divided by `radius`, mm, in the monomials.
    count : int
        Number of monomials for each component.

    Returns
    -------
    dict
        Modes by name: metric_warp_1, metric_warp_x ...
    """
    x, y = points.T / radius
    modes = {}
    for component, direction in zip(METRIC, np.eye(3), strict=True):
        for a, b in monomials(count):
            powers = "x" * a + "y" * b or "1"
            modes[f"metric_{component}_{powers}"] = np.outer(x**a * y**b, direction)
    return modes


def doubly_symmetric(count: int) -> bool:
    """Return whether the first `count` monomials are all even in x and in y, as a quarter needs."""
    return all(a % 2 == 0 and b % 2 == 0 for a, b in monomials(count))
