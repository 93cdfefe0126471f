"""The inflated bubble for ParaView."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import ArrayLike

from ..files import replacing
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
