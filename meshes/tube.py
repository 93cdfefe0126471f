"""The cylinder of the bending test: a tube with a seam, closed by flat caps.

z runs along the cylinder, y up (the collar pushes along -y), the origin is the middle of the axis.
Angles go from the bottom, where the seam lies (thesis section 6.2), by x > 0 to the top. Also
here: rows of nodes along a tube, closer where bodies touch it.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .disk import divided_quarter_disk
from .mesh import (
    Array,
    Mesh,
    Numbers,
    check_memory,
    grid_quads,
    snapped,
    turned_over,
    with_mirror_image,
)

#: mm of element size for each mm away from a refined zone: neighbours differ by less than half.
GROWTH = 0.35


@dataclass(frozen=True)
class RefinedZone:
    """Smaller elements around a position along the tube, where there is a row of nodes.

    Parameters
    ----------
    name : str
        Of the node set.
    position, reach, size : float
        mm; up to `reach` from the position elements have this size.
    """

    name: str
    position: float
    reach: float
    size: float


def rows(end: float, size: float, refinements: Sequence[RefinedZone] = ()) -> Array:
    """Return positions (n,) mm from 0 to `end`, `size` mm apart, closer at refinements.

    Raises
    ------
    InputError
        If refinements are too near to each other or to the ends.
    """
    places = sorted({0.0, float(end)} | {float(r.position) for r in refinements})
    for r in refinements:
        gap = min(abs(p - r.position) for p in places if p != r.position)
        if gap < 0.5 * r.size:
            problem = (
                f"{r.position:g} mm is {gap:.3g} mm from the end, the middle or another row, less"
                f" than half an element of {r.size:g} mm; move it or make it the same place"
            )
            raise InputError(None, f"refinements.{r.name}.position", problem)
    pieces = [_between(a, b, size, refinements) for a, b in pairwise(places)]
    return np.concatenate([[0.0], *pieces])


def _between(
    start: float,
    end: float,
    size: float,
    refinements: Sequence[RefinedZone],
    samples: int = 20,
) -> Array:
    """Return rows (n,) mm from `start` (left out) to `end`: equal parts of the rows' density.

    Parameters
    ----------
    samples : int
        Points at which the density is looked at, for each of the closest rows.
    """
    finest = min([size, *(r.size for r in refinements)])
    count = max(samples, math.ceil(samples * (end - start) / finest))
    z = np.linspace(start, end, count + 1)
    sizes = np.full(len(z), float(size))
    for r in refinements:
        distance = np.maximum(np.abs(z - r.position) - r.reach, 0.0)
        sizes = np.minimum(sizes, r.size + GROWTH * distance)
    density = 1 / sizes
    mean_density = 0.5 * (density[1:] + density[:-1])
    total = np.concatenate([[0.0], np.cumsum(mean_density * np.diff(z))])
    parts = max(1, round(total[-1]))
    ends_of_parts = np.linspace(0.0, total[-1], parts + 1)[1:]
    places = np.interp(ends_of_parts, total, z)
    places[-1] = end
    return places


Masks: TypeAlias = dict[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class TubeLimits:
    """Limits of the mesh of a tube."""

    rounding: float = 1e-9  # in radii: coordinates closer to zero are zero
    largest_count: int = 1_000_000  # quads of a half
    smallest_cap: int = 2  # divisions of a cap's core: eight quads around half of the tube
    # How much longer than asked for a side around the tube may be: where a whole number does not
    # go around, rather more quads than longer ones.
    longest_side: float = 1.05
    # Half of the seam in sides: with less the quads of the cap next to it are bad.
    narrowest_seam: float = 0.25


LIMITS = TubeLimits()
#: Directions of the warp yarn of a cap that are symmetric in both planes.
CAP_WARP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def angles(n: int, seam: float) -> Array:
    """Return angles (4 n + 1,) from the bottom (0) to the top (pi), even but for one at `seam`."""
    quarter = 2 * n
    step = math.pi / (4 * n)
    angle = np.linspace(0.0, math.pi, 2 * quarter + 1)
    if seam:
        in_seam = min(max(1, round(seam / step)), quarter - 1)
        angle[: in_seam + 1] = np.linspace(0.0, seam, in_seam + 1)
        angle[in_seam : quarter + 1] = np.linspace(seam, 0.5 * math.pi, quarter - in_seam + 1)
    return angle


def _on_circle(angle: Array, distance: float | Array = 1.0) -> Array:
    """Return places (n, 2) by angle from the bottom and distance from the axis.

    Parameters
    ----------
    angle, distance : (n,) array
        Radians, and radii.
    """
    places = np.stack([distance * np.sin(angle), -distance * np.cos(angle)], axis=1)
    return snapped(places, LIMITS.rounding)


def tube_grid(angle: Array, z: Array, radius: float) -> tuple[Array, Numbers, Numbers]:
    """Return a tube without caps.

    Parameters
    ----------
    angle, z : (a,), (b,) arrays
        Of the lines and rows of nodes; mm.
    radius : float
        Of the nodes, mm.

    Returns
    -------
    (n, 3) array, (m, 4) array, (b, a) array
        Points in mm, quads row by row, and the numbers of the nodes.
    """
    circle = radius * _on_circle(angle)
    around = np.tile(circle, (len(z), 1))
    along = np.repeat(z, len(angle))[:, None]
    points = np.concatenate([around, along], axis=1)
    grid = np.arange(len(points)).reshape(len(z), len(angle))
    # Around the tube from the bottom to the top, then along z: the normal points out.
    return points, turned_over(grid_quads(grid)), grid


def with_cap(
    points: Array,
    quads: Numbers,
    grid: Numbers,
    angle: Array,
    n: int,
) -> tuple[Array, Numbers, int]:
    """Return the tube of `tube_grid` with the half disk that closes it.

    Parameters
    ----------
    points : (nodes, 3) array, mm
    quads : (q, 4) array of int
    grid : (rows, columns) array of int
        Numbers of the tube's nodes, by row along the tube and by angle.
    angle : (columns,) array
        Angles of the nodes from the bottom, 0 to pi radians.
    n : int
        Divisions of the core of a quarter of the disk, see `divided_quarter_disk`.

    Returns
    -------
    points, quads : (nodes, 3) and (q, 4) arrays
        Those of the tube first.
    int
        Number of the tube's quads.
    """
    quarter, quarter_quads = divided_quarter_disk(n, max(1, round(n / 2)))
    disk, disk_quads, _ = with_mirror_image(snapped(quarter, LIMITS.rounding), quarter_quads, 1)
    disk_angle = np.arctan2(disk[:, 0], -disk[:, 1])
    distance = np.hypot(disk[:, 0], disk[:, 1])
    even = np.linspace(0.0, math.pi, len(angle))
    # Turned with the square of the radius, so that the rim meets the tube's rows of nodes.
    turn_of_rim = np.interp(disk_angle, even, angle) - disk_angle
    disk_angle += distance**2 * turn_of_rim
    radius = -points[grid[0, 0], 1]
    flat = radius * _on_circle(disk_angle, distance)
    is_rim = distance > 1 - LIMITS.rounding
    rim_lines = np.argmin(np.abs(disk_angle[is_rim, None] - angle), axis=1)
    inner_count = np.count_nonzero(~is_rim)
    number = np.empty(len(disk), dtype=np.intp)
    number[is_rim] = grid[-1, rim_lines]
    number[~is_rim] = len(points) + np.arange(inner_count)
    end = points[grid[-1, 0], 2]
    inner_points = np.column_stack([flat[~is_rim], np.full(inner_count, end)])
    all_points = np.concatenate([points, inner_points])
    all_quads = np.concatenate([quads, number[disk_quads]])
    return all_points, all_quads, len(quads)


def cylinder_mesh(
    length: float,
    diameter: float,
    size: float,
    seam_width: float = 0.0,
    symmetry: Literal["quarter", "full"] = "quarter",
    refinements: Sequence[RefinedZone] = (),
    cap_warp: Literal["x", "y"] = "x",
    around: float = 1.0,
) -> Mesh:
    """Mesh the middle surface of a cylinder with flat caps.

    Nodes of the tube lie further out than the radius, so that polygons have the area of the circle.

    Parameters
    ----------
    length, diameter, size, seam_width : float
        mm; the seam lies at the bottom.
    symmetry : "quarter" or "full"
        The quarter x, z >= 0, or all of it.
    refinements : sequence of RefinedZone
        Along z >= 0.
    cap_warp : "x" or "y"
        Direction of the warp on the caps; on the tube it is z.
    around : float
        Sides around the tube over `size`; a multiple of eight quads is taken.

    Returns
    -------
    Mesh
        Normals point out. Element sets: `body`, `seam`, `caps`. Node sets: the nodes of each,
        `ends`, `mid_span` (z = 0), `top_line`, `bottom_line`, `side_line`, `cap_centres`, the row
        of each refinement, and NAME_bottom; on a quarter `symmetry_x`, `symmetry_z`.

    Raises
    ------
    InputError
        For sizes that do not fit each other, or too many elements.
    """
    _check_sizes(length, diameter, size, seam_width, around)
    radius = 0.5 * diameter
    z = rows(0.5 * length, size, refinements)
    n = _cap_divisions(radius, around * size, len(z) - 1, size, symmetry)
    seam_angle = 0.5 * seam_width / radius
    angle = angles(n, seam_angle)
    # Nodes are so far out that they enclose the area of the circle.
    node_radius = radius * math.sqrt(math.pi / float(np.sin(np.diff(angle)).sum()))
    points, quads, grid = tube_grid(angle, z, node_radius)
    points, quads, tube_count = with_cap(points, quads, grid, angle, n)

    is_cap = np.arange(len(quads)) >= tube_count
    is_seam = np.zeros(len(quads), bool)
    if seam_width:
        is_seam_row = angle[1:] <= seam_angle * (1 + LIMITS.rounding)
        is_seam[:tube_count] = np.tile(is_seam_row, len(z) - 1)
    elements: Masks = {"body": ~is_seam & ~is_cap, "caps": is_cap}
    if seam_width:
        elements["seam"] = is_seam
    numbers = np.arange(len(points))
    nodes = {name: np.isin(numbers, quads[mask]) for name, mask in elements.items()}
    nodes |= _lines(grid, points, z, refinements)
    if symmetry == "full":
        for axis in (0, 2):
            points, quads, source = with_mirror_image(points, quads, axis)
            nodes = {name: mask[source] for name, mask in nodes.items()}
            elements = {name: np.tile(mask, 2) for name, mask in elements.items()}
    else:
        nodes |= {"symmetry_x": points[:, 0] == 0, "symmetry_z": points[:, 2] == 0}
    warp = np.where(elements["caps"][:, None], CAP_WARP[cap_warp], (0.0, 0.0, 1.0))
    node_sets = {name: np.flatnonzero(mask) for name, mask in nodes.items()}
    element_sets = {name: np.flatnonzero(mask) for name, mask in elements.items()}
    return Mesh(points, quads, node_sets, element_sets, warp)


def _cap_divisions(
    radius: float,
    side: float,
    row_count: int,
    size: float,
    symmetry: str,
) -> int:
    """Return the divisions of a cap's core; InputError for too many elements."""
    divisions = math.pi * radius / (4 * LIMITS.longest_side * side)
    n = max(LIMITS.smallest_cap, math.ceil(divisions))
    half = 8 * n * row_count + 3 * n * n
    if half > LIMITS.largest_count:
        problem = (
            f"{size:g} mm gives more than {LIMITS.largest_count} elements a half; make them larger"
        )
        raise InputError(None, "size", problem)
    check_memory(half // 2 if symmetry == "quarter" else 2 * half, "size")
    return n


def _check_sizes(
    length: float,
    diameter: float,
    size: float,
    seam_width: float,
    around: float,
) -> None:
    """Raise InputError where sizes (mm) do not fit each other."""
    if not size <= 0.5 * min(diameter, length):
        problem = f"expected at most the radius and half the length, got {size:g} mm"
        raise InputError(None, "size", problem)
    if seam_width > math.pi * diameter / 4:
        problem = f"{seam_width:g} mm is more than a quarter of the tube's circumference"
        raise InputError(None, "seam_width", problem)
    sides_in_seam = 2 * LIMITS.narrowest_seam * around
    if 0 < seam_width < sides_in_seam * size:
        problem = (
            f"{seam_width:g} mm is too narrow for elements of {size:g} mm; make them"
            f" {seam_width / sides_in_seam:g} mm or smaller"
        )
        raise InputError(None, "seam_width", problem)


def _lines(
    grid: Numbers,
    points: Array,
    z: Array,
    refinements: Sequence[RefinedZone],
) -> Masks:
    """Return masks (nodes,) of the lines along and around the tube, and of the caps' centres.

    Parameters
    ----------
    grid : (rows, columns) array of int
        Numbers of the tube's nodes, by row along the tube and by angle.
    points : (nodes, 3) array, mm
    z : (rows,) array, mm
        Position of each row along the tube.
    refinements : sequence of RefinedZone
    """
    middle = grid.shape[1] // 2
    members = {
        "ends": grid[-1],
        "mid_span": grid[0],
        "bottom_line": grid[:, 0],
        "side_line": grid[:, middle],
        "top_line": grid[:, -1],
        "cap_centres": np.flatnonzero((points[:, :2] == 0).all(axis=1)),
    }
    for refinement in refinements:
        row = grid[int(np.argmin(np.abs(z - refinement.position)))]
        members[refinement.name] = row
        members[f"{refinement.name}_bottom"] = row[:1]
    numbers = np.arange(len(points))
    return {name: np.isin(numbers, nodes) for name, nodes in members.items()}
