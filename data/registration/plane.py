"""The plane of the rim: through reference points, with those far from it left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .placement import Placement

Array = NDArray[np.float64]

#: Points further from the plane than this many robust deviations do not count.
FAR = 4.0
ROUNDS = 20
#: A median absolute deviation of a normal distribution in standard deviations.
MAD = 1.4826


def plane_through(points: Array, up: Array) -> tuple[Placement, float]:
    """The plane through points (n, 3), and their robust deviation from it in mm.

    Its origin is the mean of the points that count, its z the normal on the side of `up` (3,), its
    x the camera's x laid into the plane.

    Raises
    ------
    InputError : fewer than three points, or points on a line.
    """
    points = points[np.isfinite(points).all(axis=1)]
    kept = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):
        if kept.sum() < 3:
            raise InputError(None, "plane", f"expected three points or more, got {kept.sum()}")
        origin = points[kept].mean(axis=0)
        _, spread, axes = np.linalg.svd(points[kept] - origin, full_matrices=False)
        if spread[1] < 1e-6 * spread[0]:
            raise InputError(None, "plane", "expected points across a surface, got a line")
        distance = (points - origin) @ axes[2]
        deviation = MAD * float(np.median(np.abs(distance[kept])))
        now = np.abs(distance) <= max(FAR * deviation, 1e-9 * spread[0])
        if (now == kept).all():
            break
        kept = now
    normal = axes[2] * (1.0 if axes[2] @ up >= 0 else -1.0)
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    if np.linalg.norm(x) < 0.1:  # the camera looks along its own x
        x = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
    x /= np.linalg.norm(x)
    return Placement(origin, np.stack([x, np.cross(normal, x), normal])), deviation
