"""A quarter of the unit disk by gmsh: unstructured, to see whether a result hangs on the mesh.

Triangles, each cut into three quads: worst scaled Jacobian 0.6, where gmsh's recombining of
triangles gave 0.3 to 0.5 (4.15, 50 to 200 quads) and two of its algorithms did not end.
"""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ..errors import BubblefitError

QUAD = 3  # gmsh's number of the element type
ATTEMPTS = 5  # at the size of triangle that gives the count wanted


def quarter_disk_by_gmsh(elements: float) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Mesh the quarter x, y >= 0 of the unit disk.

    Parameters
    ----------
    elements : quads wanted; an unstructured mesh comes near, within some per cent.

    Returns
    -------
    points (p, 2), quads (q, 4) counter-clockwise.

    Raises
    ------
    BubblefitError : gmsh or a library that it loads is not there, or gmsh fails.
    """
    gmsh = _loaded()
    # A caller's own gmsh session is left as it was.
    started = not gmsh.isInitialized()
    if started:
        # Not interruptible: gmsh would take Ctrl-C for itself and only works in the main thread.
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
    try:
        return _nearest(gmsh, elements)
    except Exception as failure:  # gmsh raises nothing more precise
        problem = f'gmsh cannot mesh the disk: {failure}; generator = "blocks" needs no gmsh'
        raise BubblefitError(problem) from failure
    finally:
        if started:
            gmsh.finalize()


def _loaded() -> ModuleType:
    try:
        import gmsh
    except (ImportError, OSError) as missing:
        # The wheel is there but a shared library is not: OSError, of the dynamic loader.
        problem = (
            f"gmsh cannot be loaded ({missing}): install it with `pip install gmsh`, and the X and"
            " GL libraries that it loads with `apt-get install libglu1-mesa libxrender1"
            ' libxcursor1 libxft2 libxinerama1`, or choose generator = "blocks", which needs'
            " nothing"
        )
        raise BubblefitError(problem) from missing
    return gmsh


def _nearest(gmsh: ModuleType, elements: float) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """The mesh of some sizes tried whose count is nearest to the one wanted."""
    # Equilateral triangles of side h, three quads each, on an area of pi / 4.
    size = math.sqrt(math.pi / 4 * 3 / elements * 4 / math.sqrt(3))
    best = None
    for _ in range(ATTEMPTS):
        points, quads = _meshed(gmsh, size)
        if best is None or abs(len(quads) - elements) < abs(len(best[1]) - elements):
            best = points, quads
        size *= math.sqrt(len(quads) / elements)
    assert best is not None
    return best


def _meshed(gmsh: ModuleType, size: float) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    gmsh.model.add("bubblefit quarter disk")
    try:
        shape = gmsh.model.geo
        centre, east, north = (shape.addPoint(x, y, 0, size) for x, y in ((0, 0), (1, 0), (0, 1)))
        lines = [
            shape.addLine(centre, east),
            shape.addCircleArc(east, centre, north),
            shape.addLine(north, centre),
        ]
        shape.addPlaneSurface([shape.addCurveLoop(lines)])
        shape.synchronize()
        gmsh.option.setNumber("Mesh.Algorithm", 6)  # frontal Delaunay
        gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)  # triangles into quads
        gmsh.model.mesh.generate(2)
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        kinds, _, corners = gmsh.model.mesh.getElements(2)
    finally:
        gmsh.model.remove()
    if list(kinds) != [QUAD]:
        raise RuntimeError(f"expected quads only, got element types {list(kinds)}")
    place = np.zeros(int(tags.max()) + 1, dtype=np.intp)
    place[tags] = np.arange(len(tags))
    return xyz.reshape(-1, 3)[:, :2].copy(), place[corners[0]].reshape(-1, 4)
