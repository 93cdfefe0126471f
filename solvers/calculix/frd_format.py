"""`meshio.read("job.frd")`: the mesh and the last increment of a CalculiX result file.

meshio has no reader of its own for this format. For the other increments: `frd.FrdFile`.
"""

from __future__ import annotations

from pathlib import Path

import meshio

#: meshio's name of each element type of the format, and its node order where it differs.
CELLS: dict[int, tuple[str, tuple[int, ...] | None]] = {
    1: ("hexahedron", None),
    2: ("wedge", None),
    3: ("tetra", None),
    4: ("hexahedron20", (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)),
    5: ("wedge15", (*range(9), 12, 13, 14, 9, 10, 11)),
    6: ("tetra10", None),
    7: ("triangle", None),
    8: ("triangle6", None),
    9: ("quad", None),
    10: ("quad8", None),
    11: ("line", None),
    12: ("line3", (0, 2, 1)),
}


def read(filename: Path | str) -> meshio.Mesh:
    """Mesh with the last increment's fields as point data (NaN where a node has no value).

    `field_data` holds time, step and increment.

    Raises
    ------
    InputError : truncated or corrupt. (meshio itself would end the program on a ReadError.)
    """
    # Here, not above: this module is imported with bubblefit, and reading is rare.
    import numpy as np

    from ..base import cell_blocks
    from .frd import FrdFile

    file = FrdFile(filename)
    cells = cell_blocks(file.path, file.mesh.numbers, file.mesh.elements, CELLS)
    mesh = meshio.Mesh(file.mesh.points, cells)
    for frame in file.frames():
        mesh.point_data = dict(frame.fields)
        mesh.field_data = {
            "time": np.array([frame.time]),
            "step": np.array([frame.step]),
            "increment": np.array([frame.increment]),
        }
    return mesh


meshio.register_format("frd", [".frd"], read, {})
