"""Profiles along the warp and fill axes, cut from nodes or measured points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

#: Points that must lie on an axis before they are taken as its profile.
ENOUGH = 5


@dataclass(frozen=True, eq=False)
class Cut:
    """Deformed positions along an axis and heights above the reference plane, (k,) mm each."""

    position: Array
    height: Array


def node_cut(points: ArrayLike, displacement: ArrayLike, axis: int) -> Cut:
    """Profile of a mesh along x (axis 0) or y (axis 1).

    points (n, 2 or 3), displacement (n, 3), mm. Nodes on the axis where there are some, else
    (free meshes) linear interpolation between the nodes beside it.
    """
    xy, u = np.asarray(points, dtype=float)[:, :2], np.asarray(displacement, dtype=float)
    on = _on_axis(xy, axis)
    if on.sum() >= ENOUGH:
        return _sorted(xy[on, axis], u[on], axis)
    along = np.linspace(xy[:, axis].min(), xy[:, axis].max(), 81)
    line = np.zeros((len(along), 2))
    line[:, axis] = along
    between = LinearNDInterpolator(xy, u)(line)
    inside = np.isfinite(between).all(axis=1)
    return _sorted(along[inside], between[inside], axis)


def point_cut(points: ArrayLike, displacement: ArrayLike, axis: int) -> Cut:
    """Measured points on the axis, or else those within half a point distance of it."""
    xy, u = np.asarray(points, dtype=float)[:, :2], np.asarray(displacement, dtype=float)
    on = _on_axis(xy, axis)
    if on.sum() < ENOUGH and len(xy) > 1:
        spacing = float(np.median(cKDTree(xy).query(xy, k=2)[0][:, 1]))
        on = np.abs(xy[:, 1 - axis]) <= 0.51 * spacing
    return _sorted(xy[on, axis], u[on], axis)


def _on_axis(xy: Array, axis: int) -> NDArray[np.bool_]:
    size = float(np.abs(xy).max(initial=0.0))
    return np.asarray(np.abs(xy[:, 1 - axis]) <= 1e-6 * size)


def _sorted(along: Array, displacement: Array, axis: int) -> Cut:
    order = np.argsort(along)
    return Cut((along + displacement[:, axis])[order], displacement[order, 2])
