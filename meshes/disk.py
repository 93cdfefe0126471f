"""The disk of the bubble test: its outline, quadrilateral meshes of it, and modes over it.

The outline is a circle, or an ellipse at any angle to the yarns; meshes are made by blocks or by
gmsh.
"""

import math
import signal
from contextlib import suppress
from dataclasses import replace
from types import ModuleType
from typing import Literal, Self

import numpy as np

from ..errors import BubblefitError, InputError
from ..light_dataclasses import dataclass
from .mesh import Array, Mesh, Numbers, check_memory, grid_quads, snapped, with_mirror_image


@dataclass(frozen=True)
class Outline:
    """A circle or an ellipse in the plane of the sheet (x: warp, y: fill), around the origin.

    Attributes
    ----------
    major, minor : float, mm
        Semi-axes, the larger one first.
    angle : float, degrees
        From the warp towards the fill, to the major axis.
    """

    major: float
    minor: float
    angle: float = 0.0

    @classmethod
    def circle(cls, radius: float) -> Self:
        """Return a circle of a radius (mm)."""
        return cls(radius, radius)

    @property
    def round(self) -> bool:
        """Return whether it is a circle."""
        return self.major == self.minor

    @property
    def doubly_symmetric(self) -> bool:
        """Return whether it is symmetric about warp and fill."""
        return self.round or self.angle % 90.0 == 0.0

    @property
    def radius(self) -> float:
        """Return the mean of the semi-axes in mm, as the typical size of the sheet."""
        return self.minor + 0.5 * (self.major - self.minor)

    @property
    def dome_radius(self) -> float:
        """Return the radius in mm of the circular sheet that rises as high as this one, if taut."""
        return float(np.sqrt(2.0) * self.major * self.minor / np.hypot(self.major, self.minor))

    @property
    def words(self) -> str:
        """Return the radius or the semi-axes in words."""
        if self.round:
            return f"radius {self.major:g} mm"
        return f"semi-axes {self.major:g} and {self.minor:g} mm"

    @property
    def stretch(self) -> Array:
        """Return the symmetric matrix (2, 2) mm that maps the unit disk onto the sheet."""
        turn = np.radians(self.angle)
        # The axes along the yarns are exactly so: 6e-17 would move nodes off lines of symmetry.
        along = np.round([np.cos(turn), np.sin(turn)], 15)
        return self.minor * np.eye(2) + (self.major - self.minor) * np.outer(along, along)

    def places(self, points: Array) -> Array:
        """Return the places (n, 2) mm on the sheet of points (n, 2) of the unit disk."""
        return points @ self.stretch

    def unit(self, places: Array) -> Array:
        """Return the points (n, 2) of the unit disk that `places` maps to places (n, 2) mm."""
        if self.round:
            return places / self.major
        return places @ np.linalg.inv(self.stretch)

    def share(self, places: Array) -> Array:
        """Return the relative distance (n,) of places (n, 2) mm: 0 at the centre, 1 on the edge."""
        return np.hypot(*self.unit(places).T)

    def edge(self, count: int = 181) -> Array:
        """Return points (count, 2) mm around the edge; the last one is the first one again."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return self.places(np.column_stack([np.cos(turn), np.sin(turn)]))


def rim_form(points: Array) -> Array:
    """Return the matrix Q (2, 2), 1/mm^2, of the ellipse p' Q p = 1 through nodes of a rim.

    Parameters
    ----------
    points : array
        Positions p of the nodes, (n, 2) mm; Q is fitted to them by least squares.
    """
    size = float(np.abs(points).max())
    x, y = points.T / size
    terms = np.stack([x * x, 2 * x * y, y * y], axis=1)
    (xx, xy, yy), *_ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    return np.array([[xx, xy], [xy, yy]]) / size**2


def rim_share(form: Array, points: Array) -> Array:
    """Return the relative distance (n,) of points (n, 2) mm: 0 at the centre, 1 on the ellipse.

    Parameters
    ----------
    form : array
        Matrix of the ellipse, see `rim_form`.
    """
    return np.sqrt(np.einsum("ni,ij,nj->n", points, form, points))


def quarter_disk_by_gmsh(elements: float) -> tuple[Array, Numbers]:
    """Mesh the quarter by gmsh, unstructured: points (n, 2) and quads of triangles, three each."""
    gmsh = _load_gmsh()
    # A caller's own gmsh session is left as it was.
    is_ours = not gmsh.isInitialized()
    if is_ours:
        # Not interruptible: gmsh would take Ctrl-C for itself and only works in the main thread.
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        _survive_closed_pipes()
    try:
        return _mesh_with_count(gmsh, elements)
    except Exception as failure:  # gmsh raises nothing more precise
        problem = f'gmsh cannot mesh the disk: {failure}; generator = "blocks" needs no gmsh'
        raise BubblefitError(problem) from failure
    finally:
        if is_ours:
            gmsh.finalize()


def _survive_closed_pipes() -> None:
    """Undo that gmsh lets a write to a closed pipe end the process, instead of an OSError."""
    with suppress(AttributeError, ValueError):  # no such signal, or not in the main thread
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


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


@dataclass(frozen=True)
class DiskProportions:
    """Proportions of the blocks of a quarter of the disk."""

    # Layers of the ring for each division of the core: beyond, elements are drawn out.
    fewest_layers: float = 1 / 3
    largest_layers: float = 1.0
    # Radial size of the ring's elements over the size of the core's: 1.2 keeps the largest element
    # of the thesis' mesh within 2.3 times the smallest.
    ring_to_core: float = 1.2


PROPORTIONS = DiskProportions()


def divided_quarter_disk(n: int, m: int) -> tuple[Array, Numbers]:
    """Mesh x, y >= 0 of the unit disk.

    Parameters
    ----------
    n, m : int
        Divisions of the core, and layers of the ring around it.

    Returns
    -------
    (nodes, 2) array, (quads, 4) array
        2 n + 1 nodes lie on the rim.
    """
    core, ring = _core_and_ring(n, m)
    core_nodes = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    # The core's two far sides, from the x axis to the y axis, are the ring's first layer.
    side = np.concatenate([core_nodes[n, :], core_nodes[-2::-1, n]])
    outer_nodes = core_nodes.size + np.arange(m * len(side)).reshape(m, len(side))
    ring_nodes = np.concatenate([side[None], outer_nodes])
    points = np.concatenate([core.reshape(-1, 2), ring[1:].reshape(-1, 2)])
    return points, np.concatenate([grid_quads(core_nodes), grid_quads(ring_nodes)])


def divisions(elements: float) -> tuple[int, int]:
    """Return core divisions n and ring layers m whose n^2 + 2 n m is nearest to `elements`."""
    best = (math.inf, math.inf, 1, 1)
    for n in range(1, math.isqrt(math.ceil(elements)) + 2):
        ideal = round((elements - n * n) / (2 * n))
        fewest = math.ceil(PROPORTIONS.fewest_layers * n)
        largest = max(1, math.floor(PROPORTIONS.largest_layers * n))
        m = min(max(ideal, fewest), largest)
        count = n * n + 2 * n * m
        best = min(best, (abs(count - elements), abs(m / n - 0.5), n, m))
    return best[2], best[3]


def _core_and_ring(n: int, m: int) -> tuple[Array, Array]:
    """Return points (n + 1, n + 1, 2) of the core and (m + 1, 2 n + 1, 2) of the ring."""
    # The last chord of a side should lie at 105 degrees: 60 from the diagonal, on either side
    # of it. A chord of n lags half a division behind its arc, hence the factor.
    turn = math.radians(15) * 2 * n / (2 * n - 1)
    # The ring is 1 - 1.27 k deep on average, the core's elements about k / n wide.
    k = 1 / (1.27 + PROPORTIONS.ring_to_core * m / n)
    t = np.linspace(0, 1, n + 1)
    foot = np.array([k * (1 + math.tan(turn / 2)), 0.0])
    right = _arc(foot, np.array([k, k]), turn, t)
    top = right[:, ::-1]
    floor = np.stack([right[0, 0] * t, np.zeros(n + 1)], axis=1)
    core = _transfinite(floor, top, floor[:, ::-1], right)
    inner = np.concatenate([right, top[-2::-1]])
    angle = np.linspace(0, np.pi / 2, 2 * n + 1)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    depth = np.linspace(0, 1, m + 1)[:, None, None]
    return core, (1 - depth) * inner + depth * rim


def _arc(
    start: Array,
    end: Array,
    turn: float,
    t: Array,
) -> Array:
    """Return points (len(t), 2) of an arc between two points.

    Parameters
    ----------
    start, end : (2,) array
        Ends of the arc.
    turn : float
        Angle by which the arc turns left, radians.
    t : (n,) array
        Shares of the arc, from 0 to 1.
    """
    chord = end - start
    length = np.sin(turn * t / 2) / math.sin(turn / 2)
    lean = -turn * (1 - t) / 2
    cos = np.cos(lean)
    sin = np.sin(lean)
    x = cos * chord[0] - sin * chord[1]
    y = sin * chord[0] + cos * chord[1]
    direction = np.stack([x, y], axis=1)
    return start + length[:, None] * direction


def _transfinite(
    floor: Array,
    top: Array,
    left: Array,
    right: Array,
) -> Array:
    """Return a Coons patch (u, v, 2): floor, top (u, 2) run along u, left, right (v, 2) along v."""
    u = np.linspace(0, 1, len(floor))[:, None, None]
    v = np.linspace(0, 1, len(left))[None, :, None]
    corners = (
        (1 - u) * (1 - v) * floor[0]
        + u * (1 - v) * floor[-1]
        + (1 - u) * v * top[0]
        + u * v * top[-1]
    )
    along_u = (1 - v) * floor[:, None] + v * top[:, None]
    along_v = (1 - u) * left + u * right
    return along_u + along_v - corners


#: Quads on the full disk.
MIN_ELEMENTS = 8
MAX_ELEMENTS = 4_000_000
#: Nodes nearer to a symmetry line or the rim than this, in radii, are put on it.
ROUNDING = 1e-9


def check_disk_memory(elements: int, symmetry: str) -> None:
    """Raise InputError where an analysis of so many quads on the full disk is too large."""
    check_memory(elements if symmetry == "full" else elements // 4, "elements")


def disk_mesh(
    radius: float,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh a disk in the xy plane around the origin, or its quarter x, y >= 0.

    Parameters
    ----------
    radius : float
        mm.
    elements : int
        Quads wanted on the FULL disk, 8 or more; the mesh has as many within 16 below 200, and
        within 7 % above.
    symmetry : "full" or "quarter"
    generator : "blocks" or "gmsh"

    Returns
    -------
    Mesh
        Node sets: `rim`, `apex`; on a quarter also `symmetry_x` (u_x = 0), `symmetry_y`.

    Raises
    ------
    InputError
        For another number of elements, or more than the memory holds.
    """
    if not MIN_ELEMENTS <= elements <= MAX_ELEMENTS:
        problem = (
            f"expected {MIN_ELEMENTS} to {MAX_ELEMENTS} quads on the full disk, got {elements};"
            " 800 are usual"
        )
        raise InputError(None, "elements", problem)
    check_disk_memory(elements, symmetry)
    if generator == "gmsh":
        points, quads = quarter_disk_by_gmsh(elements / 4)
    else:
        points, quads = divided_quarter_disk(*divisions(elements / 4))
    points = snapped(points, ROUNDING)
    if symmetry == "full":
        for axis in (0, 1):
            points, quads, _ = with_mirror_image(points, quads, axis)
    # Sets are taken in unit radius, where the rim is 1 whatever the unit of length.
    distance = np.hypot(points[:, 0], points[:, 1])
    sets = {
        "rim": np.flatnonzero(distance > 1 - ROUNDING),
        "apex": np.flatnonzero((points == 0).all(axis=1)),
    }
    if symmetry == "quarter":
        sets["symmetry_x"] = np.flatnonzero(points[:, 0] == 0)
        sets["symmetry_y"] = np.flatnonzero(points[:, 1] == 0)
    flat = np.zeros((len(points), 3))
    flat[:, :2] = float(radius) * points
    return Mesh(flat, quads, sets)


#: Major over minor semi-axis: a more slender ellipse has quads that are hardly quads any more.
MOST_SLENDER = 4.0


def check_outline(outline: Outline, symmetry: str) -> None:
    """Raise InputError for an ellipse that cannot be meshed, or not by a quarter."""
    major = f"the major {outline.major:g} mm"
    if not 0 < outline.minor <= outline.major:
        problem = f"expected above 0 and at most {major}, got {outline.minor:g} mm"
        raise InputError(None, "minor", f"{problem}; 'angle' is that of the major semi-axis")
    if outline.major > MOST_SLENDER * outline.minor:
        problem = f"expected at least the {MOST_SLENDER:g}th part of {major}"
        raise InputError(None, "minor", f"{problem}, got {outline.minor:g} mm")
    if symmetry == "quarter" and not outline.doubly_symmetric:
        axes = f"the axes of the ellipse lie at {outline.angle:g} degrees from the yarns"
        raise InputError(None, "symmetry", f"{axes}: needs 'full'")


def elliptic_disk_mesh(
    outline: Outline,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh the sheet within an outline, in the xy plane; a circle has the mesh of `disk_mesh`."""
    check_outline(outline, symmetry)
    disk = disk_mesh(outline.major, elements, symmetry, generator)
    if outline.round:
        return disk
    points = np.array(disk.points)
    points[:, :2] = outline.places(points[:, :2] / outline.major)
    return replace(disk, points=points)


def monomials(count: int) -> list[tuple[int, int]]:
    """Return the powers of x and of y in the first monomials: 1; x, y; x^2, xy, y^2; x^3 ..."""
    powers: list[tuple[int, int]] = []
    degree = 0
    while len(powers) < count:
        powers += [(a, degree - a) for a in range(degree, -1, -1)]
        degree += 1
    return powers[:count]


def _named_monomials(points: Array, count: int) -> dict[str, Array]:
    """Return the values (n,) of the first monomials of x and y by name: 1, x, y, xx, xy ...

    Parameters
    ----------
    points : (n, 2) array
        X and y.
    """
    x = points[:, 0]
    y = points[:, 1]
    return {"x" * a + "y" * b or "1": x**a * y**b for a, b in monomials(count)}


def disk_modes(points: Array, count: int) -> dict[str, Array]:
    """Return the first modes (1 - x^2 - y^2) x^a y^b of the initial height at points, by name.

    Parameters
    ----------
    points : (n, 2) array
        On the unit disk. Names are z0_1, z0_x ... for the powers a and b.
    """
    dome = 1.0 - points[:, 0] ** 2 - points[:, 1] ** 2
    return {f"z0_{name}": dome * values for name, values in _named_monomials(points, count).items()}


#: Names of the components of the strain of a stress-free sheet.
METRIC = ("warp", "fill", "shear")


def metric_modes(points: Array, count: int) -> dict[str, Array]:
    """Return modes (n, 3) of the stress-free strain: one component times a monomial of x and y.

    Parameters
    ----------
    points : (n, 2) array
        On the unit disk.
    count : int
        Number of monomials for each component.

    Returns
    -------
    dict
        Modes by name: metric_warp_1, metric_warp_x ...
    """
    return {
        f"metric_{component}_{name}": np.outer(values, direction)
        for component, direction in zip(METRIC, np.eye(3), strict=True)
        for name, values in _named_monomials(points, count).items()
    }


def doubly_symmetric(count: int) -> bool:
    """Return whether the first `count` monomials are all even in x and in y, as a quarter needs."""
    return all(a % 2 == 0 and b % 2 == 0 for a, b in monomials(count))
