"""Supports and collar as rigid surfaces of four-point patches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.cylinder import CylinderModel
from ..rigid import RigidBody, collar_body, support_body

Array = NDArray[np.float64]

#: mm that the support reaches into the inflated cylinder, so that it touches; that the collar
#: begins above it, so that it does not; and that the support waits below while it is inflated.
INTO, ABOVE, BELOW = 0.02, 0.5, 50.0
SUPPORT_PATH, COLLAR_PATH = 2, 3
UP = [0.0, 1.0, 0.0]


def contact_bodies(model: CylinderModel, inflated: Array) -> list[dict[str, Any]]:
    """Support, then collar: name, table of the path, patches (n, 12) towards the cylinder.

    Parameters
    ----------
    inflated : (nodes, 3) mm of displacement of the inflated cylinder.

    Raises
    ------
    InputError : a whole cylinder, whose bodies this does not make.
    """
    if model.copies != 4:
        problem = "Marc's deck bends a quarter; mesh it as 'quarter'"
        raise InputError(None, "symmetry", problem)
    mesh = model.mesh
    at = mesh.points + inflated
    top, under = mesh.node_sets["top_line"], mesh.node_sets["support_bottom"]
    # A slice of the cylinder as long as half the collar may touch it.
    near = top[mesh.points[top, 2] <= 0.5 * model.collar.length]
    radius = float(np.abs(mesh.points[:, 1]).max())
    support = support_body(model.supports, radius, float(at[under, 1].min()) + INTO)
    collar = _faces(collar_body(model.collar, float(at[near, 1].max()) + ABOVE))
    # Flat patches are chords of the ring, and meet the cylinder earlier than that would.
    collar[..., 1] += ABOVE - way_down(collar, at)
    return [
        {"name": name, "path": path, "direction": UP, "patches": faces.reshape(-1, 12).tolist()}
        for name, path, faces in (
            ("support", SUPPORT_PATH, _faces(support)),
            ("collar", COLLAR_PATH, collar),
        )
    ]


def way_down(faces: Array, points: Array) -> float:
    """How far (mm) a ring of flat faces around the z axis goes down until it meets a point.

    Parameters
    ----------
    faces : (n, 4, 3) mm, corners counter-clockwise seen from inside. points : (m, 3) mm, inside.
    """
    normal = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    least = np.inf
    for face, n in zip(faces, normal, strict=True):
        beside = (points[:, 2] >= face[:, 2].min()) & (points[:, 2] <= face[:, 2].max())
        # Across its axis the ring is convex: who passes no face's plane is inside.
        if n[1] < 0.0 and beside.any():
            least = min(least, float(((points[beside] - face.mean(axis=0)) @ n).min() / -n[1]))
    return least


def paths(inflation: int, deflections: Sequence[float]) -> tuple[list[float], list[float]]:
    """Heights (mm) of support and collar over their places, at times 0, 1, 2, ...

    inflation : increments of it; one more brings the support up, then the collar goes down.
    """
    bent = len(deflections)
    support = [-BELOW] * (inflation + 1) + [0.0] * (1 + bent)
    collar = [0.0] * (inflation + 2) + [-(ABOVE + d) for d in deflections]
    return support, collar


def _faces(body: RigidBody) -> Array:
    # The last four nodes of each of its solids are the face that meets the cylinder.
    return np.asarray(body.points[body.elements[:, 4:]], dtype=float)
