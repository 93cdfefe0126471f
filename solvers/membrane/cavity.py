"""The volume a membrane encloses, and the gas in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...caching import compiled
from ...errors import InputError
from ...materials.point_law import FAST
from .element import ReferenceElements
from .kernel import base_vectors

Array = NDArray[np.float64]


@compiled(fastmath=FAST)
def enclosed(position, quads, values, slopes, area, weight, origin, push):  # type: ignore[no-untyped-def]
    """Divergence theorem: V = sum_k weight_k int (x_k - origin_k) n_k dA, weights adding to one.

    Writes push (3 n,) = int N n dA: the nodal forces of a unit pressure, which are dV/dx where the
    surface is closed. Two by two Gauss points are exact for a bilinear facet.
    """
    push[:] = 0.0
    volume = 0.0
    x, f, normal = np.empty((4, 3)), np.empty((2, 3)), np.empty(3)
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = position[quads[e, n], k]
        for g in range(4):
            base_vectors(x, slopes[e, g], f)
            normal[0] = area[e, g] * (f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1])
            normal[1] = area[e, g] * (f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2])
            normal[2] = area[e, g] * (f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0])
            for k in range(3):
                at = -origin[k]
                for n in range(4):
                    at += values[g, n] * x[n, k]
                    push[3 * quads[e, n] + k] += values[g, n] * normal[k]
                volume += weight[k] * at * normal[k]
    return volume


@dataclass(frozen=True, eq=False)
class Cavity:
    """A closed surface, or the part of one that symmetry planes close.

    weight, origin (3,): see `enclosed`. A plane x_k = origin_k adds nothing to direction k, and
    nothing to any other because its normal is along k; where two planes share a direction (a
    slice of a long tube) that direction gets no weight. symmetric (3,): directions with a plane.
    """

    quads: NDArray[np.intp]
    elements: ReferenceElements
    weight: Array
    origin: Array
    symmetric: NDArray[np.bool_]

    def measure(self, position: Array) -> tuple[float, Array]:
        """Volume (mm^3) of the meshed part at `position` (n, 3), and its derivative (3 n,) mm^2."""
        push, e = np.empty(position.size), self.elements
        volume = enclosed(
            position, self.quads, e.values, e.slopes, e.area, self.weight, self.origin, push
        )
        return float(volume), push


def closed_cavity(
    points: Array, quads: NDArray[np.intp], elements: ReferenceElements, fixed: NDArray[np.intp]
) -> Cavity:
    """Find the symmetry planes that close the surface.

    Parameters
    ----------
    fixed : held unknowns, 3 * node + direction.

    Raises
    ------
    InputError : an open edge that lies in no plane that its nodes are held in.
    """
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    border = edges[count == 1]
    held = np.zeros(points.shape, dtype=bool)
    held.reshape(-1)[fixed] = True
    size = float(np.ptp(points, axis=0).max())
    level = np.abs(points[border[:, 0]] - points[border[:, 1]]) < 1e-9 * size
    in_plane = held[border].all(axis=1) & level  # (edges, 3)
    if not in_plane.any(axis=1).all():
        first, second = border[int(np.argmin(in_plane.any(axis=1)))]
        raise InputError(
            None, "mesh", f"the cavity is open between nodes {first} and {second}: close it, "
            "or hold the edge normal to a symmetry plane",
        )  # fmt: skip
    weight, origin = np.ones(3), points.mean(axis=0)
    for k in range(3):
        at = points[border[in_plane[:, k], 0], k]
        if len(at):
            origin[k] = at[0]
            weight[k] = float(np.ptp(at) < 1e-9 * size)
    if not weight.any():
        raise InputError(None, "mesh", "the cavity is closed by planes on all six sides")
    return Cavity(quads, elements, weight / weight.sum(), origin, in_plane.any(axis=0))


@dataclass(frozen=True)
class Gas:
    """A constant mass of ideal gas at constant temperature: absolute pressure x volume is fixed.

    amount : MPa mm^3 in the meshed part of the cavity. atmosphere : MPa outside.
    """

    amount: float
    atmosphere: float

    def pressure(self, volume: float) -> float:
        """Gauge pressure (MPa) in `volume` (mm^3)."""
        return self.amount / volume - self.atmosphere

    def stiffness(self, volume: float) -> float:
        """Loss of pressure per volume, -dp/dV (MPa/mm^3)."""
        return self.amount / volume**2
