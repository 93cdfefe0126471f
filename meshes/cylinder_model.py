"""The inflated cylinder in three-point bending as plain data."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .mesh import Array, Mesh, keep_levels, places_of
from .tube import Refinement, cylinder_mesh

#: Inner diameter and length (mm) of the collar by the largest diameter of cylinder (thesis 6.2).
COLLARS = {200.0: (240.0, 145.0), 250.0: (295.0, 147.0)}


@dataclass(frozen=True)
class Collar:
    """A frictionless ring (mm) around the tube, pulled down; fillet : of its inner edges.

    spacing : between the middles of two such rings, which go down together; 0: one.
    """

    inner_diameter: float
    length: float
    fillet: float = 10.0
    spacing: float = 0.0

    def __post_init__(self) -> None:
        if self.fillet > 0.5 * self.length:
            problem = f"{self.fillet:g} mm is more than half the length, {self.length:g}"
            raise InputError(None, "collar.fillet", problem)
        if 0 < self.spacing < self.length:
            problem = f"rings of {self.length:g} mm at {self.spacing:g} mm overlap"
            raise InputError(None, "collar.spacing", problem)

    @property
    def end(self) -> float:
        """Return how far from the middle of the tube it reaches, mm."""
        return 0.5 * (self.spacing + self.length)


@dataclass(frozen=True)
class RigidSupports:
    """Two frictionless cylinders along x under the tube, at z = span / 2 and -span / 2, mm.

    saddle : a shell around the tube in place of each, which holds it as the ring does.
    """

    span: float = 2000.0
    diameter: float = 100.0
    saddle: Collar | None = None

    @property
    def width(self) -> float:
        """Return that of a support along the tube, mm."""
        return self.diameter if self.saddle is None else self.saddle.length


def usual_collar(diameter: float) -> Collar:
    """Return the collar for a diameter (mm); raise InputError if that is too large."""
    for largest, (inner, length) in COLLARS.items():
        if diameter <= largest:
            return Collar(inner, length)
    problem = f"there is none for {diameter:g} mm; give inner_diameter and length"
    raise InputError(None, "collar", problem)


@dataclass(frozen=True)
class ClosedGas:
    """Gas of constant mass and temperature; amount : absolute pressure times volume."""

    amount: float
    ambient: float

    def pressure(self, volume: float) -> float:
        return self.amount / volume - self.ambient

    def stiffness(self, volume: float) -> float:
        """Return the loss of pressure per volume, -dp/dV (MPa/mm^3)."""
        return self.amount / volume**2


@dataclass(frozen=True)
class Gas:
    """Air as the thesis has it; gauge pressures are above `ambient` (MPa), density kg/m^3 there.

    constant : while the cylinder is bent; the pressure, where a pump or a valve keeps it.
    """

    ambient: float = 0.101
    temperature: float = 300.0
    density: float = 1.2041
    constant: Literal["mass", "pressure"] = "mass"

    def closed_in(self, gauge: float, volume: float) -> ClosedGas:
        """Return the gas that fills a volume (mm^3) at a gauge pressure (MPa), and stays in it."""
        return ClosedGas((gauge + self.ambient) * volume, self.ambient)


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Force (N) of a cord by its engineering strain, both (n,) and rising; straight in between.

    Beyond either end its outer slope goes on; without force below the first strain where a cord
    carries tension only.
    """

    strain: Array
    force: Array

    def __post_init__(self) -> None:
        for name in ("strain", "force"):
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 1 or len(values) < 2 or not (np.diff(values) > 0).all():
                raise InputError(None, name, "expected two or more numbers, each above the last")
            object.__setattr__(self, name, values)
        if len(self.strain) != len(self.force):
            problem = f"expected as many as strains, {len(self.strain)}, got {len(self.force)}"
            raise InputError(None, "force", problem)

    def pull(self, strain: ArrayLike, tension_only: bool = True) -> tuple[Array, Array]:
        """Return force (N) and its derivative by strain (N), as the shape of `strain`."""
        e = np.asarray(strain, dtype=float)
        i = np.clip(np.searchsorted(self.strain, e) - 1, 0, len(self.strain) - 2)
        slope = np.diff(self.force)[i] / np.diff(self.strain)[i]
        force = self.force[i] + slope * (e - self.strain[i])
        if tension_only:
            slack = force < 0
            force = np.where(slack, 0.0, force)
            slope = np.where(slack, 0.0, slope)
        return force, slope

    def strain_at(self, force: float) -> float:
        """Return the strain at a force, N."""
        i = int(np.clip(np.searchsorted(self.force, force) - 1, 0, len(self.force) - 2))
        share = (force - self.force[i]) / (self.force[i + 1] - self.force[i])
        return float(self.strain[i] + share * (self.strain[i + 1] - self.strain[i]))


@dataclass(frozen=True, eq=False)
class Cord:
    """A cord along a cylinder, from end to end: bonded, or sliding in loops, one force all along.

    angle : degrees from the top. initial_force : N once the cylinder is inflated (it rises with the
    pressure, and strain counts from there); None: the cord is stretched by the inflation, with
    `prestrain` beside the strain of the wall.
    """

    angle: float
    table: ForceTable
    initial_force: float | None = None
    prestrain: float = 0.0
    tension_only: bool = True
    bonded: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.angle < 360:
            raise InputError(None, "angle", f"expected 0 to below 360 degrees, got {self.angle:g}")
        if self.initial_force is not None and not 0 <= self.initial_force < math.inf:
            problem = f"expected 0 N or more, got {self.initial_force:g}"
            raise InputError(None, "initial_force", problem)
        if self.initial_force is not None and self.prestrain:
            raise InputError(None, "prestrain", "give either this or initial_force")


def alike(one: Any, other: Any) -> bool:
    """Return whether two cords have the same force by the same strain, wherever they lie."""
    names = ("initial_force", "prestrain", "tension_only", "bonded")
    same = all(getattr(one, name) == getattr(other, name) for name in names)
    mine, theirs = ([own.table.strain, own.table.force] for own in (one, other))
    return same and np.array_equal(mine, theirs)


#: Unless given, in diameters of the cylinder: where loads are listed, and the deflection over which
#: a slope is taken.
PLACES, SLOPE_OVER = (0.25, 0.5, 1.0), 0.1


@dataclass(frozen=True)
class CurveReading:
    """Places at which a curve is read: mm of deflection, by label ("40 mm", "0.25 diameters").

    slope_over : mm: the initial stiffness is the slope up to here; the knee, where it has fallen.
    """

    places: Mapping[str, float]
    slope_over: float

    def __post_init__(self) -> None:
        for name, value in (*self.places.items(), ("slope_over", self.slope_over)):
            if not value > 0:
                raise InputError(None, name, f"expected more than 0 mm, got {value:g}")


def curve_reading(
    diameter: float, places: Sequence[float] | None = None, slope_over: float | None = None
) -> CurveReading:
    """Return places and slopes as given (mm), or by the diameter (mm)."""
    if places is None:
        named = {f"{share:g} diameters": share * diameter for share in PLACES}
    else:
        named = {f"{place:g} mm": place for place in places}
    return CurveReading(named, SLOPE_OVER * diameter if slope_over is None else slope_over)


NEAR = 1e-9  # of a length


@dataclass(frozen=True, eq=False)
class CylinderModel:
    """A cylinder that is inflated, closed, and bent by a collar between two supports.

    First the gauge pressure rises over `inflation` (MPa), the bottom held in height at the
    supports. Then the gas is closed in, its mass constant, and the cylinder lies free on the
    supports while the collar goes down. Reported: the inflated state, then every one of
    `deflections` (mm of the collar since it touched); load in N, pressure and volume, all of the
    WHOLE cylinder (`copies` of the mesh).

    mesh : as `cylinder_mesh` makes it: z along the axis, y up, seam at the bottom, `warp` in each
    quad, rows `support` and `support_bottom` at z = span / 2. thickness : (quads,) mm. increments :
    mm, containing every deflection: the steps of the law. reading : changes no result. weight :
    N/mm^2 of one layer, which pulls the tube down once it is inflated.
    """

    mesh: Mesh
    thickness: Array
    inflation: Sequence[float]
    deflections: Sequence[float]
    collar: Collar
    supports: RigidSupports = field(default_factory=RigidSupports)
    gas: Gas = field(default_factory=Gas)
    increments: Sequence[float] = ()
    reading: CurveReading = None  # type: ignore[assignment]
    cords: Sequence[Cord] = ()
    weight: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "thickness", np.array(self.thickness, float))
        if self.reading is None:
            object.__setattr__(self, "reading", curve_reading(self.diameter))
        steps = self.increments if len(self.increments) else self.deflections
        keep_levels(self, inflation=self.inflation, deflections=self.deflections, increments=steps)
        wanted = np.array(self.deflections)
        near = np.abs(np.array(self.increments)[:, None] - wanted).min(axis=0)
        if (near > 1e-9 * wanted).any():
            raise InputError(None, "increments", "must contain every reported deflection")
        self._check_bodies()

    def _check_bodies(self) -> None:
        p = self.mesh.points
        half = np.abs(p[:, 2]).max()
        diameter = self.diameter
        row = np.abs(p[self.mesh.node_sets["support"], 2])
        if not np.allclose(row, 0.5 * self.supports.span, rtol=NEAR):
            problem = f"{self.supports.span:g} mm, but the mesh has its row at {row[0]:g} mm"
            raise InputError(None, "supports.span", problem)
        if not 0.5 * (self.supports.span + self.supports.width) < half:
            problem = f"{self.supports.span:g} mm does not fit under {2 * half:g} mm of cylinder"
            raise InputError(None, "supports.span", problem)
        for key, ring in (("collar", self.collar), ("saddle", self.supports.saddle)):
            if ring is not None and not ring.inner_diameter > diameter * (1 + NEAR):
                problem = f"expected more than the cylinder's {diameter:g} mm"
                raise InputError(None, f"{key}.inner_diameter", problem)
        if not 2 * self.collar.end < self.supports.span - self.supports.width:
            problem = f"{2 * self.collar.end:g} mm reaches the supports"
            raise InputError(None, "collar.length", problem)

    @property
    def diameter(self) -> float:
        return self.diameter_at(self.mesh.points)

    def diameter_at(self, points: Array) -> float:
        """Return that of the circle (mm) with the area of the ring at mid-span."""
        ring = self.mesh.node_sets["mid_span"]
        across, up = self.mesh.points[ring, :2].T
        x, y = points[ring[np.argsort(np.arctan2(across, -up))], :2].T
        # On a quarter the last side, from the top to the bottom, lies in the plane of symmetry.
        area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        return float(np.sqrt((8.0 if self._cut("x") else 4.0) * area / np.pi))

    @property
    def pressure(self) -> float:
        return self.inflation[-1]

    @property
    def copies(self) -> int:
        return int(2 ** sum(f"symmetry_{axis}" in self.mesh.node_sets for axis in "xz"))

    @property
    def reported(self) -> NDArray[np.intp]:
        return places_of(self.deflections, self.increments)

    @property
    def guides(self) -> Mapping[str, tuple[int, ...]]:
        """Return the directions held at zero throughout, by node set: the planes of symmetry.

        Frictionless supports hold the whole cylinder in height only: lines of it stay in those
        planes.
        """
        sideways = ("symmetry_x",) if self._cut("x") else ("top_line", "bottom_line")
        along = "symmetry_z" if self._cut("z") else "mid_span"
        return {**{name: (0,) for name in sideways}, along: (2,)}

    def _cut(self, axis: str) -> bool:
        return f"symmetry_{axis}" in self.mesh.node_sets


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RigidCylinder:
    """A rigid post (infinitely long) that the membrane lies on, or a ring around it, mm.

    name : bodies of one name have one reaction. radius : outside of a post, inside of a ring.
    length, fillet : of a ring and its mouth.
    """

    name: str
    axis: Vector
    centre: Vector
    radius: float
    ring: bool = False
    length: float = np.inf
    fillet: float = 10.0


@dataclass(frozen=True, eq=False)
class Bending:
    """Rigid cylinders that bend an inflated membrane with a constant mass of gas in it.

    supports : at rest, brought to touch. collars : move along `direction` from touching by
    `displacements` (mm): the increments. reported : index of each that is a frame. released : node
    set held only while inflating. penalty : MPa/mm of contact. weight : N/mm^2 of the thinnest
    wall, along `direction`.
    """

    supports: Sequence[RigidCylinder]
    collars: Sequence[RigidCylinder]
    displacements: Sequence[float]
    direction: Vector = (0.0, -1.0, 0.0)
    released: str | None = None
    penalty: float = 5.0
    gas: Gas = field(default_factory=Gas)
    reported: Sequence[int] | None = None
    weight: float = 0.0


@dataclass(frozen=True, eq=False)
class InflatedModel:
    """A closed membrane of any shape, or the part of one that symmetry planes close.

    mesh : quads counter-clockwise seen from outside. thickness : mm, one or (elements,). warp :
    (3,) or (elements, 3), projected on each facet. pressures : MPa: increments of inflation, and
    frames where nothing bends it. supports : degrees of freedom held at zero, by node set. copies :
    of the mesh in the whole, of which forces and volume are reported. cords : bonded to quads of a
    tube along z.
    """

    mesh: Mesh
    thickness: ArrayLike
    warp: ArrayLike
    pressures: Sequence[float]
    supports: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    copies: int = 1
    bending: Bending | None = None
    cords: Sequence[Cord] = ()

    def fixed(self, bent: bool = False) -> NDArray[np.intp]:
        """Return held unknowns, 3 * node + direction, sorted; fewer once `bent`."""
        released = self.bending.released if bent and self.bending else None
        return self.mesh.unknowns({n: ks for n, ks in self.supports.items() if n != released})


#: mm, unless given; as many layers of fabric lie upon each other in the seam.
LENGTH, SEAM_WIDTH, SEAM_LAYERS = 3000.0, 40.0, 3
#: How far the collar goes, mm, and in how many equal steps, unless given.
DEFLECTION, FRAMES = 240.0, 60
#: Equal increments of pressure on inflation.
INFLATION = 10
#: Sides around the tube over mm of an element: with sides of 25 mm the load of the first mm
#: of the collar was 3 % off that of fine meshes.
AROUND = 0.4
#: Elements next to collar and supports: mm along the axis over mm elsewhere, and mm beyond the
#: collar or to either side of a support; with half of it the collar took hold row by row (2 %).
FINER, BESIDE_COLLAR, BESIDE_SUPPORT = 0.25, 15.0, 40.0


def inflated_cylinder(
    diameter: float,
    pressure: float,
    thickness: float,
    size: float,
    length: float = LENGTH,
    seam_width: float = SEAM_WIDTH,
    supports: RigidSupports | None = None,
    collar: Collar | None = None,
    deflections: Sequence[float] | None = None,
    symmetry: Literal["quarter", "full"] = "quarter",
    cap_warp: Literal["x", "y"] = "x",
    gas: Gas | None = None,
    reading: CurveReading | None = None,
    cords: Sequence[Cord] = (),
    weight: float = 0.0,
) -> CylinderModel:
    """Return a cylinder that is inflated and bent; lengths in mm before inflation, pressure in MPa.

    thickness : of one layer; the seam has three. size : of an element; around the tube 0.4 of that,
    and along it a quarter next to collar and supports. deflections : 60 equal ones to 240 mm unless
    given.
    """
    supports = supports or RigidSupports()
    collar = collar or usual_collar(diameter)
    # Before the mesh is made, which would complain of rows where the supports are.
    if not supports.span + supports.width < length:
        problem = f"{supports.span:g} mm does not fit under {length:g} mm of cylinder"
        raise InputError(None, "supports.span", problem)
    fine = FINER * size
    beside = BESIDE_SUPPORT
    if supports.saddle is not None:
        beside = 0.5 * supports.saddle.length + BESIDE_COLLAR
    zones = (
        Refinement("collar", 0.5 * collar.spacing, 0.5 * collar.length + BESIDE_COLLAR, fine),
        Refinement("support", 0.5 * supports.span, beside, fine),
    )
    mesh = cylinder_mesh(length, diameter, size, seam_width, symmetry, zones, cap_warp, AROUND)
    layers = np.ones(len(mesh.quads))
    if "seam" in mesh.element_sets:
        layers[mesh.element_sets["seam"]] = SEAM_LAYERS
    if deflections is None:
        deflections = np.linspace(0.0, DEFLECTION, FRAMES + 1)[1:].tolist()
    steps = np.linspace(0.0, pressure, INFLATION + 1)[1:].tolist()
    return CylinderModel(
        mesh,
        thickness * layers,
        steps,
        deflections,
        collar,
        supports,
        gas or Gas(),
        reading=reading or curve_reading(diameter),
        cords=cords,
        weight=weight,
    )
