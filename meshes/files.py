"""Meshes to and from files by meshio."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..writing import replacing
from .mesh import Mesh

PREFIX = "set:"  # point data that holds a node set, one where a node belongs to it


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write points, quads and node sets; the format follows the suffix (.vtu, .vtk, .inp ...).

    Node sets become point sets in .inp and point data elsewhere.

    Raises
    ------
    InputError : a suffix that meshio does not know. OutputError : the file cannot be written.
    """
    import meshio

    sets = {name: np.asarray(nodes) for name, nodes in mesh.node_sets.items()}
    written = meshio.Mesh(mesh.points, [("quad", mesh.quads)])
    if path.suffix == ".inp":
        written.point_sets = sets
    else:
        for name, nodes in sets.items():
            member = np.zeros(len(mesh.points))
            member[nodes] = 1.0
            written.point_data[PREFIX + name] = member
    try:
        with replacing(path) as temporary:
            meshio.write(temporary, written)
    except (meshio.WriteError, KeyError) as error:
        raise InputError(path, "", f"meshio cannot write this format: {error}") from None


def read_mesh(path: Path) -> Mesh:
    """Read quads and node sets.

    Raises
    ------
    InputError : not a mesh that meshio reads, or one without quads.
    """
    import meshio

    if not Path(path).is_file():
        raise InputError(path, "", "no such file")
    try:
        found = meshio.read(path)
        blocks = [block.data for block in found.cells if block.type == "quad"]
    # meshio's readers answer a damaged file with whatever their parsing stumbles over, and some
    # end the process: both become one clear error here.
    except (Exception, SystemExit) as error:
        problem = f"meshio cannot read it: {error or type(error).__name__}"
        raise InputError(path, "", problem) from None
    if not blocks:
        raise InputError(path, "cells", "has no 4-node quads")
    sets = {name: np.asarray(nodes) for name, nodes in (found.point_sets or {}).items()}
    for name, member in found.point_data.items():
        if name.startswith(PREFIX):
            sets[name.removeprefix(PREFIX)] = np.flatnonzero(np.asarray(member) > 0.5)
    points = np.array(found.points, dtype=float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return Mesh(points, np.concatenate(blocks).astype(np.int64), sets)
