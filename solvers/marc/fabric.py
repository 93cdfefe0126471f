"""The part of a deck that describes the mesh: sets, thicknesses, fabric frames."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.mesh import Mesh

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

FABRIC = "fabric"
PER_LINE = 8
#: Digits to which unit vectors are the same.
SAME = 9


def set_lines(numbers: Numbers) -> list[str]:
    """Members of a set as Marc reads them: `a to b` for runs, ` c` where a line goes on.

    numbers : from 0, sorted.
    """
    items = []
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    for run in runs:
        first, last = int(run[0]) + 1, int(run[-1]) + 1
        if len(run) > 2:
            items.append(f"{first:10d} to {last:d}")
        else:
            items += [f"{n + 1:10d}" for n in run.tolist()]
    rows = [items[i : i + PER_LINE] for i in range(0, len(items), PER_LINE)]
    return ["".join(row) + (" c" if row is not rows[-1] else "") for row in rows]


def named_set(kind: str, name: str, numbers: Numbers) -> dict[str, Any]:
    """One `define` of the deck; kind "node" or "element".

    Raises
    ------
    InputError : a name that Marc could not read, or a set of nothing.
    """
    if not re.fullmatch(r"[a-z0-9_]{1,28}", name):
        problem = f"{name!r}: Marc takes at most 28 letters, digits and _; rename the set"
        raise InputError(None, f"{kind} set", problem)
    if not len(numbers):
        raise InputError(None, f"{kind} set {name}", "holds nothing; mend the mesh")
    return {"kind": kind, "name": name, "lines": set_lines(np.sort(numbers))}


def fabric_frames(mesh: Mesh, warp: Array) -> tuple[Array, Array]:
    """Unit vectors of warp and fill in the plane of each quad at its middle, (quads, 3) each.

    Raises
    ------
    InputError : a warp direction normal to a quad.
    """
    corner = mesh.points[mesh.quads]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    yarn = np.broadcast_to(warp, normal.shape)
    along = yarn - np.einsum("mk,mk->m", yarn, normal)[:, None] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if (length < 1e-6).any():
        raise InputError(None, "warp", "the warp direction is normal to a facet")
    along /= length
    return along, np.cross(normal, along)


def fabric_context(mesh: Mesh, warp: Array, thickness: Array | float) -> dict[str, Any]:
    """What the templates are given of mesh, frames and thicknesses; sets without the nodes'."""
    quads = np.asarray(mesh.quads)
    everything = np.arange(len(quads))
    sets = [named_set("element", FABRIC, everything)]

    def groups(values: Array, name: str) -> list[tuple[str, int]]:
        """Name of the set of elements with the same row of `values`, and one of them."""
        _, which = np.unique(values, axis=0, return_inverse=True)
        which = which.ravel()
        count = int(which.max()) + 1
        if count == 1:
            return [(FABRIC, 0)]
        found = []
        for number in range(count):
            members = np.flatnonzero(which == number)
            found.append((f"{name}_{number + 1}", int(members[0])))
            sets.append(named_set("element", found[-1][0], members))
        return found

    layer = np.broadcast_to(np.asarray(thickness, float), len(quads))
    layers = [
        {"set": name, "thickness": float(layer[one])}
        for name, one in groups(layer[:, None], "layer")
    ]
    along, across = fabric_frames(mesh, warp)
    # Adding zero turns -0 into 0.
    rows = np.asarray(np.round(np.hstack([along, across]), SAME) + 0.0, float)
    frames = [
        {"set": name, "warp": rows[one, :3].tolist(), "fill": rows[one, 3:].tolist()}
        for name, one in groups(rows, "frame")
    ]
    return {
        "points": np.asarray(mesh.points, float).tolist(),
        "elements": (quads + 1).tolist(),
        "sets": sets,
        "layers": layers,
        "frames": frames,
    }


def node_sets(mesh: Mesh, names: Mapping[str, Any] | list[str]) -> list[dict[str, Any]]:
    """The `define`s of the mesh's node sets of these names."""
    return [named_set("node", name.lower(), mesh.node_sets[name]) for name in names]
