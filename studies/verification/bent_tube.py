"""A pressurised tube bent beyond its first wrinkle (Comer and Levy 1963).

A tube under pressure p, its ends kept plane and turned against each other. No stress at angles
below t from the compressed side, where cos t = (mean strain over strain by bending), and
M/(pi p r^3) between 1/2 (first wrinkle) and 1.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, newton

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.closed import half_tube, tube_warp
from ...meshes.mesh import Mesh
from ...models.inflated import InflatedModel
from ...solvers.membrane.closed_model import closed_membrane
from ...solvers.membrane.wall import Wall
from .number import Number

RADIUS, LENGTH, THICKNESS, MODULUS, PRESSURE = 100.0, 60.0, 1.0, 1000.0, 0.02
#: Curvature (1/mm) at which the first wrinkle comes, and multiples of it.
FIRST = 0.5 * PRESSURE / (THICKNESS * MODULUS)
TIMES = (1.5, 2.5, 4.0)
FACETS, SHARE = 32, 1e-4
SOURCE = "Comer and Levy, AIAA Journal 1 (1963)"


def bent_tubes() -> Iterator[Number]:
    """Bending moments at multiples of the curvature of the first wrinkle."""
    tube = PlaneEnds(FACETS, SHARE)
    for times in TIMES:
        _, moment, radius = tube.moment(times * FIRST)
        what = f"M/(pi p r^3) at {times:g} times the first wrinkle's curvature"
        yield Number(what, moment, published_moment(times * FIRST, radius)[1], "", 2e-3, SOURCE)


def published_moment(curvature: float, radius: float) -> tuple[float, float]:
    """Share of the circumference that wrinkles, and M/(pi p r^3), at a curvature in 1/mm."""

    def excess_force(t: float) -> float:
        by_bending = 2.0 * radius**2 * THICKNESS * MODULUS * curvature
        return by_bending * ((np.pi - t) * np.cos(t) + np.sin(t)) - np.pi * radius**2 * PRESSURE

    t = float(brentq(excess_force, 0.0, 3.1))
    moment = (2 * np.pi - 2 * t + np.sin(2 * t)) / (4 * (np.sin(t) + (np.pi - t) * np.cos(t)))
    return t / np.pi, float(moment)


class PlaneEnds:
    """Half of half a tube whose end at `LENGTH` stays plane, at a given turn and stretch.

    Parameters
    ----------
    across : facets around the half circle. share : of its stiffness that the wall keeps across
        wrinkles; None carries compression.

    Raises
    ------
    SolverFailure : here and in `moment`, no equilibrium was found.
    """

    def __init__(self, across: int, share: float | None) -> None:
        tube = half_tube(across, across // 8, RADIUS, LENGTH, caps=False)
        self.points = tube.points
        self.end = np.flatnonzero(tube.points[:, 2] > LENGTH - 1e-6)
        low = np.array([np.argmin(tube.points @ [0.0, 1.0, 1e-3])])
        sets = {**tube.node_sets, "end": self.end, "low": low}
        mesh = Mesh(tube.points, tube.quads, sets)
        supports = {"symmetry_x": (0,), "symmetry_z": (2,), "end": (2,), "low": (1,)}
        model = InflatedModel(mesh, THICKNESS, tube_warp(mesh, LENGTH), [PRESSURE], supports, 4)
        law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2.6, 0.3)
        self.membrane = closed_membrane(model, law, 1e-9, model.fixed(), Wall(share))
        self.stretched = 0.2 * PRESSURE * RADIUS / (THICKNESS * MODULUS)
        start = np.zeros_like(self.points)
        start[self.end, 2] = LENGTH * self.stretched
        self.displacement = _found(self.membrane.equilibrium_from_slack(start, PRESSURE))

    def moment(self, curvature: float) -> tuple[float, float, float]:
        """Share of the wall that wrinkles, M/(pi p r^3), r; the end carries what p pushes on it."""

        def excess_force(stretch: float) -> float:
            start = self.displacement.copy()
            start[self.end, 2] = LENGTH * (stretch + curvature * self.points[self.end, 1])
            self.displacement = _found(self.membrane.equilibrium(start, PRESSURE))
            return float(self.pull().sum() - np.pi * self.radius() ** 2 * PRESSURE)

        ahead = self.stretched - 0.05 * curvature * RADIUS
        self.stretched = float(newton(excess_force, self.stretched, x1=ahead, tol=1e-11))
        excess_force(self.stretched)
        radius, height = self.radius(), (self.points + self.displacement)[self.end, 1]
        middle = 0.5 * (height.max() + height.min())
        wrinkled = self.membrane.wrinkled_share(np.ones(len(self.membrane.quads), dtype=bool))
        moment = float(self.pull() @ (height - middle)) / (np.pi * PRESSURE * radius**3)
        return wrinkled, moment, radius

    def pull(self) -> NDArray[np.float64]:
        """(nodes of the end,) N along the tube, of the whole circumference."""
        return np.asarray(2.0 * self.membrane.residual.reshape(-1, 3)[self.end, 2])

    def radius(self) -> float:
        """Mean radius of the end, mm."""
        return float(np.hypot(*(self.points + self.displacement)[self.end, :2].T).mean())


def _found(displacement: NDArray[np.float64] | None) -> NDArray[np.float64]:
    if displacement is None:
        raise SolverFailure("no equilibrium of a bent tube", "membrane")
    return displacement
