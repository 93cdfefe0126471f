"""`meshio.read("job.t19")`: the mesh and the last increment of a formatted post file of Marc.

meshio has no reader of its own for this format. For the other increments: `t19.T19File`.
"""

from __future__ import annotations

from pathlib import Path

import meshio

#: meshio's name of the element types that public decks show.
CELLS = {
    7: "hexahedron",
    18: "quad",
    75: "quad",
    134: "tetra",
    138: "triangle",
    139: "quad",
    140: "quad",
}


def read(filename: Path | str) -> meshio.Mesh:
    """Mesh with the last increment's vectors as point data; `field_data`: time and increment.

    Raises
    ------
    InputError : truncated or corrupt, or an element type that is not known here. (meshio itself
        would end the program on a ReadError.)
    """
    # Here, not above: this module is imported with bubblefit, and reading is rare.
    import numpy as np

    from ..base import cell_blocks
    from .t19 import T19File

    file = T19File(filename)
    cells = cell_blocks(
        file.path,
        file.mesh.numbers,
        file.mesh.elements,
        {kind: (name, None) for kind, name in CELLS.items()},
    )
    mesh = meshio.Mesh(file.mesh.points, cells)
    for frame in file.frames():
        mesh.point_data = dict(frame.fields)
        mesh.field_data = {
            "time": np.array([frame.time]),
            "increment": np.array([frame.increment]),
        }
    return mesh


meshio.register_format("t19", [".t19"], read, {})
