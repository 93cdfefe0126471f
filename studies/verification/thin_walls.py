"""Closed forms of thin walls: a long capped tube and a sphere under pressure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ...materials.law import HypoelasticLaw
from ...meshes.closed import half_tube, sphere_octant, tube_warp
from ...meshes.mesh import Mesh
from ...models.inflated import InflatedModel
from ...solvers.base import History
from ...solvers.membrane.solver import MembraneSolver
from .number import Number

E, NU, THICKNESS, RADIUS = 300.0, 0.3, 0.8, 75.0
ISOTROPIC = HypoelasticLaw.linear(E, E, 0.5 * E / (1 + NU), NU)
OCTANT = {"symmetry_x": (0,), "symmetry_y": (1,), "symmetry_z": (2,)}
ALLOWED = 5e-3
TUBE_MPA, SPHERE_MPA = 0.2, 0.8


def thin_walls() -> Iterator[Number]:
    """Radius and stresses of both, computed with the embedded membrane."""
    strain = capped_strain(ISOTROPIC, TUBE_MPA, RADIUS, THICKNESS)
    radius = RADIUS * float(np.exp(strain[1]))
    hoop = TUBE_MPA * radius / THICKNESS
    steps = TUBE_MPA * np.array([0.05, *np.arange(1, 11) / 10])
    exact = (radius, hoop / 2, hoop)
    names = (("radius", "mm"), ("axial stress", "MPa"), ("hoop stress", "MPa"))
    for (name, unit), ours, theirs in zip(names, middle_of_tube(steps), exact, strict=True):
        yield Number(f"{name} of a capped tube", ours, theirs, unit, ALLOWED, "p r/t and p r/(2 t)")
    strain_of_sphere = sphere_strain(SPHERE_MPA)
    radius = RADIUS * float(np.exp(strain_of_sphere))
    found = sphere((0.01, 0.1, 0.4, SPHERE_MPA))
    exact = (radius, 4 / 3 * np.pi * radius**3, E / (1 - NU) * strain_of_sphere)
    names = (("radius", "mm"), ("volume", "mm3"), ("stress", "MPa"))
    for (name, unit), ours, theirs in zip(names, found, exact, strict=True):
        yield Number(f"{name} of a sphere", ours, theirs, unit, ALLOWED, "p r/(2 t)")


def capped_strain(
    law: HypoelasticLaw, pressure: float, radius: float, thickness: float
) -> NDArray[np.float64]:
    """Axial and hoop log strain of a long capped tube: D(eps) deps = d(p r/(2 t), p r/t)."""
    parts = np.array([0.5, 1.0])

    def rate(p: float, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        e1, e2 = float(law.E1(strain[0])), float(law.E2(strain[1]))
        den = 1 - law.nu12**2 * e2 / e1
        d = np.array([[e1, law.nu12 * e2], [law.nu12 * e2, e2]]) / den
        line = radius * np.exp(strain[1]) / thickness * parts
        return np.linalg.solve(d - p * np.outer(line, [0.0, 1.0]), line)

    solution = solve_ivp(rate, (0, pressure), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    return np.asarray(solution.y[:, -1])


def sphere_strain(pressure: float) -> float:
    """Log strain of a sphere: p r/(2 t) = E/(1 - nu) log(r/R), constant thickness."""

    def excess(strain: float) -> float:
        return E / (1 - NU) * strain - pressure * RADIUS * np.exp(strain) / (2 * THICKNESS)

    return float(brentq(excess, 0.0, 0.9))


def middle_of_tube(pressures: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
    """Radius (mm), axial and hoop stress (MPa) in the middle of a tube with flat caps."""
    model, solver = tube_model(24, 12, 600.0, pressures), MembraneSolver(1e-9)
    return in_the_middle(model, solver.run(model, ISOTROPIC), solver.stress)


def tube_model(
    across: int,
    along: int,
    length: float,
    pressures: Sequence[float] | NDArray[np.float64],
    caps: bool = True,
) -> InflatedModel:
    """Half of half a tube: x >= 0, z >= 0, its lowest node in the middle held up.

    across, along : facets. caps : a flat one at the end, which otherwise keeps its place along z.
    """
    mesh = half_tube(across, along, RADIUS, length, caps)
    hang = mesh.node_sets["foot"][[np.argmin(mesh.points[mesh.node_sets["foot"], 2])]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    supports: dict[str, tuple[int, ...]] = {
        "symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)
    }  # fmt: skip
    if not caps:
        supports["end"] = (2,)
    warp = tube_warp(mesh, length)
    return InflatedModel(mesh, THICKNESS, warp, list(pressures), supports, copies=4)


def in_the_middle(
    model: InflatedModel, history: History, stress: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Radius (mm), axial and hoop stress (MPa) of a tube at z = 0 and the last pressure.

    stress : (quads, points, 3) MPa, at the last pressure.
    """
    near = model.mesh.points[model.mesh.quads][..., 2].min(axis=1) < 1e-6
    ring = np.flatnonzero(model.mesh.points[:, 2] < 1e-6)
    height = (model.mesh.points + history.displacement[-1])[ring, 1]
    axial, hoop, _ = stress[near].mean(axis=(0, 1))
    return 0.5 * float(np.ptp(height)), float(axial), float(hoop)


def sphere_model(
    n: int, pressures: Sequence[float], warp: tuple[float, float, float] = (0.3, 0.2, 1.0)
) -> InflatedModel:
    """An octant of 3 n^2 facets."""
    mesh = sphere_octant(n, RADIUS)
    return InflatedModel(mesh, THICKNESS, warp, list(pressures), OCTANT, copies=8)


def sphere(pressures: Sequence[float]) -> tuple[float, float, float]:
    """Radius (mm), volume (mm^3) and stress (MPa) of a sphere at the last pressure."""
    model, solver = sphere_model(12, pressures), MembraneSolver(1e-9)
    history = solver.run(model, ISOTROPIC)
    radius = np.linalg.norm(model.mesh.points + history.displacement[-1], axis=1).mean()
    volume = history.cavity_volume
    assert volume is not None
    return float(radius), float(volume[-1]), float(solver.stress[..., :2].mean())
