"""The inflated cylinder as a CalculiX deck: what its templates are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...files import __version__
from ...materials.law import HypoelasticLaw
from ...meshes.cylinder_model import SEAM_LAYERS, ClosedGas, CylinderModel
from .. import rigid
from ..decks import render
from .deck import MESH_FILE
from .library import MATERIAL, STATE_VARIABLES, constants

# The cylinder as one layer of solids, and on the seam another, twice as thick, outside.
#
# The seam's layers all lie outside because the gas must meet a surface without steps: on the faces
# of a step inside, unloaded, the pressure would be out of balance by enough to bend the cylinder.
#
# Shells will not do: where they meet at an angle, at the edge of a cap, CalculiX ties rotations
# together, and Newton's method stalls as soon as contact comes in.

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Solids of eight nodes, inner face first, numbered from 0.

    points (n, 3) mm; elements (m, 8), quad by quad the layer that the gas touches, then the seam's;
    inner, outer: (nodes of the surface mesh,) the two nodes of that layer that stand for each of
    its nodes, their mean being where it is; element sets `tube` and `caps` (by material), `inside`
    (their inner faces hold the gas) and `outside` (quad by quad, their outer faces are the
    cylinder's); node sets as the surface mesh has them, through all layers.
    """

    points: Array
    elements: Numbers
    inner: Numbers
    outer: Numbers
    element_sets: Mapping[str, Numbers]
    node_sets: Mapping[str, Numbers]

    def middle(self, values: Array) -> Array:
        """Values (..., nodes of the surface mesh, k) on the middle surface from nodal ones."""
        return np.asarray(0.5 * (values[..., self.inner, :] + values[..., self.outer, :]))


def solid_mesh(model: CylinderModel) -> SolidMesh:
    """Solids on both sides of the model's middle surface.

    Raises
    ------
    InputError : the rest is not of one thickness, or the seam not three times as thick.
    """
    mesh = model.mesh
    count, quads = len(mesh.points), np.asarray(mesh.quads)
    numbers = np.arange(len(quads))
    seam = np.asarray(mesh.element_sets.get("seam", np.empty(0)), dtype=np.intp)
    caps = np.asarray(mesh.element_sets["caps"])
    layer = float(model.thickness[np.setdiff1d(numbers, seam)][0])
    layers = np.where(np.isin(numbers, seam), float(SEAM_LAYERS), 1.0)
    if not np.allclose(model.thickness, layer * layers, rtol=1e-9):
        problem = f"expected one thickness, and {SEAM_LAYERS} times that in the seam, on CalculiX"
        raise InputError(None, "thickness", problem)

    outward = _outward(mesh.points, quads, caps)
    on_seam = np.unique(quads[seam])
    inner, outer = np.arange(count), count + np.arange(count)
    last = np.full(count, -1)
    last[on_seam] = 2 * count + np.arange(len(on_seam))
    middle, out = np.asarray(mesh.points, float), layer * outward
    outermost = middle[on_seam] + (SEAM_LAYERS - 0.5) * out[on_seam]
    points = np.concatenate([middle - 0.5 * out, middle + 0.5 * out, outermost])
    base = np.concatenate([inner[quads], outer[quads]], axis=1)
    upon = np.concatenate([outer[quads[seam]], last[quads[seam]]], axis=1)
    elements = np.concatenate([base, upon])
    outside = numbers.copy()
    outside[seam] = len(quads) + np.arange(len(seam))
    sets = {
        "tube": np.setdiff1d(np.arange(len(elements)), caps),
        "caps": caps,
        "inside": numbers,
        "outside": outside,
    }
    through = np.stack([inner, outer, last])
    node_sets = {
        name: np.unique(through[:, nodes][through[:, nodes] >= 0])
        for name, nodes in mesh.node_sets.items()
    }
    return SolidMesh(points, elements, inner, outer, sets, node_sets)


def _outward(points: Array, quads: Numbers, caps: Numbers) -> Array:
    """(n, 3) from the middle to the outside: unit normals; at the ends the sum of both."""
    tube = np.unique(np.delete(quads, caps, axis=0))
    cap = np.unique(quads[caps])
    outward = np.zeros_like(points, dtype=float)
    radial = points[tube, :2]
    outward[tube, :2] = radial / np.linalg.norm(radial, axis=1)[:, None]
    outward[cap, 2] = np.sign(points[cap, 2])
    return outward


DECK, MESH = "cylinder.inp.j2", "solids.inp.j2"
#: Incompatible modes: flat solids lock without.
ELEMENT = "C3D8I"
TOLERANCES = (1e-4, 1e-3)
#: Newton's method gets more iterations than CalculiX gives it by default: contact needs them.
TIME_INCREMENTATION = "6, 10, 9, 30, 14, 6, , 8"
#: First and least increment of CalculiX as parts of one of the law: at first the flat caps have
#: no stiffness but bending. Bending has its own.
FIRST, LEAST = 0.1, 1e-5
MOST_INCREMENTS = 1000


def cylinder_decks(
    model: CylinderModel,
    law: HypoelasticLaw,
    solids: SolidMesh,
    bending: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file by name.

    Parameters
    ----------
    bending : what `bending_context` makes; inflation alone unless given.
    folder : the user's templates.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    mesh: dict[str, Any] = {
        "element": ELEMENT,
        "points": solids.points.tolist(),
        "elements": (solids.elements + 1).tolist(),
        "element_sets": _named(solids.element_sets),
        "node_sets": _named(solids.node_sets),
    }
    # The plane of the caps is xy, where the warp runs along x or y.
    yarn = np.asarray(model.mesh.warp)[solids.element_sets["caps"][0]]
    angle = float(np.degrees(np.arctan2(yarn[1], yarn[0])))
    until = len(model.inflation)
    context: dict[str, Any] = {
        "version": __version__,
        "title": f"Cylinder, {len(solids.elements)} solids {ELEMENT}",
        "mesh_file": MESH_FILE,
        "mesh": mesh,
        "material": MATERIAL,
        "state_variables": STATE_VARIABLES,
        "element": ELEMENT,
        "sections": [
            {
                "set": "TUBE",
                "constants": constants(law, normal_axis=1, whole_until=until),
                "around": True,
            },
            {
                "set": "CAPS",
                "constants": constants(law, angle=angle, whole_until=until),
                "around": False,
            },
        ],
        "supports": [
            {"set": name.upper(), "dof": direction + 1}
            for name, directions in model.guides.items()
            for direction in directions
        ],
        "inflation": list(model.inflation),
        "bending": bending,
        "first": FIRST,
        "least": LEAST,
        "most_increments": MOST_INCREMENTS,
        "force_tolerance": TOLERANCES[0],
        "correction_tolerance": TOLERANCES[1],
        "time_incrementation": TIME_INCREMENTATION,
    }
    ours = folder if folder is not None and (folder / MESH).is_file() else None
    return {
        "job.inp": render("calculix", DECK, context, folder),
        MESH_FILE: render("calculix", MESH, mesh, ours),
    }


def _named(sets: Any) -> dict[str, list[int]]:
    return {name.upper(): (numbers + 1).tolist() for name, numbers in sets.items() if len(numbers)}


@dataclass(frozen=True, eq=False)
class GasCurve:
    """Gauge pressure (n,) MPa over increasing deflection (n,) mm; constant beyond both ends."""

    deflection: Array
    pressure: Array

    def at(self, deflection: Array) -> Array:
        """Gauge pressure in MPa at deflections in mm."""
        return np.interp(deflection, self.deflection, self.pressure)


def compliance(pressures: Array, volumes: Array) -> float:
    """dV/dp (mm^3/MPa) at the end of inflation, from (n,) MPa and mm^3; n > 1."""
    order: Literal[1, 2] = 2 if len(volumes) > 2 else 1
    return float(np.gradient(volumes, pressures, edge_order=order)[-1])


def gas_pressure(gas: ClosedGas, volumes: Array) -> Array:
    """Gauge pressure (n,) MPa of the gas in volumes (n,) mm^3."""
    return np.array([gas.pressure(float(v)) for v in volumes])


def better_pressure(gas: ClosedGas, volumes: Array, given: Array, slope: float) -> Array:
    """Gauge pressure (n,) MPa for the next pass, from the volumes found at the `given` ones.

    One step of Newton's method on gas(V(p)) = p, the cylinder at any deflection as compliant as
    the inflated one (`slope`, dV/dp in mm^3/MPa). With the gas' own pressure instead the error
    falls to a quarter in each pass only.
    """
    stiffness = np.array([gas.stiffness(float(v)) for v in volumes])
    return np.asarray(given + (gas_pressure(gas, volumes) - given) / (1.0 + stiffness * slope))


# Bending the inflated cylinder on CalculiX: rigid bodies, contact, the way of the collar.
#
# Total time of the step is the collar's way in mm (`REST` later), in increments as contact allows.

#: MPa/mm, as the membrane solver's; what others give: docs/how-to/calculix.md, *Contact*.
STIFFNESS = 5.0
#: CalculiX' own, and more than enough: the load is a sum over many nodes.
TOLERANCES_CYLINDER_BENDING = (5e-3, 1e-2)
#: mm that the support begins inside the cylinder, so that it touches, and that the collar begins
#: above the inflated cylinder, so that it does not.
INTO, ABOVE = 0.02, 0.5
#: Quads that may touch: mm to either side of a support and beyond the collar's edge, and how low
#: or high they lie, in radii.
BESIDE_SUPPORT, BESIDE_COLLAR, LOW, HIGH = 80.0, 60.0, -0.35, 0.1
#: Time that the collar stands still, and of the first increment, which must end before it moves.
REST, FIRST_CYLINDER_BENDING = 1.5, 1.0
#: mm of the collar's way: longest increment (its effect: docs/how-to/calculix.md), and the one
#: at which contact is given up.
LONGEST, LEAST_CYLINDER_BENDING = 5.0, 1e-4


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
        "first": FIRST_CYLINDER_BENDING,
        "least": LEAST_CYLINDER_BENDING,
        "longest": min(LONGEST, float(np.diff(model.increments, prepend=0.0).max())),
        "duration": REST + way,
        "force_tolerance": TOLERANCES_CYLINDER_BENDING[0],
        "correction_tolerance": TOLERANCES_CYLINDER_BENDING[1],
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
