"""The closed membrane of a model: what does not change during an analysis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.inflated import InflatedModel
from .bordered import BorderedTangent
from .cavity import closed_cavity
from .closed import ClosedMembrane
from .element import reference_elements
from .factorisation import tangent_for
from .flexure import flexure_of
from .wall import STIFF, Wall


def prepare(
    model: InflatedModel, law: HypoelasticLaw, tolerance: float, wall: Wall | None
) -> ClosedMembrane:
    """What does not change from one law to the next; a stiff wall unless asked otherwise."""
    return closed_membrane(model, law, tolerance, model.fixed(), wall or STIFF)


def closed_membrane(
    model: InflatedModel,
    law: HypoelasticLaw,
    tolerance: float,
    fixed: NDArray[np.intp],
    wall: Wall,
) -> ClosedMembrane:
    """The membrane of a model with these unknowns held."""
    points = np.array(model.mesh.points, dtype=float)
    quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
    warp = np.broadcast_to(np.asarray(model.warp, dtype=float), (len(quads), 3))
    elements = reference_elements(points, quads, warp)
    free = np.setdiff1d(np.arange(points.size), fixed)
    cavity = closed_cavity(points, quads, fixed)
    thickness = np.asarray(model.thickness, dtype=float)
    flexure, coupled = None, quads
    if model.bending is not None and wall.bending_stiffness > 0:
        flexure = flexure_of(points, quads, warp, thickness, cavity.planes)
        flexure = replace(flexure, shares=wall.bending_stiffness * flexure.shares)
        before, node, after = flexure.nodes.T
        coupled = np.concatenate([quads, np.stack([before, node, after, node], axis=1)])
    tangent = tangent_for(coupled, points.size, free, points)
    tangent.slot, line_slot = tangent.slot[: len(quads)], tangent.slot[len(quads) :]
    return ClosedMembrane(
        points,
        quads,
        elements,
        thickness,
        law,
        free,
        BorderedTangent(tangent),
        tolerance,
        # A slack step much larger than a facet folds the mesh.
        step_limit=0.5 * float(np.sqrt(np.median(elements.area.sum(axis=1)))),
        wall=wall,
        cavity=cavity,
        flexure=flexure,
        line_slot=line_slot,
    )
