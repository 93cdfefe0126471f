"""The inflated cylinder in three-point bending as a closed membrane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from ...models.inflated import Bending, InflatedModel, RigidCylinder
from ..base import History
from . import closed_model, inflated
from .closed import ClosedMembrane
from .march import Asked
from .wall import TENSION_FIELD, Wall

Array = NDArray[np.float64]


def prepare(
    model: CylinderModel, law: HypoelasticLaw, tolerance: float, wall: Wall | None
) -> ClosedMembrane:
    """What does not change from one law to the next; a tension field unless asked otherwise."""
    return closed_model.prepare(closed_membrane_of(model), law, tolerance, wall or TENSION_FIELD)


def analyse(membrane: ClosedMembrane, model: CylinderModel, asked: Asked) -> tuple[History, Array]:
    """As `inflated.analyse`."""
    return inflated.analyse(membrane, closed_membrane_of(model), asked)


def closed_membrane_of(model: CylinderModel) -> InflatedModel:
    """The cylinder with its posts and ring; whatever is held, reported and closed in stays.

    A quarter has the support at z = span / 2 and half of the ring, as its planes of symmetry have
    it; the whole cylinder has both supports, whose forces are reported as one.
    """
    half, radius = 0.5 * model.supports.span, 0.5 * model.supports.diameter
    sides = (1,) if "symmetry_z" in model.mesh.node_sets else (1, -1)
    size = model.collar
    across, along, middle = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    bending = Bending(
        [RigidCylinder("supports", across, (0.0, 0.0, side * half), radius) for side in sides],
        RigidCylinder(
            "collar", along, middle, 0.5 * size.inner_diameter, True, size.length, size.fillet
        ),
        model.increments,
        released="support_bottom",
        gas=model.gas,
        reported=model.reported.tolist(),
    )
    return InflatedModel(
        model.mesh,
        model.thickness,
        np.asarray(model.mesh.warp),
        model.inflation,
        {**model.guides, "support_bottom": (1,)},
        model.copies,
        bending,
    )
