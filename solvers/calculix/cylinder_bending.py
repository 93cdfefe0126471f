"""Bending the inflated cylinder on CalculiX: rigid bodies, contact, the way of the collar.

Total time of the step is the collar's way in mm (`REST` later), in increments as contact allows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.cylinder import CylinderModel
from .. import rigid
from .cylinder_gas import GasCurve
from .solids import SolidMesh

Array = NDArray[np.float64]

#: MPa/mm, as the membrane solver's; what others give: docs/how-to/calculix.md, *Contact*.
STIFFNESS = 5.0
#: CalculiX' own, and more than enough: the load is a sum over many nodes.
TOLERANCES = (5e-3, 1e-2)
#: mm that the support begins inside the cylinder, so that it touches, and that the collar begins
#: above the inflated cylinder, so that it does not.
INTO, ABOVE = 0.02, 0.5
#: Quads that may touch: mm to either side of a support and beyond the collar's edge, and how low
#: or high they lie, in radii.
BESIDE_SUPPORT, BESIDE_COLLAR, LOW, HIGH = 80.0, 60.0, -0.35, 0.1
#: Time that the collar stands still, and of the first increment, which must end before it moves.
REST, FIRST = 1.5, 1.0
#: mm of the collar's way: longest increment (its effect: docs/how-to/calculix.md), and the one
#: at which contact is given up.
LONGEST, LEAST = 5.0, 1e-4


def bending_context(
    model: CylinderModel, solids: SolidMesh, inflated: Array, gas: GasCurve | None = None
) -> dict[str, Any]:
    """What the template is given for step 2.

    Parameters
    ----------
    inflated : (nodes of the solids, 3) mm of displacement of the inflated cylinder.
    gas : gauge pressure over deflection; that of inflation unless given.

    Raises
    ------
    InputError : a whole cylinder, whose bodies this does not make.
    """
    if model.copies != 4:
        raise InputError(None, "symmetry", "CalculiX bends a quarter; mesh it as 'quarter'")
    radius = float(np.abs(model.mesh.points[:, 1]).max())
    at, under = solids.points + inflated, solids.node_sets["support_bottom"]
    bodies = {
        "SUPPORT_BODY": rigid.support_body(
            model.supports, radius, float(at[under, 1].min()) + INTO
        ),
        "COLLAR_BODY": rigid.collar_body(model.collar, at, ABOVE),
    }
    may_touch = _may_touch(model, radius)
    listed, node, element = [], len(solids.points), len(solids.elements)
    for name, body in bodies.items():
        listed.append(
            {
                "name": name,
                "points": body.points.tolist(),
                "elements": (body.elements + 1 + node).tolist(),
                "first_node": node,
                "first_element": element,
                "fabric": (solids.element_sets["outside"][may_touch[name]] + 1).tolist(),
            }
        )
        node, element = node + len(body.points), element + len(body.elements)
    way = ABOVE + model.deflections[-1]
    gas = gas or GasCurve(np.zeros(1), np.full(1, model.pressure))
    pressures = [(0.0, model.pressure), (REST + ABOVE, model.pressure)]
    for deflection, pressure in zip(gas.deflection, gas.pressure, strict=True):
        if deflection > 0:  # before, the collar is not on the cylinder
            pressures.append((REST + ABOVE + float(deflection), float(pressure)))
    return {
        "bodies": listed,
        "stiffness": STIFFNESS,
        "path": [[0.0, 0.0], [REST, 0.0], [REST + way, way]],
        "pressures": pressures,
        "first": FIRST,
        "least": LEAST,
        "longest": min(LONGEST, float(np.diff(model.increments, prepend=0.0).max())),
        "duration": REST + way,
        "force_tolerance": TOLERANCES[0],
        "correction_tolerance": TOLERANCES[1],
    }


def body_nodes(solids: int) -> tuple[slice, slice]:
    """Nodes of the support and of the collar in a result, after those of the `solids` (count)."""
    around, across = rigid.SUPPORT_COUNTS
    support = 2 * (around + 1) * (across + 1)
    return slice(solids, solids + support), slice(solids + support, None)


def _may_touch(model: CylinderModel, radius: float) -> dict[str, NDArray[np.bool_]]:
    """Which quads may meet which body, so that contact is not looked for everywhere."""
    mesh = model.mesh
    middle = mesh.points[mesh.quads].mean(axis=1)
    beside = np.abs(middle[:, 2] - 0.5 * model.supports.span) < BESIDE_SUPPORT
    tube = ~np.isin(np.arange(len(middle)), mesh.element_sets["caps"])
    under = middle[:, 2] < 0.5 * model.collar.length + BESIDE_COLLAR
    return {
        "SUPPORT_BODY": tube & beside & (middle[:, 1] < LOW * radius),
        "COLLAR_BODY": tube & under & (middle[:, 1] > HIGH * radius),
    }
