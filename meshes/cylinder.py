"""The cylinder of the bending test: a tube with a seam, closed by flat caps.

Axes: z along the cylinder, y up (the collar pushes along -y), x sideways; the origin is the middle
of the axis. The seam lies at the bottom, on the supports (thesis section 6.2). The planes of
symmetry of three-point bending are x = 0, the vertical one through the axis, and z = 0, mid-span.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .graded import Refinement, rows
from .mesh import Mesh
from .mirror import with_mirror_image
from .tube import angles, of_equal_area, tube_grid, with_cap

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Masks = dict[str, NDArray[np.bool_]]

MAX_ELEMENTS = 1_000_000
#: Core divisions of a cap, at least: eight quads around half of the tube.
FEWEST = 2
#: How much longer than asked for a side around the tube may be: where a whole number does not go
#: around, rather more quads than longer ones.
LONGEST = 1.05
#: Half of the seam in sides, at least: with less the cap's quads next to it are bad.
NARROWEST = 0.25
NEAR = 1e-9  # of an angle
#: Directions of the warp yarn that are symmetric in both planes.
CAP_WARP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
OTHER_SETS = ("body", "seam", "caps", "symmetry_x", "symmetry_z")


def cylinder_mesh(
    length: float,
    diameter: float,
    size: float,
    seam_width: float = 0.0,
    symmetry: Literal["quarter", "full"] = "quarter",
    refinements: Sequence[Refinement] = (),
    cap_warp: Literal["x", "y"] = "x",
    around: float = 1.0,
) -> Mesh:
    """Mesh the middle surface of a cylinder with flat caps.

    The nodes of the tube lie a little further out than the radius, so that its cross-sections and
    the caps, which are polygons, have the area of the circle, and the cylinder its volume.

    Parameters
    ----------
    length, diameter : mm, of the whole cylinder before inflation.
    size : mm, of an element.
    seam_width : mm around the tube, centred at the bottom; its edges are rows of nodes.
    symmetry : the quarter x, z >= 0, or the whole: the quarter mirrored twice.
    refinements : places along the half z >= 0 with smaller elements (supports, collar).
    cap_warp : axis that the warp yarn of the caps follows.
    around : sides around the tube, in sizes: a whole number of quads, a multiple of eight, goes
        around it, at most 5 % longer where the seam lets them. The caps' quads are as large.

    Returns
    -------
    Mesh : normals out of the cylinder; `warp` is z on the tube and as given on the caps. Element
        sets, which share no quad: `body`, `seam` (where there is one), `caps`. Node sets: the
        nodes of each of them, `ends` (where tube and caps meet), `mid_span` (z = 0), `top_line`,
        `bottom_line` and `side_line` (along the tube: highest, lowest, at y = 0), `cap_centres`,
        by the name of each refinement its row of nodes, on the whole cylinder at z and -z, and
        NAME_bottom, the lowest of them; on a quarter also `symmetry_x` (nodes on x = 0, where
        u_x = 0) and `symmetry_z` (on z = 0).

    Raises
    ------
    InputError : lengths that are not positive, elements larger than the radius or too many of
        them, a seam too narrow for them or wider than a quarter of the tube, refinements that do
        not fit or share a name.
    """
    _check(length, diameter, size, seam_width, symmetry, cap_warp, around)
    radius = 0.5 * diameter
    z = rows(0.5 * length, size, refinements)
    n = max(FEWEST, math.ceil(math.pi * radius / (4 * LONGEST * around * size)))
    if 8 * n * (len(z) - 1) + 3 * n * n > MAX_ELEMENTS:
        problem = f"{size:g} mm gives more than {MAX_ELEMENTS} elements a half; make them larger"
        raise InputError(None, "size", problem)
    angle = angles(n, 0.5 * seam_width / radius)
    points, quads, grid = tube_grid(angle, z, of_equal_area(angle, radius))
    points, quads, tube = with_cap(points, quads, grid, angle, n)

    seam = np.zeros(len(quads), bool)
    if seam_width:
        seam[:tube] = np.tile(angle[1:] <= 0.5 * seam_width / radius * (1 + NEAR), len(z) - 1)
    cap = np.arange(len(quads)) >= tube
    elements: Masks = {"body": ~seam & ~cap, "caps": cap} | ({"seam": seam} if seam_width else {})
    nodes = {name: np.isin(np.arange(len(points)), quads[m]) for name, m in elements.items()}
    nodes |= _lines(len(points), grid, points, z, refinements)
    if symmetry == "full":
        for axis in (0, 2):
            points, quads, source = with_mirror_image(points, quads, axis)
            nodes = {name: mask[source] for name, mask in nodes.items()}
            elements = {name: np.tile(mask, 2) for name, mask in elements.items()}
    else:
        nodes |= {"symmetry_x": points[:, 0] == 0, "symmetry_z": points[:, 2] == 0}
    warp = np.where(elements["caps"][:, None], CAP_WARP[cap_warp], (0.0, 0.0, 1.0))
    return Mesh(
        points,
        quads,
        {name: np.flatnonzero(mask) for name, mask in nodes.items()},
        {name: np.flatnonzero(mask) for name, mask in elements.items()},
        warp,
    )


def _check(
    length: float,
    diameter: float,
    size: float,
    seam_width: float,
    symmetry: str,
    cap_warp: str,
    around: float,
) -> None:
    lengths = {"length": length, "diameter": diameter, "size": size, "seam_width": seam_width}
    for name, value in lengths.items():
        number = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
        if not number or value < 0 or (value == 0 and name != "seam_width"):
            least = "0 mm or more" if name == "seam_width" else "a length above 0 mm"
            raise InputError(None, name, f"expected {least}, got {value!r}")
    if not size <= 0.5 * min(diameter, length):
        problem = f"expected at most the radius and half the length, got {size:g} mm"
        raise InputError(None, "size", problem)
    if not 0 < around <= 1:
        raise InputError(None, "around", f"expected above 0 and at most 1, got {around!r}")
    if seam_width > math.pi * diameter / 4:
        problem = f"{seam_width:g} mm is more than a quarter of the tube's circumference"
        raise InputError(None, "seam_width", problem)
    if 0 < seam_width < 2 * NARROWEST * around * size:
        problem = (
            f"{seam_width:g} mm is too narrow for elements of {size:g} mm; make them"
            f" {seam_width / (2 * NARROWEST * around):g} mm or smaller"
        )
        raise InputError(None, "seam_width", problem)
    for name, choice, choices in (
        ("symmetry", symmetry, ("quarter", "full")),
        ("cap_warp", cap_warp, tuple(CAP_WARP)),
    ):
        if choice not in choices:
            raise InputError(None, name, f"expected {' or '.join(choices)}, got {choice!r}")


def _lines(
    count: int, grid: Numbers, points: Array, z: Array, refinements: Sequence[Refinement]
) -> Masks:
    """Node sets of the tube's rows and of the caps' centres."""
    middle = grid.shape[1] // 2
    members = {
        "ends": grid[-1],
        "mid_span": grid[0],
        "bottom_line": grid[:, 0],
        "side_line": grid[:, middle],
        "top_line": grid[:, -1],
        "cap_centres": np.flatnonzero((points[:, :2] == 0).all(axis=1)),
    }
    for r in refinements:
        row = grid[int(np.argmin(np.abs(z - r.position)))]
        fresh = {r.name: row, f"{r.name}_bottom": row[:1]}
        if not fresh.keys().isdisjoint({*members, *OTHER_SETS}):
            raise InputError(None, "refinements", f"{r.name!r} is the name of another node set")
        members |= fresh
    return {name: np.isin(np.arange(count), nodes) for name, nodes in members.items()}
