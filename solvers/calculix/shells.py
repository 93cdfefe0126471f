"""Shell elements of CalculiX on a mesh of four-node quads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.mesh import Mesh
from ...meshes.rim import rim_form, rim_share

Element = Literal["S4", "S8R"]
ELEMENTS: tuple[Element, ...] = ("S8R", "S4")


@dataclass(frozen=True, eq=False)
class ShellMesh:
    """Nodes (n, 3) mm, elements (m, 4 or 8) and sets, numbered from 0; corners come first.

    `corners` : how many nodes are the mesh's own; the others are midsides.
    """

    points: NDArray[np.float64]
    elements: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    corners: int


def shell_mesh(mesh: Mesh, element: str) -> ShellMesh:
    """The mesh as S4, or as S8R with a midside node on every edge.

    A midside between two rim nodes is moved out onto the rim's circle or ellipse; a midside whose
    two ends are in a set is in the set when the edge bounds the mesh.

    Raises
    ------
    InputError : another element.
    """
    points, quads = np.asarray(mesh.points, float), np.asarray(mesh.quads)
    if element == "S4":
        return ShellMesh(points, quads, mesh.node_sets, len(points))
    if element != "S8R":
        problem = f"expected one of {', '.join(ELEMENTS)}, got {element!r}"
        raise InputError(None, "solver.calculix.element", problem)
    # Edge k of a quad joins corners k and k + 1: the order of S8R's midsides.
    ends = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2), axis=2)
    edges, which, used = np.unique(
        ends.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    midsides = points[edges].mean(axis=1)
    border = used == 1
    sets = {}
    for name, nodes in mesh.node_sets.items():
        inside = border & np.isin(edges, nodes).all(axis=1)
        sets[name] = np.concatenate([nodes, len(points) + np.flatnonzero(inside)])
        if name == "rim":
            form = rim_form(points[nodes, :2])
            own = np.flatnonzero(inside)
            midsides[own, :2] /= rim_share(form, midsides[own, :2])[:, None]
    elements = np.concatenate([quads, len(points) + which.reshape(quads.shape)], axis=1)
    return ShellMesh(np.concatenate([points, midsides]), elements, sets, len(points))
