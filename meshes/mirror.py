"""Meshes completed by their mirror image in a plane of symmetry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


def snapped(points: Array, near: float) -> Array:
    """Points (n, k) with coordinates within `near` of zero exactly zero: cos(pi/2) is not."""
    return np.where(np.abs(points) < near, 0.0, points)


def with_mirror_image(points: Array, quads: Numbers, axis: int) -> tuple[Array, Numbers, Numbers]:
    """The mesh and its image in the plane where coordinate `axis` is exactly zero, sewn there.

    Parameters
    ----------
    points : (n, k) mm. quads : (m, 4).

    Returns
    -------
    points (n', k), those given first; quads (2 m, 4), those given first and then their images in
    the same order, wound so that a normal is the image of the normal; and (n',) which of the
    points given each node is or mirrors.
    """
    off = points[:, axis] != 0
    image = np.arange(len(points))
    image[off] = len(points) + np.arange(np.count_nonzero(off))
    sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
    # A mirror turns quads round: read them backwards to keep the side that faces out.
    turned = image[quads[:, ::-1]]
    source = np.concatenate([np.arange(len(points)), np.flatnonzero(off)])
    return np.concatenate([points, points[off] * sign]), np.concatenate([quads, turned]), source
