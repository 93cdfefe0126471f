"""Quadrilateral meshes of a clamped sheet with an elliptic edge: those of the disk, stretched."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ..data.outline import Outline
from ..errors import InputError
from .disk import disk_mesh
from .mesh import Mesh

#: Major over minor semi-axis: a more slender ellipse has quads that are hardly quads any more.
MOST_SLENDER = 4.0


def elliptic_disk_mesh(
    outline: Outline,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh the sheet within an outline, in the xy plane; a circle has the mesh of `disk_mesh`.

    Parameters
    ----------
    elements, symmetry, generator : as for `disk_mesh`.

    Returns
    -------
    Mesh : with the node sets of `disk_mesh`.

    Raises
    ------
    InputError : semi-axes that are not positive, too far apart or the wrong way round, a quarter
        of an ellipse of which warp and fill are no axes; as `disk_mesh`.
    """
    disk = disk_mesh(outline.major, elements, symmetry, generator)
    if outline.round:
        return disk
    if not 0 < outline.minor < outline.major:
        problem = f"expected a length above 0 and below the major {outline.major:g} mm"
        raise InputError(None, "minor", f"{problem}, got {outline.minor:g}")
    if outline.major > MOST_SLENDER * outline.minor:
        problem = f"expected at least the {MOST_SLENDER:g}th part of the major {outline.major:g} mm"
        raise InputError(None, "minor", f"{problem}, got {outline.minor:g}")
    if symmetry == "quarter" and not outline.doubly_symmetric:
        problem = f"axes at {outline.angle:g} degrees from the yarns need the whole: 'full'"
        raise InputError(None, "symmetry", problem)
    points = np.array(disk.points)
    points[:, :2] = outline.places(points[:, :2] / outline.major)
    return replace(disk, points=points)
