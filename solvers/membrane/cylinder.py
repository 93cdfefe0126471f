"""Analysis of an inflated cylinder that a ring bends between two posts, as a closed membrane."""

import numpy as np

from ...materials.law import HypoelasticLaw
from ...meshes.cylinder_model import (
    Bending,
    Collar,
    CylinderModel,
    InflatedModel,
    RigidCylinder,
)
from ...meshes.mesh import Array
from ..base import History
from . import closed
from .closed import ClosedMembrane
from .inflation import analyse_inflated
from .loading import RunRequest
from .wall import TENSION_FIELD, Wall


def prepare(
    model: CylinderModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall | None,
) -> ClosedMembrane:
    """Build the closed membrane of a cylinder.

    Parameters
    ----------
    tolerance : float
        See `Membrane`.
    wall : Wall or None
        A tension field if it is None.
    """
    return closed.prepare(closed_membrane_of(model), law, tolerance, wall or TENSION_FIELD)


def analyse_cylinder(
    membrane: ClosedMembrane, model: CylinderModel, request: RunRequest
) -> tuple[History, Array]:
    """Inflate and bend a cylinder; see `analyse_inflated` for what is returned and raised."""
    return analyse_inflated(membrane, closed_membrane_of(model), request)


def closed_membrane_of(model: CylinderModel) -> InflatedModel:
    """Return the general model of an inflated membrane that describes a cylinder.

    It places the posts, the sum of whose forces is reported as "supports", and the ring ("collar");
    on a quarter of a cylinder only the post at z > 0.
    """
    sides = (1,) if "symmetry_z" in model.mesh.node_sets else (1, -1)
    supports = model.supports
    collar = model.collar
    posts = []
    for side in sides:
        z = side * 0.5 * supports.span
        if supports.saddle is None:
            radius = 0.5 * supports.diameter
            post = RigidCylinder("supports", (1.0, 0.0, 0.0), (0.0, 0.0, z), radius)
        else:
            post = _ring("supports", supports.saddle, z)
        posts.append(post)
    positions = [0.0]
    if collar.spacing:
        positions = [side * 0.5 * collar.spacing for side in sides]
    bending = Bending(
        posts,
        [_ring("collar", collar, z) for z in positions],
        model.increments,
        released="support_bottom",
        gas=model.gas,
        reported=model.reported.tolist(),
        weight=model.weight,
    )
    return InflatedModel(
        model.mesh,
        model.thickness,
        np.asarray(model.mesh.warp),
        model.inflation,
        {**model.guides, "support_bottom": (1,)},
        model.copies,
        bending,
        model.cords,
    )


def _ring(name: str, size: Collar, z: float) -> RigidCylinder:
    """Return a rigid ring around the tube, centred at z (mm) on its axis."""
    centre = (0.0, 0.0, z)
    radius = 0.5 * size.inner_diameter
    return RigidCylinder(
        name,
        (0.0, 0.0, 1.0),
        centre,
        radius,
        True,
        size.length,
        size.fillet,
    )
