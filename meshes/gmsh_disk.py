"""The quarter disk by gmsh, imported only when asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import BubblefitError


def gmsh_quarter(radius: float, elements: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Recombined quads of the quarter x, y >= 0; points (n, 2) mm and quads (m, 4).

    Raises
    ------
    BubblefitError : gmsh or one of its libraries is missing, or it left triangles.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise BubblefitError(
            f"gmsh cannot be loaded ({error}); on Debian install libglu1-mesa, libxcursor1, "
            'libxft2, libxinerama1 and libxrender1, or use generator = "blocks", which needs '
            "nothing"
        ) from None
    # Without signal handlers of its own: Ctrl-C stays ours.
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        # Recombination of the frontal mesh, each triangle pair a quad of about this size.
        size = radius * np.sqrt(np.pi / elements)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.Algorithm", 8)
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 3)
        occ = gmsh.model.occ
        disk = occ.addDisk(0, 0, 0, radius, radius)
        square = occ.addRectangle(0, 0, 0, 2 * radius, 2 * radius)
        occ.intersect([(2, disk)], [(2, square)])
        occ.synchronize()
        gmsh.model.mesh.generate(2)
        tags, flat, _ = gmsh.model.mesh.getNodes()
        kinds, _, nodes = gmsh.model.mesh.getElements(2)
    finally:
        gmsh.finalize()
    if list(kinds) != [3]:
        raise BubblefitError('gmsh left triangles in the disk; use generator = "blocks"')
    place = np.full(int(tags.max()) + 1, -1)
    place[tags.astype(int)] = np.arange(len(tags))
    quads = place[nodes[0].astype(int).reshape(-1, 4)]
    used, quads = np.unique(quads, return_inverse=True)
    points = flat.reshape(-1, 3)[used, :2]
    quads = quads.reshape(-1, 4)
    a, b, d = points[quads[:, 0]], points[quads[:, 1]], points[quads[:, 3]]
    turned = (b - a)[:, 0] * (d - a)[:, 1] - (b - a)[:, 1] * (d - a)[:, 0] < 0
    quads[turned] = quads[turned][:, ::-1]
    return points, quads
