"""Rigid bodies of a deck, given as patches, as the cylinders that their corners lie on."""

from __future__ import annotations

import numpy as np
from bubblefit.meshes.cylinder_model import RigidCylinder
from numpy.typing import NDArray

from .content import Body
from .fields import DeckError

Array = NDArray[np.float64]
#: mm that a corner may be away from the circle through all of them.
ROUND = 1e-6


def support_of(body: Body) -> RigidCylinder:
    """A post along x: all corners on one circle, patches facing away from its axis."""
    corners = _corners(body)
    centre, radius = _circle(corners[:, 1:], body)
    _facing(body, np.array([0.0, *centre]), 0, outwards=True)
    return RigidCylinder(body.name, (1.0, 0.0, 0.0), (0.0, *centre), radius)


def collar_of(body: Body) -> RigidCylinder:
    """A ring along z: its inner cylinder, and a mouth on a circle in the planes through the axis.

    What is there has to be a part of the ring that is alike on both sides of z = 0.
    """
    corners = _corners(body)
    rows = np.unique(np.round(corners[:, 2], 6))
    circles = [_circle(corners[np.abs(corners[:, 2] - z) < 1e-5, :2], body) for z in rows]
    centre = circles[0][0]
    if any(np.abs(c - centre).max() > ROUND for c, _ in circles):
        raise DeckError(f"body {body.name}: rows of its patches have several axes")
    radii = np.array([radius for _, radius in circles])
    radius = float(radii.min())
    mouth = radii > radius + 1e-4
    edge = rows[~mouth].max()
    profile = np.column_stack([radii, rows])[rows >= edge - 1e-6]
    if len(profile) < 3:
        raise DeckError(f"body {body.name} has no rounded mouth")
    (_, straight), fillet = _circle(profile, body)
    _facing(body, np.array([*centre, 0.0]), 2, outwards=False)
    place = (float(centre[0]), float(centre[1]), 0.0)
    length = 2.0 * (float(straight) + fillet)
    return RigidCylinder(body.name, (0.0, 0.0, 1.0), place, radius, True, length, fillet)


def first_touch(body: Body, nodes: Array) -> float:
    """mm that the patches of a ring go down until one of `nodes` (n, 3) lies on one of them.

    Straight down from each patch: a node above its plane, and between its ends along z, is met.
    """
    assert body.patches is not None
    found = np.inf
    for patch in body.patches:
        a, b, c = patch[0], patch[1] - patch[0], patch[2] - patch[0]
        normal = np.cross(b, c)
        if abs(normal[1]) < 1e-3 * np.linalg.norm(normal) or a[1] < body.patches[..., 1].mean():
            continue
        inside = (nodes[:, 2] > patch[:, 2].min() - 1e-9) & (nodes[:, 2] < patch[:, 2].max() + 1e-9)
        # Height of the patch's plane over the node.
        x, y, z = (nodes[inside] - a).T
        height = -(normal[0] * x + normal[2] * z) / normal[1] - y
        found = min(found, float(height.min(initial=np.inf)))
    return found


def _corners(body: Body) -> Array:
    if body.patches is None or not len(body.patches):
        raise DeckError(f"body {body.name} has no patches")
    return body.patches.reshape(-1, 3)


def _circle(points: Array, body: Body) -> tuple[Array, float]:
    """Centre (2,) and radius of the circle through all points (n, 2)."""
    middle = points.mean(axis=0)
    arm = points - middle
    rows = np.column_stack([2.0 * arm, np.ones(len(arm))])
    a, b, c = np.linalg.lstsq(rows, (arm**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(c + a * a + b * b))
    if np.abs(np.hypot(arm[:, 0] - a, arm[:, 1] - b) - radius).max() > ROUND:
        raise DeckError(f"body {body.name}: the corners of its patches are on no circle")
    return middle + np.array([a, b]), radius


def _facing(body: Body, centre: Array, axis: int, outwards: bool) -> None:
    """Corners counter-clockwise seen from the fabric: normals point to it."""
    assert body.patches is not None
    normal = np.cross(
        body.patches[:, 2] - body.patches[:, 0], body.patches[:, 3] - body.patches[:, 1]
    )
    arm = body.patches.mean(axis=1) - centre
    arm[:, axis] = 0.0
    side = np.einsum("pk,pk->p", normal, arm) * (1.0 if outwards else -1.0)
    if (side <= 0).any():
        bad = int(np.argmax(side <= 0)) + 1
        raise DeckError(f"body {body.name}: patch {bad} shows the fabric its back")
