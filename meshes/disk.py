"""Quadrilateral meshes of the flat circular specimen, whole or one quarter of it."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Literal

import numpy as np

from ..errors import InputError
from .blocks import quarter_disk
from .mesh import Mesh
from .mirror import snapped, with_mirror_image

MIN_ELEMENTS, MAX_ELEMENTS = 8, 4_000_000
#: Nodes nearer to a symmetry line or the rim than this, in radii, are put on it.
NEAR = 1e-9


def disk_mesh(
    radius: float,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh a disk in the xy plane around the origin; warp is x, fill is y.

    Parameters
    ----------
    radius : mm.
    elements : quads wanted on the FULL disk, 8 or more (the thesis: 800). The mesh has the
        nearest number that well-shaped elements allow, four times that of a quarter: 800 gives
        800, and the gap is at most 16 quads below 200 and 7 % above.
    symmetry : the whole disk, or the quarter x, y >= 0 with a fourth of the elements. The whole
        is the quarter mirrored.
    generator : `blocks` is our own and needs nothing; `gmsh` loads that program's library.

    Returns
    -------
    Mesh : quads counter-clockwise (normal +z). Node sets: `rim`, `apex` (the centre); on a
        quarter also `symmetry_x` (nodes on x = 0, where u_x = 0) and `symmetry_y` (on y = 0).

    Raises
    ------
    InputError : a radius that is not positive, a count out of range, an unknown name.
    BubblefitError : `gmsh` is asked for and cannot be loaded.
    """
    _check(radius, elements, symmetry, generator)
    if generator == "gmsh":
        from .gmsh_disk import quarter_disk_by_gmsh  # loads X and GL libraries

        points, quads = quarter_disk_by_gmsh(elements / 4)
    else:
        points, quads = quarter_disk(elements / 4)
    points = snapped(points, NEAR)
    if symmetry == "full":
        for axis in (0, 1):
            points, quads, _ = with_mirror_image(points, quads, axis)
    # Sets are taken in unit radius, where the rim is 1 whatever the unit of length.
    sets = {
        "rim": np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) > 1 - NEAR),
        "apex": np.flatnonzero((points == 0).all(axis=1)),
    }
    if symmetry == "quarter":
        sets["symmetry_x"] = np.flatnonzero(points[:, 0] == 0)
        sets["symmetry_y"] = np.flatnonzero(points[:, 1] == 0)
    flat = np.zeros((len(points), 3))
    flat[:, :2] = float(radius) * points
    return Mesh(flat, quads, sets)


def _check(radius: float, elements: int, symmetry: str, generator: str) -> None:
    # A bool counts as a number in Python; true elements are a slip, not one element.
    if isinstance(radius, bool) or not isinstance(radius, Real) or not 0 < radius < math.inf:
        raise InputError(None, "radius", f"expected a length above 0 mm, got {radius!r}")
    if isinstance(elements, bool) or not isinstance(elements, Integral):
        raise InputError(None, "elements", f"expected a whole number, got {elements!r}")
    if not MIN_ELEMENTS <= elements <= MAX_ELEMENTS:
        problem = (
            f"expected {MIN_ELEMENTS} to {MAX_ELEMENTS} quads on the full disk, got {elements};"
            " 800 are usual"
        )
        raise InputError(None, "elements", problem)
    if symmetry not in ("full", "quarter"):
        raise InputError(None, "symmetry", f"expected 'full' or 'quarter', got {symmetry!r}")
    if generator not in ("blocks", "gmsh"):
        raise InputError(None, "generator", f"expected 'blocks' or 'gmsh', got {generator!r}")
