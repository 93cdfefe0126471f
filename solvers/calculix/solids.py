"""The cylinder as one layer of solids, and on the seam another, twice as thick, outside.

The seam's layers all lie outside because the gas must meet a surface without steps: on the faces
of a step inside, unloaded, the pressure would be out of balance by enough to bend the cylinder.

Shells will not do: where they meet at an angle, at the edge of a cap, CalculiX ties rotations
together, and Newton's method stalls as soon as contact comes in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.bending import SEAM_LAYERS
from ...models.cylinder import CylinderModel

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
