"""Model of an inflated tube in bending as a beam: its wall, its cords, and its loads.

It is for walls whose stiffness is known per width (N/mm), and for braids, whose stiff yarns would
lock bilinear quads. Sections stay plane and round, and strain is measured from the inflated tube.
With the radius r, the pressure p, the force n of the wall per width, the wall's shear stiffness G
per width and the shear strain gamma, a section carries

    N = integral of n(strain) r d angle + sum of cord forces - p pi r^2,
    V = (k G r + p pi r^2) gamma,

where the strain is axial - curvature * height. The factor k follows from the shear flow between the
parts that carry the bending of the inflated tube (`ThinTube`): it is pi for a wall alone, and
27 / (4 pi) for three cords alone. The pressure's part of V is Fichter's (NASA TN D-3393).

The yarns of a braid turn at constant length. Therefore the thrust of the pressure less the pull of
the braid is p pi r^2 (1 - 2 cot^2 angle), with the angle of the yarns to the axis, and its
derivative adds 3 p r cot^2 angle to the stiffness of the wall.
"""

import math
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .cylinder_model import Collar, Cord, CurveReading, RigidSupports, curve_reading
from .mesh import Array, Mesh, keep_levels, places_of
from .tube import cylinder_mesh

#: Number of positions around the wall at which its force is evaluated.
AROUND = 72
#: Share of its stiffness that a slack wall keeps.
LEFT = 3e-4
#: Size of the elements of the mesh that is drawn, over the diameter.
ELEMENT_SHARE = 0.15


@dataclass(frozen=True)
class PlainWall:
    """A wall of linear stiffness per width (N/mm).

    Attributes
    ----------
    axial, hoop, shear : float, N/mm
        Stiffness along and around the tube, and in shear.
    poisson : float
        Poisson's ratio.
    wrinkles : bool
        Whether the wall is slack in compression.
    moduli : tuple of float
        Stiffness along, around and in shear (N/mm), and Poisson's ratio; a braid has it, too.
    """

    axial: float
    hoop: float
    shear: float
    poisson: float = 0.0
    wrinkles: bool = True

    def __post_init__(self) -> None:
        _positive(self, ("axial", "hoop", "shear"))
        if not 0 <= self.poisson < math.sqrt(self.axial / self.hoop):
            problem = f"expected from 0 to below sqrt(axial / hoop), got {self.poisson:g}"
            raise InputError(None, "poisson", problem)

    @property
    def moduli(self) -> tuple[float, float, float, float]:
        """Return axial, hoop and shear stiffness (N/mm) and Poisson's ratio."""
        return self.axial, self.hoop, self.shear, self.poisson

    def pull(self, strain: Array, pressure: float, radius: float) -> tuple[Array, Array]:
        """Return the force along the tube per width (N/mm) and its derivative by the strain.

        All have the shape of `strain`, which is from the wall without stress.
        """
        by_hoop = self.poisson * self.hoop / self.axial * pressure * radius
        force = by_hoop + self.axial * strain
        slope = np.full_like(strain, self.axial)
        if self.wrinkles:
            share = np.where(force < 0, LEFT, 1.0)
            force = share * force
            slope = share * slope
        return force, slope

    def at_rest(self, pressure: float, radius: float, cords: Sequence[Cord]) -> float:
        """Return the axial strain of the inflated tube over the wall without stress.

        There, wall and cords together balance the thrust of the pressure (MPa).

        Parameters
        ----------
        radius : float, mm
        """
        low = -1.0
        high = 1.0
        for _ in range(60):  # bisection down to rounding
            strain = 0.5 * (low + high)
            pull = 2 * math.pi * radius * self.pull(np.array([strain]), pressure, radius)[0][0]
            pull += sum(cord.inflated_force(strain) for cord in cords)
            low, high = (strain, high) if pull < pressure * math.pi * radius**2 else (low, strain)
        return 0.5 * (low + high)


@dataclass(frozen=True)
class BraidedWall:
    """A wall of a braid, two families of yarns, and a bladder; it also carries compression.

    Attributes
    ----------
    angle : float
        Angle of the yarns of both families, plus and minus, to the axis of the tube, degrees.
    yarn, across, yarn_shear : float, N/mm
        Stiffness of one family along its yarns, across them, and in shear.
    bladder, bladder_shear : float, N/mm
        Stiffness of the isotropic bladder in tension and in shear.
    """

    angle: float
    yarn: float
    yarn_shear: float
    bladder: float
    bladder_shear: float
    across: float = 0.0

    def __post_init__(self) -> None:
        _positive(self, ("yarn", "yarn_shear", "bladder", "bladder_shear"))
        if not 0 < self.angle < 90:
            problem = f"expected between 0 and 90 degrees, got {self.angle:g}"
            raise InputError(None, "angle", problem)
        if not 0.5 * self.bladder / self.bladder_shear < 2:
            problem = f"expected above a quarter of bladder, {0.25 * self.bladder:g} N/mm"
            raise InputError(None, "bladder_shear", problem)

    @cached_property
    def laminate(self) -> Array:
        """Return the stiffness (3, 3) N/mm of yarns and bladder: along, around, shear."""
        c = math.cos(math.radians(self.angle))
        s = math.sin(math.radians(self.angle))
        to_yarn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s],
                            [-2 * c * s, 2 * c * s, c * c - s * s]])  # fmt: skip
        ply = to_yarn.T @ np.diag([self.yarn, self.across, self.yarn_shear]) @ to_yarn
        mirror = np.diag([1.0, 1.0, -1.0])
        nu = 0.5 * self.bladder / self.bladder_shear - 1.0
        plane = self.bladder / (1.0 - nu**2)
        sheet = np.array([[plane, nu * plane, 0.0], [nu * plane, plane, 0.0], [0.0, 0.0, 0.0]])
        sheet[2, 2] = self.bladder_shear
        return ply + mirror @ ply @ mirror + sheet

    @property
    def axial(self) -> float:
        """Return the stiffness along the tube where it is free to change its radius, N/mm."""
        a = self.laminate
        return float(a[0, 0] - a[0, 1] ** 2 / a[1, 1])

    @property
    def shear(self) -> float:
        """Return the shear stiffness, N/mm."""
        return float(self.laminate[2, 2])

    @property
    def moduli(self) -> tuple[float, float, float, float]:
        """Return axial, hoop and shear stiffness (N/mm) and Poisson's ratio.

        The hoop stiffness is that without axial force.
        """
        a = self.laminate
        return self.axial, float(a[1, 1] - a[0, 1] ** 2 / a[0, 0]), self.shear, 0.0

    def pull(self, strain: Array, pressure: float, radius: float) -> tuple[Array, Array]:
        """Return the force along the tube per width (N/mm) and its derivative by the strain.

        They contain the change of the pressure's thrust as the radius changes with the strain. All
        have the shape of `strain`, which is from the inflated tube.
        """
        cosine = math.cos(math.radians(self.angle))
        by_length = 3.0 * cosine**2 * (1.0 + strain) ** 2
        scale = 0.5 * pressure * radius / (1.0 - cosine**2)
        force = self.axial * strain + scale * (by_length - 1.0) + 0.5 * pressure * radius
        return force, self.axial + 2.0 * scale * by_length / (1.0 + strain)

    def at_rest(self, pressure: float, radius: float, cords: Sequence[Cord]) -> float:
        """Return zero, as the braid's angle is given for the inflated tube."""
        return 0.0

    def left_to_cords(self, pressure: float, radius: float) -> float:
        """Return the thrust less the pull of the braid (N), which cords have to hold."""
        force, _ = self.pull(np.zeros(1), pressure, radius)
        return math.pi * pressure * radius**2 - 2 * math.pi * radius * float(force[0])


def _positive(wall: object, names: Sequence[str]) -> None:
    """Raise InputError unless stiffnesses (N/mm) of a wall are positive and finite."""
    for name in names:
        if not 0 < getattr(wall, name) < math.inf:
            raise InputError(None, name, f"expected > 0 N/mm, got {getattr(wall, name):g}")


@dataclass(frozen=True, eq=False)
class TubeCrossSection:
    """A cross-section of an inflated tube.

    Attributes
    ----------
    radius : float, mm
    pressure : float, MPa
        Gauge pressure.

    Raises
    ------
    InputError
        For a braided wall without cords that the pressure keeps taut.
    """

    radius: float
    pressure: float
    wall: PlainWall | BraidedWall
    cords: Sequence[Cord] = ()

    def __post_init__(self) -> None:
        if isinstance(self.wall, BraidedWall) and not min(self.cord_forces, default=-1.0) >= 0:
            problem = "the braid and the pressure need cords with tension: at least one cord, and "
            raise InputError(None, "angle", problem + "an angle above 54.74 degrees")

    @cached_property
    def wall_strain(self) -> float:
        """Return the axial strain of the inflated straight tube over the wall without stress."""
        return self.wall.at_rest(self.pressure, self.radius, self.cords)

    @property
    def cord_forces(self) -> list[float]:
        """Return the forces (N) of the cords in the inflated tube.

        Cords on a braid share what it and the cords of a given force leave to them.
        """
        if not isinstance(self.wall, BraidedWall):
            return [cord.inflated_force(self.wall_strain) for cord in self.cords]
        initial_forces = [cord.initial_force for cord in self.cords]
        thrust = self.wall.left_to_cords(self.pressure, self.radius)
        remaining_thrust = thrust - sum(force or 0.0 for force in initial_forces)
        share = remaining_thrust / max(1, initial_forces.count(None))
        return [share if force is None else force for force in initial_forces]

    @cached_property
    def cord_strains(self) -> list[float]:
        """Return the axial strain of each cord in the inflated straight tube, over no stress."""
        is_braided = isinstance(self.wall, BraidedWall)
        return [
            cord.table.strain_at(force)
            if is_braided or cord.initial_force is not None
            else self.wall_strain + cord.prestrain
            for cord, force in zip(self.cords, self.cord_forces, strict=True)
        ]

    @cached_property
    def shear(self) -> float:
        """Return the shear stiffness in N: shear force over shear strain.

        The stiffness of wall and cords is that in the inflated, unbent tube.
        """
        _, wall_slope = self.wall.pull(np.array([self.wall_strain]), self.pressure, self.radius)
        cords = zip(self.cords, self.cord_strains, strict=True)
        cord_slopes = [float(c.table.pull(e, c.tension_only)[1]) for c, e in cords]
        angles = np.array([c.angle for c in self.cords])
        tube = ThinTube(
            self.radius, float(wall_slope[0]), self.wall.shear, angles, np.array(cord_slopes)
        )
        return tube.shear_stiffness() + math.pi * self.pressure * self.radius**2

    def resultants(self, strain: Array, curvature: Array) -> tuple[Array, Array, Array]:
        """Return the axial force and the bending moment of a section, and their derivatives.

        Parameters
        ----------
        strain, curvature : (m,) array
            Axial strain from the inflated tube, and curvature in 1/mm.

        Returns
        -------
        (m,) array, (m,) array, (m, 2, 2) array
            Axial force N in N; moment M in N mm, positive if it sags; derivatives of (N, M) by
            (strain, curvature).
        """
        turn = 2 * math.pi / AROUND * (0.5 + np.arange(AROUND))
        heights = self.radius * np.cos(turn)
        wall_strain = self.wall_strain + strain[:, None] - curvature[:, None] * heights
        force, slope = self.wall.pull(wall_strain, self.pressure, self.radius)
        width = 2 * math.pi * self.radius / AROUND
        fibres = [heights]
        pulls = [width * force]
        slopes = [width * slope]
        for cord, inflated_strain in zip(self.cords, self.cord_strains, strict=True):
            height = self.radius * math.cos(math.radians(cord.angle))
            cord_strain = inflated_strain + strain - curvature * height
            cord_force, cord_slope = cord.table.pull(cord_strain, cord.tension_only)
            fibres.append(np.array([height]))
            pulls.append(cord_force[:, None])
            slopes.append(cord_slope[:, None])
        y = np.concatenate(fibres)
        f = np.hstack(pulls)
        k = np.hstack(slopes)
        normal = f.sum(axis=1) - math.pi * self.pressure * self.radius**2
        mixed = -(k @ y)
        rows = [[k.sum(axis=1), mixed], [mixed, k @ y**2]]
        return normal, -(f @ y), np.moveaxis(np.array(rows), -1, 0)


@dataclass(frozen=True, eq=False)
class BeamModel:
    """A tube on two rollers that is bent by two equal dead loads.

    Attributes
    ----------
    section : TubeCrossSection
    span : float, mm
        Distance of the rollers.
    deflections, increments : sequence of float, mm
        Deflections of mid-span, from the inflated tube under its weight, that are reported, and
        those at which increments end; the latter contain the former, and are these unless given.
    load_spacing, load_width : float, mm
        Distance of the loads (0: one load), and width of the straps on which they hang.
    roller_below : float, mm
        Distance from the axis down to the rollers.
    weight : float, N/mm
        Weight per length of the tube.
    friction : float, N
        Friction of the test rig, which is added to the load.
    size : float, mm
        Length of an element.
    reading : CurveReading
    mesh : Mesh
        Surface of a quarter of the tube, to be drawn.
    """

    section: TubeCrossSection
    span: float
    deflections: Sequence[float]
    load_spacing: float = 0.0
    load_width: float = 0.0
    roller_below: float = 0.0
    weight: float = 0.0
    friction: float = 0.0
    size: float = 25.0
    increments: Sequence[float] = ()
    reading: CurveReading = field(default=None, repr=False)  # type: ignore[assignment]
    mesh: Mesh = field(init=False, repr=False)
    copies: ClassVar[int] = 4

    def __post_init__(self) -> None:
        steps = self.increments if len(self.increments) else self.deflections
        keep_levels(self, deflections=self.deflections, increments=steps)
        if not self.load_spacing + self.load_width < self.span:
            problem = f"{self.load_spacing:g} mm does not fit into a span of {self.span:g} mm"
            raise InputError(None, "load_spacing", problem)
        if not 0 < self.size <= 0.1 * self.span:
            problem = f"expected at most a tenth of the span, got {self.size:g} mm"
            raise InputError(None, "size", problem)
        if self.reading is None:
            object.__setattr__(self, "reading", curve_reading(self.diameter))
        mesh = cylinder_mesh(self.span, self.diameter, ELEMENT_SHARE * self.diameter, around=0.5)
        object.__setattr__(self, "mesh", mesh)

    @property
    def diameter(self) -> float:
        return 2 * self.section.radius

    def diameter_at(self, points: Array) -> float:
        """Return the diameter (mm), which is constant as sections stay round.

        Parameters
        ----------
        points : (n, 3) array, mm
            Which a beam does not look at.
        """
        return self.diameter

    @property
    def pressure(self) -> float:
        return self.section.pressure

    @property
    def inflation(self) -> tuple[float, ...]:
        return (self.pressure,)

    @property
    def cords(self) -> Sequence[Cord]:
        return self.section.cords

    @property
    def reported(self) -> NDArray[np.intp]:
        """Return the increments (n,) at which the deflections are reported."""
        return places_of(self.deflections, self.increments)

    @property
    def supports(self) -> RigidSupports:
        """Return the rollers for a drawing."""
        return RigidSupports(self.span, ELEMENT_SHARE * self.diameter)

    @property
    def collar(self) -> Collar:
        """Return a strap of the load for a drawing."""
        width = max(self.load_width, ELEMENT_SHARE * self.diameter)
        return Collar(self.diameter, width, 0.1 * width)


#: Number of points of Gauss-Legendre integration between two booms, which suffices for a full turn.
POINTS_BETWEEN_BOOMS = 24
#: A ratio of the smaller to the larger principal bending stiffness that is taken for zero.
NEGLIGIBLE_BENDING = 1e-13


@dataclass(frozen=True, eq=False)
class ThinTube:
    """A closed thin round section: a wall with booms on it.

    Parameters
    ----------
    radius : float
        Radius of the wall's middle, mm.
    wall_axial, wall_shear : float
        Stiffness of the wall along the tube and in shear, N/mm of width (E t and G t).
    boom_angles : (n,) array
        Places of the booms, degrees from the top.
    boom_stiffness : (n,) array
        Axial stiffness EA of each boom, N.
    """

    radius: float
    wall_axial: float
    wall_shear: float
    boom_angles: Array
    boom_stiffness: Array

    def shear_flow(self, direction: float = 0.0) -> tuple[Array, Array, Array]:
        """Return the shear flow of a unit force through the shear centre.

        With a shear force V the axial forces in the wall and the booms change along the tube by
        V / EI times their stiffness and their distance from the elastic centroid; EI is the bending
        stiffness. Equilibrium along the tube gives the shear flow up to a constant around the
        section, which follows from the condition that the section does not twist (Bredt).

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        angle, width, flow : (m,) arrays
            Integration points around the wall in rad from the top; the width of the wall in mm that
            each represents; the shear flow there in N/mm per N, positive along increasing angles.

        References
        ----------
        T. H. G. Megson, *Aircraft Structures for Engineering Students*, chapters on the shear of
        closed sections and on structural idealisation.
        """
        booms = np.radians(self.boom_angles) % (2 * math.pi)
        places = self.radius * np.column_stack([np.cos(booms), np.sin(booms)])
        wall_stiffness = 2 * math.pi * self.radius * self.wall_axial
        axial = wall_stiffness + self.boom_stiffness.sum()
        centroid = self.boom_stiffness @ places / axial
        bending = 0.5 * wall_stiffness * self.radius**2 * np.eye(2)
        bending += (self.boom_stiffness * places.T) @ places - axial * np.outer(centroid, centroid)
        turn = math.radians(direction)
        # Two booms alone bear no bending about the line through them, and need not.
        flexibility = np.linalg.pinv(bending, rcond=NEGLIGIBLE_BENDING, hermitian=True)
        curvature = flexibility @ [math.cos(turn), math.sin(turn)]

        knots = np.unique(np.concatenate([booms, [0.0, 2 * math.pi]]))
        point, weight = np.polynomial.legendre.leggauss(POINTS_BETWEEN_BOOMS)
        half = 0.5 * np.diff(knots)[:, None]
        angle = (knots[:-1, None] + half * (1 + point)).ravel()
        width = self.radius * (half * weight).ravel()
        # Integral of the position from the top, and the booms that lie between.
        along = self.radius**2 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
        along -= self.radius * angle[:, None] * centroid
        passed = booms <= angle[:, None]
        carried = self.wall_axial * along + passed @ (
            self.boom_stiffness[:, None] * (places - centroid)
        )
        flow = -(carried @ curvature)
        return angle, width, flow - width @ flow / width.sum()

    def shear_stiffness(self, direction: float = 0.0) -> float:
        """Return the shear stiffness of the section in N: shear force over shear strain.

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        float
            1 over the integral of flow^2 / (G t) around the wall, with its shear stiffness G t and
            radius r: pi r G t for a wall without booms, 27 / (4 pi) r G t for three equal booms on
            a wall without axial stiffness, and pi r G t for many booms.
        """
        _, width, flow = self.shear_flow(direction)
        return self.wall_shear / float(width @ flow**2)
