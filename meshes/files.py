"""Meshes to and from files, through meshio, with their node sets.

Two formats carry named node sets through meshio without further packages: `.vtu` (ParaView), where
a set is a column of 0 and 1 at the points, and `.inp` (Abaqus, CalculiX), where it is an NSET.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .mesh import Mesh

if TYPE_CHECKING:
    import meshio

#: What the columns of a .vtu that are node sets are called: this, then the set's name.
SET_COLUMN = "set_"
FORMATS = (".vtu", ".inp")


def write_mesh(mesh: Mesh, path: Path | str) -> None:
    """Write a mesh; the suffix, `.vtu` or `.inp`, names the format.

    Raises
    ------
    InputError : another suffix, or (`.inp`) a set without nodes or whose name is not plain.
    OSError : the file cannot be written; what was there may be lost.
    """
    import meshio

    path = Path(path)
    quads = [("quad", mesh.quads)]
    if _suffix(path) == ".vtu":
        member = {
            f"{SET_COLUMN}{name}": _members(nodes, len(mesh.points))
            for name, nodes in mesh.node_sets.items()
        }
        meshio.vtu.write(path, meshio.Mesh(mesh.points, quads, point_data=member))
        return
    for name, nodes in mesh.node_sets.items():
        # Abaqus separates by commas, ends a name at a blank, and knows no empty set.
        if not len(nodes) or not name.isidentifier():
            problem = "expected a name of letters, digits and _, and at least one node; use .vtu"
            raise InputError(path, f"node set {name!r}", problem)
    meshio.abaqus.write(path, meshio.Mesh(mesh.points, quads, point_sets=dict(mesh.node_sets)))


def read_mesh(path: Path | str) -> Mesh:
    """Read a mesh of four-node quadrilaterals, written here or by another program.

    Lengths are taken to be mm. Lines and points among the elements are left out.

    Raises
    ------
    InputError : no such file, another suffix, not a mesh, triangles or other faces, node numbers
        or coordinates that make no sense.
    """
    import meshio

    path = Path(path)
    reader = meshio.vtu.read if _suffix(path) == ".vtu" else meshio.abaqus.read
    try:
        # The format's own reader: meshio.read ends the process on a bad file.
        content = reader(path)
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror or error}") from None
    except Exception as error:
        # Garbage makes meshio's readers raise nearly anything, an UnboundLocalError included.
        problem = f"expected a mesh in the format of its suffix ({_one_line(error)})"
        raise InputError(path, "", problem) from error
    return _checked(path, content)


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        problem = f"expected a name that ends in {' or '.join(FORMATS)}, which keep node sets"
        raise InputError(path, "format", problem)
    return suffix


def _members(nodes: NDArray[np.intp], count: int) -> NDArray[np.int8]:
    member = np.zeros(count, dtype=np.int8)
    member[nodes] = 1
    return member


def _checked(path: Path, content: meshio.Mesh) -> Mesh:
    points = np.asarray(content.points, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not np.isfinite(points).all():
        raise InputError(path, "nodes", "expected two or three finite coordinates a node")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    faces = {block.type for block in content.cells} - {"vertex", "line", "line3"}
    if faces != {"quad"}:
        found = ", ".join(sorted(faces)) or "none"
        raise InputError(path, "elements", f"expected four-node quads only, found {found}")
    blocks = [np.asarray(b.data) for b in content.cells if b.type == "quad"]
    quads = np.concatenate(blocks).astype(np.intp)
    sets = {
        str(name): np.unique(np.asarray(nodes, dtype=np.intp))
        for name, nodes in (content.point_sets or {}).items()
    }
    for name, member in content.point_data.items():
        if name.startswith(SET_COLUMN):
            sets[name.removeprefix(SET_COLUMN)] = np.flatnonzero(member)
    for what, nodes in (("elements", quads), *((f"node set {n}", s) for n, s in sets.items())):
        if nodes.size and not (nodes.min() >= 0 and nodes.max() < len(points)):
            problem = f"a node number that is not one of the {len(points)} nodes"
            raise InputError(path, what, problem)
    if not len(quads):
        raise InputError(path, "elements", "expected at least one quad, found none")
    return Mesh(points, quads, sets)


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:200]}" if text else type(error).__name__
