"""A quarter of a disk meshed by gmsh."""

import math
from types import ModuleType

import numpy as np

from ..errors import BubblefitError
from .mesh import Array, Numbers


def quarter_disk_by_gmsh(elements: float) -> tuple[Array, Numbers]:
    """Mesh the quarter by gmsh, unstructured: triangles, each cut into three quads."""
    gmsh = _load_gmsh()
    # A caller's own gmsh session is left as it was.
    is_ours = not gmsh.isInitialized()
    if is_ours:
        # Not interruptible: gmsh would take Ctrl-C for itself and only works in the main thread.
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
    try:
        return _mesh_with_count(gmsh, elements)
    except Exception as failure:  # gmsh raises nothing more precise
        problem = f'gmsh cannot mesh the disk: {failure}; generator = "blocks" needs no gmsh'
        raise BubblefitError(problem) from failure
    finally:
        if is_ours:
            gmsh.finalize()


def _load_gmsh() -> ModuleType:
    """Return gmsh; BubblefitError if it or a library that it needs is missing."""
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


def _mesh_with_count(gmsh: ModuleType, elements: float, attempts: int = 5) -> tuple[Array, Numbers]:
    """Return points and quads, of several sizes of triangle those nearest to a number of quads."""
    # Equilateral triangles of side h, three quads each, on an area of pi / 4.
    size = math.sqrt(math.pi / 4 * 3 / elements * 4 / math.sqrt(3))
    best = None
    for _ in range(attempts):
        points, quads = _mesh_of_size(gmsh, size)
        if best is None or abs(len(quads) - elements) < abs(len(best[1]) - elements):
            best = points, quads
        size *= math.sqrt(len(quads) / elements)
    assert best is not None
    return best


def _mesh_of_size(gmsh: ModuleType, size: float) -> tuple[Array, Numbers]:
    """Return points (n, 2) and quads of triangles of a size, in radii."""
    quad_type = 3
    frontal_delaunay = 6
    into_quads = 1
    gmsh.model.add("bubblefit quarter disk")
    try:
        shape = gmsh.model.geo
        centre = shape.addPoint(0, 0, 0, size)
        east = shape.addPoint(1, 0, 0, size)
        north = shape.addPoint(0, 1, 0, size)
        lines = [
            shape.addLine(centre, east),
            shape.addCircleArc(east, centre, north),
            shape.addLine(north, centre),
        ]
        shape.addPlaneSurface([shape.addCurveLoop(lines)])
        shape.synchronize()
        gmsh.option.setNumber("Mesh.Algorithm", frontal_delaunay)
        gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", into_quads)
        gmsh.model.mesh.generate(2)
        tags, xyz, _ = gmsh.model.mesh.getNodes()
        kinds, _, corners = gmsh.model.mesh.getElements(2)
    finally:
        gmsh.model.remove()
    if list(kinds) != [quad_type]:
        raise RuntimeError(f"expected quads only, got element types {list(kinds)}")
    place = np.zeros(int(tags.max()) + 1, dtype=np.intp)
    place[tags] = np.arange(len(tags))
    return xyz.reshape(-1, 3)[:, :2].copy(), place[corners[0]].reshape(-1, 4)
