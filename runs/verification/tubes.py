"""Verification of inflated tubes: bent beyond their first wrinkle, under small loads, at collapse.

Ends of the bent tube are plane and turned against each other (Comer and Levy 1963): no stress at
angles below t from the compressed side, where cos t = (mean strain over strain by bending), and
M/(pi p r^3) between 1/2 (first wrinkle) and 1.
"""

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import PlainWall, TubeCrossSection
from ...meshes.closed_surfaces import half_tube, tube_warp
from ...meshes.cylinder_model import InflatedModel
from ...meshes.mesh import Mesh
from ...meshes.strip_models import TubeModel
from ...solvers.membrane.closed import closed_membrane
from ...solvers.membrane.solver import MembraneSolver
from ...solvers.membrane.wall import Wall
from . import Number

#: Radius, length and thickness of the tube (mm), its modulus and its pressure (MPa).
RADIUS = 100.0
LENGTH = 60.0
THICKNESS = 1.0
MODULUS = 1000.0
PRESSURE = 0.02
#: Curvature (1/mm) at which the first wrinkle comes.
FIRST_WRINKLE = 0.5 * PRESSURE / (THICKNESS * MODULUS)


def bent_tubes() -> Iterator[Number]:
    """Compare bending moments at multiples of the curvature of the first wrinkle."""
    tube = TubeWithPlaneEnds(32, 1e-4)
    for factor in (1.5, 2.5, 4.0):
        curvature = factor * FIRST_WRINKLE
        _, moment, radius = tube.moment(curvature)
        theirs = published_moment(curvature, radius)[1]
        quantity = f"M/(pi p r^3) at {factor:g} times the first wrinkle's curvature"
        yield Number(quantity, moment, theirs, "", 2e-3, "Comer and Levy, AIAA Journal 1 (1963)")


def published_moment(curvature: float, radius: float) -> tuple[float, float]:
    """Return the wrinkled share of the circumference, and M/(pi p r^3), at a curvature in 1/mm."""
    bending_force = 2.0 * radius**2 * THICKNESS * MODULUS * curvature

    def excess_force(t: float) -> float:
        wall_force = bending_force * ((np.pi - t) * np.cos(t) + np.sin(t))
        return wall_force - np.pi * radius**2 * PRESSURE

    t = scipy.optimize.brentq(excess_force, 0.0, 3.1)
    taut = np.pi - t
    moment = 2 * taut + np.sin(2 * t)
    force = np.sin(t) + taut * np.cos(t)
    return t / np.pi, moment / (4 * force)


class TubeWithPlaneEnds:
    """Compute a quarter of a tube whose end stays plane, at an imposed curvature.

    Parameters
    ----------
    across : int
        Facets around the half circle.
    share : float or None
        Share of its stiffness that the wall keeps across wrinkles; None carries compression.

    Raises
    ------
    SolverFailure
        No equilibrium was found, at the beginning or in `moment`.
    """

    def __init__(self, across: int, share: float | None) -> None:
        tube = half_tube(across, across // 8, RADIUS, LENGTH, caps=False)
        self.points = tube.points
        self.end = np.flatnonzero(tube.points[:, 2] > LENGTH - 1e-6)
        low = np.array([np.argmin(tube.points @ [0.0, 1.0, 1e-3])])
        mesh = Mesh(tube.points, tube.quads, {**tube.node_sets, "end": self.end, "low": low})
        supports = {"symmetry_x": (0,), "symmetry_z": (2,), "end": (2,), "low": (1,)}
        warp = tube_warp(mesh, LENGTH)
        model = InflatedModel(mesh, THICKNESS, warp, [PRESSURE], supports, 4)
        law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2.6, 0.3)
        self.membrane = closed_membrane(model, law, 1e-9, model.fixed(), Wall(share))
        self.stretch = 0.2 * PRESSURE * RADIUS / (THICKNESS * MODULUS)
        start = np.zeros_like(self.points)
        start[self.end, 2] = LENGTH * self.stretch
        self.displacement = _equilibrium(self.membrane.equilibrium_from_slack(start, PRESSURE))

    def moment(self, curvature: float) -> tuple[float, float, float]:
        """Bend the tube to a curvature (1/mm), and return its bending moment in equilibrium.

        The axial force balances the pressure p on the end.

        Returns
        -------
        tuple of float
            The wrinkled share of the wall, the moment as M/(pi p r^3), and the mean radius r, mm.
        """

        def excess_force(stretch: float) -> float:
            start = self.displacement.copy()
            start[self.end, 2] = LENGTH * (stretch + curvature * self.points[self.end, 1])
            self.displacement = _equilibrium(self.membrane.equilibrium(start, PRESSURE))
            return float(self.pull().sum() - np.pi * self.radius() ** 2 * PRESSURE)

        second_guess = self.stretch - 0.05 * curvature * RADIUS
        self.stretch = float(
            scipy.optimize.newton(excess_force, self.stretch, x1=second_guess, tol=1e-11)
        )
        excess_force(self.stretch)
        radius = self.radius()
        height = (self.points + self.displacement)[self.end, 1]
        middle = 0.5 * (height.max() + height.min())
        wrinkled = self.membrane.wrinkled_share(np.ones(len(self.membrane.quads), dtype=bool))
        moment = float(self.pull() @ (height - middle)) / (np.pi * PRESSURE * radius**3)
        return wrinkled, moment, radius

    def pull(self) -> NDArray[np.float64]:
        """Return the axial forces (N) on the nodes of the end, for the whole circumference."""
        return 2.0 * self.membrane.residual.reshape(-1, 3)[self.end, 2]

    def radius(self) -> float:
        """Return the mean radius of the end, mm."""
        return float(np.hypot(*(self.points + self.displacement)[self.end, :2].T).mean())


def _equilibrium(displacement: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the displacement of an equilibrium; raise SolverFailure if none was found."""
    if displacement is None:
        raise SolverFailure("no equilibrium of a bent tube", "membrane")
    return displacement


THIN_THICKNESS = 0.8
#: Moduli of its wall along, around and in shear, MPa, and its contraction around under a force
#: along.
E1 = 400.0
E2 = 300.0
G12 = 20.0
NU12 = 0.24


def loaded_tubes() -> Iterator[Number]:
    """Compare strains of thin tubes with closed forms, collapse loads of cantilevers with tests."""
    law = HypoelasticLaw.linear(E1, E2, G12, NU12)
    # Small loads (MPa, N, N mm), and the component of the strain that they make.
    for name, load, component in (
        ("pressure", (1e-5, 0.0, 0.0), 1),
        ("tension", (0.0, 1.0, 0.0), 0),
        ("torsion", (0.0, 0.0, 10.0), 2),
    ):
        model = TubeModel(np.array([load]), RADIUS, THIN_THICKNESS)
        strains = model.strains(MembraneSolver().run(model, law).displacement)[0]
        theirs = rigid_tube_strains(*load)[component]
        quantity = f"strain of a thin tube by {name}"
        yield Number(quantity, strains[component], theirs, "", 1e-4, "closed form")
    # bar and m, of the range of the tests. The fits themselves are off the membrane's load by a
    # quarter, with a sign that turns.
    for bar, radius in ((0.2, 0.08), (0.3, 0.08), (0.5, 0.08)):
        yield Number(
            f"collapse load of a cantilever of 1 m, radius {radius:g} m, {bar:g} bar",
            collapse_load(0.1 * bar, 1e3 * radius),
            breukels_load(bar, radius),
            "N",
            0.25,
            "Breukels, TU Delft (2011), fits to tests of kite tubes, as in kite_fem",
        )


def rigid_tube_strains(pressure: float, force: float, torque: float) -> tuple[float, float, float]:
    """Return axial, hoop and shear strain of the thin tube; loads in MPa, N and N mm."""
    axial = 0.5 * pressure * RADIUS + force / (2 * np.pi * RADIUS)
    hoop = pressure * RADIUS
    return (
        (axial - NU12 * hoop) / E1 / THIN_THICKNESS,
        hoop / E2 / THIN_THICKNESS - NU12 * axial / E1 / THIN_THICKNESS,
        torque / (2 * np.pi * RADIUS**2 * THIN_THICKNESS * G12),
    )


def collapse_load(pressure: float, radius: float) -> float:
    """Return the tip load (N) at which a cantilever of 1 m is wrinkled almost around.

    The wall plays no part in it: MPa and mm.
    """
    section = TubeCrossSection(radius, pressure, PlainWall(200.0, 200.0, 30.0))
    curvature = np.array([20 * 0.5 * pressure / 200.0])
    strain = np.zeros(1)
    for _ in range(50):
        normal, moment, slope = section.resultants(strain, curvature)
        strain = strain - normal / slope[:, 0, 0]
    return moment[0] / 1e3


def breukels_load(bar: float, radius: float) -> float:
    """Return the tip load (N) at Breukels' collapse deflection of a tube of 1 m, radius in m."""
    limit = (6582.82 * radius - 272.43) * bar**2 + 40852.38 * radius**3 + 14.31
    slope = (271865251.42 * radius**5 + 215.93) * bar + 14021.79 * radius - 589.05
    collapse = (322.55 * radius**4 + 0.0239) * bar + 5.3833 * radius**2 + 0.0461
    return float(limit * (1 - np.exp(-slope * collapse / limit)))
