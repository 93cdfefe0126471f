"""Frictionless contact of nodes with analytic rigid cylinders, by penalty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.inflated import RigidCylinder

Array = NDArray[np.float64]

#: mm to which the first touch is found, and places looked at at once on the way to it.
TOUCH, WAYS = 1e-9, 500


def gaps(body: RigidCylinder, position: Array) -> tuple[Array, Array, Array]:
    """Distance (n,) mm of points (n, 3) from a body, its gradient (n, 3) and Hessian (n, 3, 3).

    Negative inside the body. A ring's mouth is rounded by its fillet: there the distance is that
    from the circle through the fillet's centre, less its radius.
    """
    axis = np.asarray(body.axis, dtype=float)
    arm = position - np.asarray(body.centre, dtype=float)
    along = arm @ axis
    across = arm - along[:, None] * axis
    r = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    radial = across / r[:, None]
    around = np.cross(axis, radial)
    turn = np.einsum("ni,nj->nij", around, around) / r[:, None, None]
    if not body.ring:
        return r - body.radius, radial, turn
    beyond = np.abs(along) - (0.5 * body.length - body.fillet)
    in_mouth = beyond > 0
    s = np.where(in_mouth, beyond, 0.0)
    q = body.radius + body.fillet - r
    d = np.where(in_mouth, np.hypot(q, s), q)
    d = np.where(np.abs(d) > 1e-9, d, 1e-9)
    out = -(q / d)[:, None] * radial + (s / d * np.sign(along))[:, None] * axis
    side = (s / d)[:, None] * radial + (q / d * np.sign(along))[:, None] * axis
    curve = np.where(in_mouth, 1.0 / d, 0.0)
    hessian = curve[:, None, None] * np.einsum("ni,nj->nij", side, side)
    return d - body.fillet, out, hessian - (q / d)[:, None, None] * turn


def contact_forces(
    body: RigidCylinder, position: Array, stiffness: Array
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Forces (n, 3) N on the nodes, minus their derivative (touched, 3, 3), and which touch.

    stiffness (n,) N/mm: penalty times the node's share of the reference surface.
    """
    near = _within_reach(body, position)
    gap, out, hessian = gaps(body, position[near])
    inside = gap < 0
    touched = near[inside]
    k, g, n = stiffness[touched], gap[inside], out[inside]
    force = np.zeros_like(position)
    force[touched] = -(k * g)[:, None] * n
    slope = np.einsum("ni,nj->nij", n, n) + g[:, None, None] * hessian[inside]
    return force, k[:, None, None] * slope, touched


def _within_reach(body: RigidCylinder, position: Array) -> NDArray[np.intp]:
    """The few nodes that may be inside the body: all that are, without their distances."""
    arm = position - np.asarray(body.centre, dtype=float)
    along = arm @ np.asarray(body.axis, dtype=float)
    square = np.einsum("ni,ni->n", arm, arm) - along**2
    if body.ring:
        # The mouth opens from the inner radius outwards.
        return np.flatnonzero((square > body.radius**2) & (np.abs(along) < 0.5 * body.length))
    return np.flatnonzero(square < body.radius**2)


def brought_to_touch(
    body: RigidCylinder, position: Array, direction: Array, bite: float
) -> RigidCylinder:
    """The body moved along `direction` until it is `bite` (mm) into the surface.

    Raises
    ------
    InputError : no node lies on its way.
    """
    centre, axis = np.asarray(body.centre, dtype=float), np.asarray(body.axis, dtype=float)
    arm = position - centre
    if body.ring:
        near = np.abs(arm @ axis) < 0.5 * body.length
    else:
        near = np.abs(arm @ np.cross(axis, direction)) < body.radius
    if not near.any():
        problem = f"no node of the mesh lies where {body.name!r} could touch; refine it there"
        raise InputError(None, "mesh", problem)
    nodes, heights = position[near], arm[near] @ direction
    low, high = float(heights.min()) - 2 * body.radius, float(heights.max()) + 2 * body.radius
    # The first touch from outside is the one wanted; a ring starts around the membrane's middle.
    if body.ring:
        low = 0.5 * float(heights.min() + heights.max())

    def least(ways: Array) -> Array:
        """Smallest gap with the body moved by each of them: the nodes move the other way."""
        shifted = nodes - ways[:, None, None] * direction
        return gaps(body, shifted.reshape(-1, 3))[0].reshape(len(ways), -1).min(axis=1)

    while high - low > TOUCH:
        ways = np.linspace(low, high, WAYS)
        first = int(np.argmax(least(ways) < -bite))
        low, high = float(ways[max(first - 1, 0)]), float(ways[first])
    return replace(body, centre=tuple((centre + low * direction).tolist()))
