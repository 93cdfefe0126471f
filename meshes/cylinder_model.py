"""The inflated cylinder in three-point bending as plain data."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .mesh import Array, Mesh, keep_levels, places_of
from .tube import RefinedZone, cylinder_mesh

#: Inner diameter and length (mm) of the collar by the largest diameter of cylinder (thesis 6.2).
COLLARS = {200.0: (240.0, 145.0), 250.0: (295.0, 147.0)}
#: Layers of fabric that lie upon each other in the seam.
SEAM_LAYERS = 3
#: Relative difference of lengths that is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class CylinderDefaults:
    """Hold the defaults of a cylinder."""

    length: float = 3000.0  # mm
    seam_width: float = 40.0  # mm
    deflection: float = 240.0  # mm, how far the collar goes
    frames: int = 60  # equal steps to there
    inflation_increments: int = 10  # equal steps of pressure
    places: tuple[float, ...] = (0.25, 0.5, 1.0)  # of listed loads, in diameters
    slope_over: float = 0.1  # deflection over which a slope is taken, in diameters


@dataclass(frozen=True)
class MeshDensity:
    """Sizes of elements over that of the plain tube along its axis.

    With square elements of 25 mm the load of the first mm of the collar was 3 % off that of fine
    meshes; where only 8 mm beyond the collar were fine, it took hold row by row (2 %).
    """

    around: float = 0.4  # sides around the tube
    near_bodies: float = 0.25  # length next to collar and supports
    beyond_collar: float = 15.0  # mm
    around_support: float = 40.0  # mm to either side


DEFAULTS = CylinderDefaults()
DENSITY = MeshDensity()


@dataclass(frozen=True)
class Collar:
    """A frictionless ring around the tube, pulled down.

    Parameters
    ----------
    inner_diameter, length : float
        Size of the ring, mm.
    fillet : float
        Radius of its inner edges, mm.
    spacing : float
        Distance between the middles of two rings that go down together, mm; 0: one ring.
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
        """Return the distance from the middle of the tube to the outer end of the rings, mm."""
        return 0.5 * (self.spacing + self.length)


@dataclass(frozen=True)
class RigidSupports:
    """Two frictionless cylinders along x under the tube, at z = span / 2 and -span / 2.

    Parameters
    ----------
    span, diameter : float
        Distance and diameter of the cylinders, mm.
    saddle : Collar, optional
        Shell around the tube in place of each cylinder, which holds it as the ring does.
    """

    span: float = 2000.0
    diameter: float = 100.0
    saddle: Collar | None = None

    @property
    def width(self) -> float:
        """Return the width of a support along the tube, mm."""
        return self.diameter if self.saddle is None else self.saddle.length


def usual_collar(diameter: float) -> Collar:
    """Return the collar of the thesis for a cylinder.

    Parameters
    ----------
    diameter : float
        Diameter of the cylinder, mm.

    Raises
    ------
    InputError
        If there is no collar for so large a cylinder.
    """
    for largest_diameter, (inner_diameter, length) in COLLARS.items():
        if diameter <= largest_diameter:
            return Collar(inner_diameter, length)
    problem = f"there is none for {diameter:g} mm; give inner_diameter and length"
    raise InputError(None, "collar", problem)


@dataclass(frozen=True)
class ClosedGas:
    """Gas of constant mass and temperature.

    Parameters
    ----------
    amount : float
        Absolute pressure times volume, MPa mm^3.
    ambient : float
        Pressure outside, MPa.
    """

    amount: float
    ambient: float

    def pressure(self, volume: float) -> float:
        """Return the gauge pressure (MPa) at a volume (mm^3)."""
        return self.amount / volume - self.ambient

    def stiffness(self, volume: float) -> float:
        """Return the loss of pressure per volume, -dp/dV (MPa/mm^3)."""
        return self.amount / volume**2


@dataclass(frozen=True)
class Gas:
    """Air as the thesis has it.

    Parameters
    ----------
    ambient : float
        Pressure outside, MPa, above which gauge pressures are.
    temperature : float
        K.
    density : float
        At ambient pressure, kg/m^3.
    constant : {"mass", "pressure"}
        What stays while the cylinder is bent: the pressure, where a pump or a valve keeps it.
    """

    ambient: float = 0.101
    temperature: float = 300.0
    density: float = 1.2041
    constant: Literal["mass", "pressure"] = "mass"

    def closed_in(self, gauge: float, volume: float) -> ClosedGas:
        """Return the gas that fills a volume (mm^3) at a gauge pressure (MPa)."""
        return ClosedGas((gauge + self.ambient) * volume, self.ambient)


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Force of a cord by its engineering strain: straight between points, and on beyond the ends.

    Parameters
    ----------
    strain, force : (n,) arrays
        Rising; force in N.
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
        """Return force and stiffness at strains.

        Parameters
        ----------
        strain : array_like
        tension_only : bool
            Whether the cord is slack where its force would be negative.

        Returns
        -------
        force, stiffness : arrays
            Force and its derivative by the strain, N, in the shape of `strain`.
        """
        strain = np.asarray(strain, dtype=float)
        i = np.clip(np.searchsorted(self.strain, strain) - 1, 0, len(self.strain) - 2)
        slope = np.diff(self.force)[i] / np.diff(self.strain)[i]
        force = self.force[i] + slope * (strain - self.strain[i])
        if tension_only:
            slack = force < 0
            force = np.where(slack, 0.0, force)
            slope = np.where(slack, 0.0, slope)
        return force, slope

    def strain_at(self, force: float) -> float:
        """Return the strain at a force (N)."""
        i = int(np.clip(np.searchsorted(self.force, force) - 1, 0, len(self.force) - 2))
        share = (force - self.force[i]) / (self.force[i + 1] - self.force[i])
        return float(self.strain[i] + share * (self.strain[i + 1] - self.strain[i]))


def axial_table(stiffness: float) -> ForceTable:
    """Return the force table of a cord of constant axial stiffness EA, in N."""
    return ForceTable(np.array([0.0, 1.0]), np.array([0.0, stiffness]))


@dataclass(frozen=True, eq=False)
class Cord:
    """A cord along a cylinder, from end to end.

    Parameters
    ----------
    angle : float
        Place on the section, degrees from the top.
    table : ForceTable
        Its force by strain.
    initial_force : float, optional
        Force in the inflated cylinder, N (it rises with the pressure, and strain counts from
        there); None: the inflation stretches the cord.
    prestrain : float
        Strain of a cord that the inflation stretches, beside the strain of the wall.
    tension_only : bool
        Whether the cord is slack in compression.
    bonded : bool
        Whether the cord is bonded to the wall, or slides in loops with one force all along.
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

    def inflated_force(self, wall_strain: float) -> float:
        """Return the force (N) in the inflated cylinder, whose wall has an axial strain."""
        if self.initial_force is not None:
            return self.initial_force
        return float(self.table.pull(wall_strain + self.prestrain, self.tension_only)[0])


def has_same_force(cord: Any, other_cord: Any) -> bool:
    """Return whether two cords, also of a sheet, have the same force by the same strain.

    Parameters
    ----------
    cord, other_cord : Cord or SheetCord
        Their places are not compared.
    """
    for name in ("initial_force", "prestrain", "tension_only", "bonded"):
        if getattr(cord, name) != getattr(other_cord, name):
            return False
    table = cord.table
    other_table = other_cord.table
    same_strain = np.array_equal(table.strain, other_table.strain)
    return same_strain and np.array_equal(table.force, other_table.force)


@dataclass(frozen=True)
class CurveReading:
    """Places at which a curve of load over deflection is read.

    Parameters
    ----------
    places : mapping of str to float
        Deflections in mm by label ("40 mm", "0.25 diameters").
    slope_over : float
        Deflection up to which the slope is the initial stiffness, and over which the slope is
        taken that has halved at the knee, mm.
    """

    places: Mapping[str, float]
    slope_over: float

    def __post_init__(self) -> None:
        lengths = {**self.places, "slope_over": self.slope_over}
        for name, length in lengths.items():
            if not length > 0:
                raise InputError(None, name, f"expected more than 0 mm, got {length:g}")


def curve_reading(
    diameter: float, places: Sequence[float] | None = None, slope_over: float | None = None
) -> CurveReading:
    """Return where a curve is read.

    Parameters
    ----------
    diameter : float
        Diameter of the cylinder, mm, by which what is not given is chosen.
    places : sequence of float, optional
        Deflections at which loads are listed, mm.
    slope_over : float, optional
        See `CurveReading`.
    """
    if places is None:
        labelled = {f"{share:g} diameters": share * diameter for share in DEFAULTS.places}
    else:
        labelled = {f"{place:g} mm": place for place in places}
    if slope_over is None:
        slope_over = DEFAULTS.slope_over * diameter
    return CurveReading(labelled, slope_over)


@dataclass(frozen=True, eq=False)
class CylinderModel:
    """A cylinder that is inflated, closed, and bent by a collar between two supports.

    First the gauge pressure rises, the bottom held in height at the supports. Then the gas is
    closed in, its mass constant, and the cylinder lies free on the supports while the collar goes
    down. Reported are the inflated state, then every deflection; load in N, pressure and volume,
    all of the whole cylinder (`copies` of the mesh).

    Parameters
    ----------
    mesh : Mesh
        As `cylinder_mesh` makes it: z along the axis, y up, seam at the bottom, `warp` in each
        quad, rows `support` and `support_bottom` at z = span / 2.
    thickness : (quads,) array
        mm.
    inflation : sequence of float
        Increments of the gauge pressure, MPa.
    deflections : sequence of float
        What is reported, mm of the collar since it touched.
    collar, supports, gas
        Bodies that touch the cylinder, and what is inside.
    increments : sequence of float
        Steps of the law, mm of deflection; they contain every deflection, and are the deflections
        unless given.
    reading : CurveReading, optional
        Changes no result.
    cords : sequence of Cord
        Cords along the cylinder.
    weight : float
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
        increments = self.increments if len(self.increments) else self.deflections
        keep_levels(
            self,
            inflation=self.inflation,
            deflections=self.deflections,
            increments=increments,
        )
        deflections = np.array(self.deflections)
        distance = np.abs(np.array(self.increments)[:, None] - deflections).min(axis=0)
        if (distance > ROUNDING * deflections).any():
            raise InputError(None, "increments", "must contain every reported deflection")
        self._check_bodies()

    def _check_bodies(self) -> None:
        """Raise InputError where bodies fit neither the mesh nor each other."""
        points = self.mesh.points
        half = np.abs(points[:, 2]).max()
        diameter = self.diameter
        row = np.abs(points[self.mesh.node_sets["support"], 2])
        if not np.allclose(row, 0.5 * self.supports.span, rtol=ROUNDING):
            problem = f"{self.supports.span:g} mm, but the mesh has its row at {row[0]:g} mm"
            raise InputError(None, "supports.span", problem)
        if not 0.5 * (self.supports.span + self.supports.width) < half:
            problem = f"{self.supports.span:g} mm does not fit under {2 * half:g} mm of cylinder"
            raise InputError(None, "supports.span", problem)
        for key, ring in (("collar", self.collar), ("saddle", self.supports.saddle)):
            if ring is not None and not ring.inner_diameter > diameter * (1 + ROUNDING):
                problem = f"expected more than the cylinder's {diameter:g} mm"
                raise InputError(None, f"{key}.inner_diameter", problem)
        if not 2 * self.collar.end < self.supports.span - self.supports.width:
            problem = f"{2 * self.collar.end:g} mm reaches the supports"
            raise InputError(None, "collar.length", problem)

    @property
    def diameter(self) -> float:
        """Return the diameter before inflation, mm."""
        return self.diameter_at(self.mesh.points)

    def diameter_at(self, points: Array) -> float:
        """Return the diameter (mm) of the circle with the area of the ring at mid-span.

        Parameters
        ----------
        points : (nodes, 3) array
            Positions of the nodes of the mesh, mm.
        """
        ring = self.mesh.node_sets["mid_span"]
        across, up = self.mesh.points[ring, :2].T
        x, y = points[ring[np.argsort(np.arctan2(across, -up))], :2].T
        # On a quarter the last side, from the top to the bottom, lies in the plane of symmetry.
        area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        return float(np.sqrt((8.0 if self._is_cut("x") else 4.0) * area / np.pi))

    @property
    def pressure(self) -> float:
        """Return the gauge pressure of the inflated cylinder, MPa."""
        return self.inflation[-1]

    @property
    def copies(self) -> int:
        """Return how many times the mesh is in the whole cylinder."""
        return int(2 ** sum(f"symmetry_{axis}" in self.mesh.node_sets for axis in "xz"))

    @property
    def reported(self) -> NDArray[np.intp]:
        """Return the index (n,) of each reported deflection among the increments."""
        return places_of(self.deflections, self.increments)

    @property
    def guides(self) -> Mapping[str, tuple[int, ...]]:
        """Return the directions held at zero throughout, by node set: the planes of symmetry.

        Frictionless supports hold the whole cylinder in height only: lines of it stay in those
        planes.
        """
        sideways = ("symmetry_x",) if self._is_cut("x") else ("top_line", "bottom_line")
        along = "symmetry_z" if self._is_cut("z") else "mid_span"
        return {**{name: (0,) for name in sideways}, along: (2,)}

    def _is_cut(self, axis: str) -> bool:
        """Return whether the mesh ends at the plane of symmetry across an axis."""
        return f"symmetry_{axis}" in self.mesh.node_sets


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RigidCylinder:
    """A rigid post (infinitely long) that the membrane lies on, or a ring around it.

    Parameters
    ----------
    name : str
        Bodies of one name have one reaction.
    axis, centre : (3,) vectors
        Direction, and a point on the axis, mm.
    radius : float
        Outside of a post, inside of a ring, mm.
    ring : bool
        Whether the membrane is inside.
    length, fillet : float
        Size of a ring and radius of its mouth, mm.
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

    Parameters
    ----------
    supports : sequence of RigidCylinder
        At rest, brought to touch.
    collars : sequence of RigidCylinder
        Moving along `direction` from where they touch.
    displacements : sequence of float
        How far, mm: the increments.
    direction : (3,) vector
        Unit vector of the collars' way.
    released : str, optional
        Node set held only while inflating.
    penalty : float
        Stiffness of contact, MPa/mm.
    gas : Gas
        What is inside.
    reported : sequence of int, optional
        Index of each displacement that is a frame; None: all are.
    weight : float
        N/mm^2 of the thinnest wall, along `direction`.
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

    Parameters
    ----------
    mesh : Mesh
        Quads counter-clockwise seen from outside.
    thickness : float or (elements,) array
        mm.
    warp : (3,) or (elements, 3) array
        Direction of the warp, projected on each facet.
    pressures : sequence of float
        Increments of inflation, MPa, and the frames where nothing bends the membrane.
    supports : mapping of str to tuple of int
        Directions held at zero, by node set.
    copies : int
        How many times the mesh is in the whole, of which forces and volume are reported.
    bending : Bending, optional
        What bends it.
    cords : sequence of Cord
        Bonded to quads of a tube along z.
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
        """Return the unknowns that are held at zero.

        Parameters
        ----------
        bent : bool
            Whether the membrane is being bent: what holds it only while inflating is released.

        Returns
        -------
        (m,) array of int
            3 * node + direction, sorted.
        """
        released = self.bending.released if bent and self.bending else None
        supports = {
            name: directions for name, directions in self.supports.items() if name != released
        }
        return self.mesh.unknowns(supports)


def inflated_cylinder(
    diameter: float,
    pressure: float,
    thickness: float,
    size: float,
    length: float = DEFAULTS.length,
    seam_width: float = DEFAULTS.seam_width,
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
    """Return a cylinder that is inflated and bent, meshed.

    Parameters
    ----------
    diameter, length, seam_width : float
        Before inflation, mm.
    pressure : float
        Gauge pressure of the inflated cylinder, MPa.
    thickness : float
        Of one layer, mm; the seam has `SEAM_LAYERS`.
    size : float
        Length of an element, mm; smaller around the tube and next to bodies (`MeshDensity`).
    supports, collar, gas, reading, cords, weight
        See `CylinderModel`; by the diameter unless given.
    deflections : sequence of float, optional
        What is reported, mm; 60 equal steps to 240 mm unless given.
    symmetry : {"quarter", "full"}
        What is meshed.
    cap_warp : {"x", "y"}
        Direction of the warp on the caps.

    Raises
    ------
    InputError
        If the bodies do not fit the cylinder or each other.
    """
    supports = supports or RigidSupports()
    collar = collar or usual_collar(diameter)
    # Before the mesh is made, which would complain of rows where the supports are.
    if not supports.span + supports.width < length:
        problem = f"{supports.span:g} mm does not fit under {length:g} mm of cylinder"
        raise InputError(None, "supports.span", problem)
    fine_size = DENSITY.near_bodies * size
    collar_reach = 0.5 * collar.length + DENSITY.beyond_collar
    support_reach = DENSITY.around_support
    if supports.saddle is not None:
        support_reach = 0.5 * supports.saddle.length + DENSITY.beyond_collar
    zones = (
        RefinedZone("collar", 0.5 * collar.spacing, collar_reach, fine_size),
        RefinedZone("support", 0.5 * supports.span, support_reach, fine_size),
    )
    mesh = cylinder_mesh(
        length,
        diameter,
        size,
        seam_width,
        symmetry,
        zones,
        cap_warp,
        DENSITY.around,
    )
    layers = np.ones(len(mesh.quads))
    if "seam" in mesh.element_sets:
        layers[mesh.element_sets["seam"]] = SEAM_LAYERS
    if deflections is None:
        steps = np.linspace(0.0, DEFAULTS.deflection, DEFAULTS.frames + 1)
        deflections = steps[1:].tolist()
    inflation = np.linspace(0.0, pressure, DEFAULTS.inflation_increments + 1)[1:].tolist()
    return CylinderModel(
        mesh=mesh,
        thickness=thickness * layers,
        inflation=inflation,
        deflections=deflections,
        collar=collar,
        supports=supports,
        gas=gas or Gas(),
        reading=reading or curve_reading(diameter),
        cords=cords,
        weight=weight,
    )
