"""Quadrilateral meshes of the flat specimen, whole or a quarter: core and two ring blocks."""

import math
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import BubblefitError, InputError
from .mesh import Array, Mesh, check_memory, grid_quads, snapped, with_mirror_image

#: Layers of the ring for each division of the core, at least and at most: beyond, elements are
#: drawn out.
THINNEST, THICKEST = 1 / 3, 1.0
#: Radial size of the ring's elements over the size of the core's; 1.2 keeps the largest element
#: of the thesis' mesh within 2.3 times the smallest.
RING_TO_CORE = 1.2


def divided_quarter_disk(n: int, m: int) -> tuple[Array, NDArray[np.intp]]:
    """Mesh x, y >= 0 of the unit disk: n divisions of the core, m rings, 2 n + 1 rim nodes."""
    core, ring = _core_and_ring(n, m)
    core_nodes = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    # The core's two far sides, from the x axis to the y axis, are the ring's first layer.
    side = np.concatenate([core_nodes[n, :], core_nodes[-2::-1, n]])
    outer_nodes = len(core_nodes.ravel()) + np.arange(m * len(side)).reshape(m, len(side))
    ring_nodes = np.concatenate([side[None], outer_nodes])
    points = np.concatenate([core.reshape(-1, 2), ring[1:].reshape(-1, 2)])
    return points, np.concatenate([grid_quads(core_nodes), grid_quads(ring_nodes)])


def divisions(elements: float) -> tuple[int, int]:
    """Return core divisions n and ring layers m whose n^2 + 2 n m is nearest to `elements`."""
    best = (math.inf, math.inf, 1, 1)
    for n in range(1, math.isqrt(math.ceil(elements)) + 2):
        ideal = round((elements - n * n) / (2 * n))
        m = min(max(ideal, math.ceil(THINNEST * n)), max(1, math.floor(THICKEST * n)))
        best = min(best, (abs(n * n + 2 * n * m - elements), abs(m / n - 0.5), n, m))
    return best[2], best[3]


def _core_and_ring(n: int, m: int) -> tuple[Array, Array]:
    """Return points (n + 1, n + 1, 2) of the core and (m + 1, 2 n + 1, 2) of the ring."""
    # The last chord of a side should lie at 105 degrees: 60 from the diagonal, on either side
    # of it. A chord of n lags half a division behind its arc, hence the factor.
    turn = math.radians(15) * 2 * n / (2 * n - 1)
    # The ring is 1 - 1.27 k deep on average, the core's elements about k / n wide.
    k = 1 / (1.27 + RING_TO_CORE * m / n)
    t = np.linspace(0, 1, n + 1)
    right = _arc(np.array([k * (1 + math.tan(turn / 2)), 0.0]), np.array([k, k]), turn, t)
    top = right[:, ::-1]
    floor = np.stack([right[0, 0] * t, np.zeros(n + 1)], axis=1)
    core = _transfinite(floor, top, floor[:, ::-1], right)
    inner = np.concatenate([right, top[-2::-1]])
    angle = np.linspace(0, np.pi / 2, 2 * n + 1)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    depth = np.linspace(0, 1, m + 1)[:, None, None]
    return core, (1 - depth) * inner + depth * rim


def _arc(start: Array, end: Array, turn: float, t: Array) -> Array:
    """Return points (len(t), 2) of an arc that turns left by `turn` between two points."""
    chord = end - start
    length = np.sin(turn * t / 2) / math.sin(turn / 2)
    lean = -turn * (1 - t) / 2
    c = np.cos(lean)
    s = np.sin(lean)
    direction = np.stack([c * chord[0] - s * chord[1], s * chord[0] + c * chord[1]], axis=1)
    return np.asarray(start + length[:, None] * direction)


def _transfinite(floor: Array, top: Array, left: Array, right: Array) -> Array:
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
    return np.asarray(along_u + along_v - corners)


MIN_ELEMENTS, MAX_ELEMENTS = 8, 4_000_000
#: Nodes nearer to a symmetry line or the rim than this, in radii, are put on it.
NEAR = 1e-9


def check_disk_memory(elements: int, symmetry: str) -> None:
    """Raise InputError where an analysis of so many quads on the full disk is too large."""
    check_memory(elements if symmetry == "full" else elements // 4, "elements")


def disk_mesh(
    radius: float,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh a disk of `radius` mm in the xy plane around the origin, or its quarter x, y >= 0.

    elements : wanted on the FULL disk, 8 or more; the number made is within 16 below 200 and 7 %
    above. Node sets: `rim`, `apex`; on a quarter also `symmetry_x` (u_x = 0), `symmetry_y`.
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


def monomials(count: int) -> list[tuple[int, int]]:
    """Return powers (of x, of y) of the first `count` monomials: 1; x, y; x^2, xy, y^2; x^3 ..."""
    powers: list[tuple[int, int]] = []
    degree = 0
    while len(powers) < count:
        powers += [(a, degree - a) for a in range(degree, -1, -1)]
        degree += 1
    return powers[:count]


def disk_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return `count` modes (1 - r^2) x^a y^b at points (n, 2) mm over the radius: z0_1, z0_x ..."""
    x = points[:, 0] / radius
    y = points[:, 1] / radius
    dome = 1.0 - x**2 - y**2
    return {
        f"z0_{'x' * a}{'y' * b}" if a + b else "z0_1": dome * x**a * y**b
        for a, b in monomials(count)
    }


#: Components of a strain of the stress-free sheet.
METRIC = ("warp", "fill", "shear")


def metric_modes(points: Array, radius: float, count: int) -> dict[str, Array]:
    """Return strains (n, 3) of warp, fill and shear alone, each times `count` monomials of x, y in
    radii at points (n, 2) mm: metric_warp_1, metric_warp_x ..."""
    x, y = points.T / radius
    return {
        f"metric_{of}_{'x' * a + 'y' * b or 1}": np.outer(x**a * y**b, np.eye(3)[k])
        for k, of in enumerate(METRIC)
        for a, b in monomials(count)
    }


def doubly_symmetric(count: int) -> bool:
    """Return whether the first `count` modes are all even in x and in y."""
    return all(a % 2 == 0 and b % 2 == 0 for a, b in monomials(count))


@dataclass(frozen=True)
class Outline:
    """An ellipse in the sheet's plane: semi-axes (mm), degrees from the warp to the major."""

    major: float
    minor: float
    angle: float = 0.0

    @classmethod
    def circle(cls, radius: float) -> Self:
        return cls(radius, radius)

    @property
    def round(self) -> bool:
        return self.major == self.minor

    @property
    def doubly_symmetric(self) -> bool:
        return self.round or self.angle % 90.0 == 0.0

    @property
    def radius(self) -> float:
        """Return the mean of the semi-axes, mm, with which lengths are compared."""
        return self.minor + 0.5 * (self.major - self.minor)

    @property
    def words(self) -> str:
        if self.round:
            return f"radius {self.major:g} mm"
        return f"semi-axes {self.major:g} and {self.minor:g} mm"

    @property
    def stretch(self) -> Array:
        """Return the symmetric map (2, 2) mm of the unit disk onto the disk."""
        turn = np.radians(self.angle)
        # The axes along the yarns are exactly so: 6e-17 would move nodes off lines of symmetry.
        along = np.round([np.cos(turn), np.sin(turn)], 15)
        return np.asarray(
            self.minor * np.eye(2) + (self.major - self.minor) * np.outer(along, along)
        )

    def places(self, points: Array) -> Array:
        """Return (n, 2) mm of points (n, 2) of the unit disk."""
        return np.asarray(points @ self.stretch)

    def unit(self, places: Array) -> Array:
        """Return (n, 2), points of the unit disk from places (n, 2) mm; the inverse of `places`."""
        if self.round:
            return np.asarray(places / self.major)
        return np.asarray(places @ np.linalg.inv(self.stretch))

    def share(self, places: Array) -> Array:
        """Return (n,) of places (n, 2) mm: 0 at the centre, 1 on the edge."""
        return np.asarray(np.hypot(*self.unit(places).T))

    def edge(self, count: int = 181) -> Array:
        """Return (count, 2) mm, once around, the last point the first."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return self.places(np.column_stack([np.cos(turn), np.sin(turn)]))


#: Major over minor semi-axis: a more slender ellipse has quads that are hardly quads any more.
MOST_SLENDER = 4.0


def elliptic_disk_mesh(
    outline: Outline,
    elements: int,
    symmetry: Literal["full", "quarter"] = "full",
    generator: Literal["blocks", "gmsh"] = "blocks",
) -> Mesh:
    """Mesh the sheet within an outline, in the xy plane; a circle has the mesh of `disk_mesh`."""
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


QUAD = 3  # gmsh's number of the element type
ATTEMPTS = 5  # at the size of triangle that gives the count wanted


def quarter_disk_by_gmsh(elements: float) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Mesh the quarter by gmsh, unstructured: triangles, each cut into three quads."""
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


def rim_form(points: Array) -> Array:
    """Return the symmetric Q (2, 2), 1/mm^2, with p Q p = 1 at rim nodes p (n, 2)."""
    size = float(np.abs(points).max())
    x, y = points.T / size
    terms = np.stack([x * x, 2 * x * y, y * y], axis=1)
    (xx, xy, yy), *_ = np.linalg.lstsq(terms, np.ones(len(points)), rcond=None)
    return np.array([[xx, xy], [xy, yy]]) / size**2


def rim_share(form: Array, points: Array) -> Array:
    """Return (n,) of points (n, 2) mm: 0 at the centre, 1 on the curve of the form."""
    return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", points, form, points)))
