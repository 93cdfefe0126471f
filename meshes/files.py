"""Meshes to and from files, through meshio, with their node and element sets.

Two formats carry named sets through meshio without further packages: `.vtu` (ParaView), where a
set is a column of 0 and 1 at the points or cells, and `.inp` (Abaqus, CalculiX), where it is an
NSET or ELSET. The direction of the warp in each quad is kept by `.vtu` alone; in a deck it belongs
to the material or its orientation.
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
#: The column of a .vtu that holds the direction of the warp in each quad.
WARP_COLUMN = "warp"
FORMATS = (".vtu", ".inp")
NEAR_UNIT = 1e-6


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
        cells: dict[str, list[NDArray]] = {
            f"{SET_COLUMN}{name}": [_members(numbers, len(mesh.quads))]
            for name, numbers in mesh.element_sets.items()
        }
        if mesh.warp is not None:
            cells[WARP_COLUMN] = [mesh.warp]
        meshio.vtu.write(path, meshio.Mesh(mesh.points, quads, point_data=member, cell_data=cells))
        return
    for kind, sets in (("node", mesh.node_sets), ("element", mesh.element_sets)):
        for name, members in sets.items():
            # Abaqus separates by commas, ends a name at a blank, and knows no empty set.
            if not len(members) or not name.isidentifier():
                problem = (
                    f"expected a name of letters, digits and _, and at least one {kind}; use .vtu"
                )
                raise InputError(path, f"{kind} set {name!r}", problem)
    element_sets = {name: [numbers] for name, numbers in mesh.element_sets.items()}
    content = meshio.Mesh(
        mesh.points, quads, point_sets=dict(mesh.node_sets), cell_sets=element_sets
    )
    meshio.abaqus.write(path, content)


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
    numbered = (("elements", quads), *((f"node set {n}", s) for n, s in sets.items()))
    for what, nodes in numbered:
        if nodes.size and not (nodes.min() >= 0 and nodes.max() < len(points)):
            problem = f"a node number that is not one of the {len(points)} nodes"
            raise InputError(path, what, problem)
    if not len(quads):
        raise InputError(path, "elements", "expected at least one quad, found none")
    element_sets = _element_sets(path, content, len(quads))
    return Mesh(points, quads, sets, element_sets, _warp(path, content, len(quads)))


def _element_sets(path: Path, content: meshio.Mesh, count: int) -> dict[str, NDArray[np.intp]]:
    """Quads by set; lines and points that a set holds as well are left out."""
    kinds = [block.type for block in content.cells]
    starts = np.cumsum([0] + [len(b.data) if b.type == "quad" else 0 for b in content.cells])
    sets = {}
    for name, parts in (content.cell_sets or {}).items():
        members = [
            np.asarray(part, dtype=np.intp) + start
            for part, start, kind in zip(parts, starts, kinds, strict=False)
            if kind == "quad" and part is not None
        ]
        sets[str(name)] = np.unique(np.concatenate([np.empty(0, dtype=np.intp), *members]))
    for name in content.cell_data:
        if name.startswith(SET_COLUMN):
            sets[name.removeprefix(SET_COLUMN)] = np.flatnonzero(_of_quads(content, name))
    for name, numbers in sets.items():
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < count):
            problem = f"an element number that is not one of the {count} quads"
            raise InputError(path, f"element set {name}", problem)
    return sets


def _warp(path: Path, content: meshio.Mesh, count: int) -> NDArray[np.float64] | None:
    """The column of warp directions, where there is one."""
    if WARP_COLUMN not in content.cell_data:
        return None
    warp = np.asarray(_of_quads(content, WARP_COLUMN), dtype=float)
    if warp.shape != (count, 3) or not (np.abs(np.linalg.norm(warp, axis=1) - 1) < NEAR_UNIT).all():
        raise InputError(path, WARP_COLUMN, "expected a unit vector of three numbers a quad")
    return warp


def _of_quads(content: meshio.Mesh, name: str) -> NDArray:
    parts = zip(content.cells, content.cell_data[name], strict=True)
    return np.concatenate([np.asarray(values) for block, values in parts if block.type == "quad"])


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:200]}" if text else type(error).__name__
