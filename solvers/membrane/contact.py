"""Frictionless contact of a membrane with rigid cylinders and rings by a penalty method."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.cylinder_model import RigidCylinder
from ...meshes.mesh import Array


def gaps(body: RigidCylinder, position: Array) -> tuple[Array, Array, Array]:
    """Return the distance of points from the surface of a rigid body, with its derivatives.

    In the rounded mouth of a ring, the distance is that from the circle on which the centres of the
    fillet lie, less the fillet's radius.

    Parameters
    ----------
    body : RigidCylinder
    position : (n, 3) array, mm

    Returns
    -------
    (n,) array, mm
        The distance, negative inside the body.
    (n, 3) array, (n, 3, 3) array
        Its gradient, and its Hessian in 1/mm.
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
    into_mouth = np.abs(along) - (0.5 * body.length - body.fillet)
    in_mouth = into_mouth > 0
    s = np.where(in_mouth, into_mouth, 0.0)
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
    """Return the contact forces of a rigid body on the nodes, and their stiffness.

    Parameters
    ----------
    body : RigidCylinder
    position : (n, 3) array, mm
    stiffness : (n,) array, N/mm
        The penalty times the share of the reference surface that belongs to each node.

    Returns
    -------
    (n, 3) array, N
        Forces on the nodes.
    (t, 3, 3) array, N/mm
        Minus the derivative of the forces by the positions of the nodes in contact.
    (t,) array of int
        Numbers of the nodes in contact.
    """
    within_reach = _within_reach(body, position)
    gap, out, hessian = gaps(body, position[within_reach])
    penetrates = gap < 0
    touched = within_reach[penetrates]
    k = stiffness[touched]
    g = gap[penetrates]
    n = out[penetrates]
    force = np.zeros_like(position)
    force[touched] = -(k * g)[:, None] * n
    slope = np.einsum("ni,nj->nij", n, n) + g[:, None, None] * hessian[penetrates]
    return force, k[:, None, None] * slope, touched


def _within_reach(body: RigidCylinder, position: Array) -> NDArray[np.intp]:
    """Return the numbers of nodes, of positions (n, 3) mm, that a rigid body may touch."""
    arm = position - np.asarray(body.centre, dtype=float)
    along = arm @ np.asarray(body.axis, dtype=float)
    square = np.einsum("ni,ni->n", arm, arm) - along**2
    if body.ring:
        # The mouth opens from the inner radius outwards.
        return np.flatnonzero((square > body.radius**2) & (np.abs(along) < 0.5 * body.length))
    return np.flatnonzero(square < body.radius**2)


def brought_to_touch(
    body: RigidCylinder,
    position: Array,
    direction: Array,
    bite: float,
) -> RigidCylinder:
    """Return a rigid body moved along a direction until it touches the surface.

    Parameters
    ----------
    body : RigidCylinder
    position : (n, 3) array, mm
        Of the surface's nodes.
    direction : (3,) array
        Unit vector, normal to the axis of the body.
    bite : float, mm
        Depth by which the deepest node shall penetrate the body.

    Returns
    -------
    RigidCylinder

    Raises
    ------
    InputError
        If no node lies where the body could touch it.
    """
    centre = np.asarray(body.centre, dtype=float)
    axis = np.asarray(body.axis, dtype=float)
    arm = position - centre
    if body.ring:
        is_within_reach = np.abs(arm @ axis) < 0.5 * body.length
    else:
        is_within_reach = np.abs(arm @ np.cross(axis, direction)) < body.radius
    if not is_within_reach.any():
        problem = f"no node of the mesh lies where {body.name!r} could touch; refine it there"
        raise InputError(None, "mesh", problem)
    nodes = position[is_within_reach]
    heights = arm[is_within_reach] @ direction
    low = float(heights.min()) - 2 * body.radius
    high = float(heights.max()) + 2 * body.radius
    # Search the first touch from outside; a ring starts around the membrane's middle.
    if body.ring:
        low = 0.5 * float(heights.min() + heights.max())

    tolerance = 1e-11  # mm; derivatives by differences have steps of 1e-5
    travels_at_once = 60
    while high - low > tolerance:
        travels = np.linspace(low, high, travels_at_once)
        # The nodes move instead of the body.
        shifted = nodes - travels[:, None, None] * direction
        gap, _, _ = gaps(body, shifted.reshape(-1, 3))
        smallest_gaps = gap.reshape(len(travels), -1).min(axis=1)
        first = int(np.argmax(smallest_gaps < -bite))
        low = float(travels[max(first - 1, 0)])
        high = float(travels[first])
    return replace(body, centre=tuple((centre + low * direction).tolist()))
