"""Write files for ParaView: deformed meshes (.vtu), and series of them (.pvd)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import meshio
import numpy as np
from numpy.typing import ArrayLike

from ..files import replacing, write_text
from ..meshes.mesh import Mesh


def write_vtu(
    mesh: Mesh,
    displacement: ArrayLike,
    path: Path | str,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
) -> Path:
    """Write the deformed mesh as a VTK unstructured grid.

    Parameters
    ----------
    mesh : reference geometry, mm.
    displacement : (n, 3) mm; also written as point data `displacement`, so the flat disk is
        `displacement` subtracted (ParaView: Warp By Vector, scale -1).
    path : ends in .vtu.
    point_data, cell_data : further fields, (n, ...) and (m, ...).

    Raises
    ------
    OutputError : the file cannot be written.
    ValueError : a field that does not have one row a node or quad.
    """
    u = np.asarray(displacement, dtype=float)
    points: dict[str, Any] = {"displacement": u}
    points.update({name: np.asarray(field) for name, field in (point_data or {}).items()})
    for name, field in points.items():
        if len(field) != len(mesh.points):
            raise ValueError(f"{name}: {len(field)} rows for {len(mesh.points)} nodes")
    cells = {name: [np.asarray(field)] for name, field in (cell_data or {}).items()}
    grid = meshio.Mesh(mesh.points + u, [("quad", mesh.quads)], points, cells)
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="vtu")
    return Path(path)


HEAD = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
TAIL = "  </Collection>\n</VTKFile>\n"


def write_pvd(path: Path, files: Sequence[tuple[float, Path]]) -> Path:
    """Write a collection of files that are there, each with its time.

    Parameters
    ----------
    path : ends in .pvd. files : time (whatever it counts: kPa) and file, named from the collection.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    rows = [
        f'    <DataSet timestep="{time:.9g}" part="0" '
        f"file={quoteattr(file.relative_to(path.parent).as_posix())}/>\n"
        for time, file in files
    ]
    write_text(path, HEAD + "".join(rows) + TAIL)
    return path
