"""Verification of a capped tube and a sphere of thin walls by closed forms at large strain."""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...meshes.closed_surfaces import half_tube, sphere_octant, tube_warp
from ...meshes.cylinder_model import InflatedModel
from ...meshes.mesh import Mesh
from ...solvers.base import History
from ...solvers.membrane.solver import MembraneSolver
from . import Number

#: Modulus of the walls (MPa), their Poisson's ratio, thickness and radius (mm).
MODULUS = 300.0
NU = 0.3
THICKNESS = 0.8
RADIUS = 75.0
ISOTROPIC = HypoelasticLaw.linear(MODULUS, MODULUS, 0.5 * MODULUS / (1 + NU), NU)


def thin_walls() -> Iterator[Number]:
    """Compare radius and stresses of a tube and a sphere, by the embedded membrane."""
    yield from _capped_tube(pressure=0.2)
    yield from _sphere(pressure=0.8)


def _capped_tube(pressure: float) -> Iterator[Number]:
    """Compare radius and stresses of a long capped tube at a pressure in MPa."""
    model = tube_model(24, 12, 600.0, pressure * np.array([0.05, *np.arange(1, 11) / 10]))
    solver = MembraneSolver(1e-9)
    history = solver.run(model, ISOTROPIC)
    radius, axial, hoop = radius_and_stresses(model, history, solver.stress)
    strain = capped_strain(ISOTROPIC, pressure, RADIUS, THICKNESS)
    exact_radius = RADIUS * np.exp(strain[1])
    exact_hoop = pressure * exact_radius / THICKNESS
    for name, ours, theirs, unit in (
        ("radius", radius, exact_radius, "mm"),
        ("axial stress", axial, exact_hoop / 2, "MPa"),
        ("hoop stress", hoop, exact_hoop, "MPa"),
    ):
        quantity = f"{name} of a capped tube"
        yield Number(quantity, ours, theirs, unit, 5e-3, "p r/t and p r/(2 t)")


def _sphere(pressure: float) -> Iterator[Number]:
    """Compare radius, volume and stress of a sphere at a pressure in MPa."""
    radius, volume, stress = sphere((0.01, 0.1, 0.4, pressure))
    strain = sphere_strain(pressure)
    exact_radius = RADIUS * np.exp(strain)
    for name, ours, theirs, unit in (
        ("radius", radius, exact_radius, "mm"),
        ("volume", volume, 4 / 3 * np.pi * exact_radius**3, "mm3"),
        ("stress", stress, MODULUS / (1 - NU) * strain, "MPa"),
    ):
        yield Number(f"{name} of a sphere", ours, theirs, unit, 5e-3, "p r/(2 t)")


def capped_strain(
    law: HypoelasticLaw, pressure: float, radius: float, thickness: float
) -> NDArray[np.float64]:
    """Return axial and hoop log strain of a long capped tube: D(eps) deps = d(p r/(2 t), p r/t)."""
    shares = np.array([0.5, 1.0])  # of the hoop stress

    def rate(current_pressure: float, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        e1 = law.E1(strain[0])
        e2 = law.E2(strain[1])
        denominator = 1 - law.nu12**2 * e2 / e1
        stiffness = np.array([[e1, law.nu12 * e2], [law.nu12 * e2, e2]]) / denominator
        stress_rate = radius * np.exp(strain[1]) / thickness * shares
        geometric = current_pressure * np.outer(stress_rate, [0.0, 1.0])
        return np.linalg.solve(stiffness - geometric, stress_rate)

    solution = scipy.integrate.solve_ivp(rate, (0, pressure), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    return np.asarray(solution.y[:, -1])


def sphere_strain(pressure: float) -> float:
    """Return the log strain of a sphere: p r/(2 t) = E/(1 - nu) log(r/R), constant thickness."""

    def excess_stress(strain: float) -> float:
        load = pressure * RADIUS * np.exp(strain)
        return MODULUS / (1 - NU) * strain - load / (2 * THICKNESS)

    return float(scipy.optimize.brentq(excess_stress, 0.0, 0.9))


def tube_model(
    across: int,
    along: int,
    length: float,
    pressures: Sequence[float] | NDArray[np.float64],
    caps: bool = True,
) -> InflatedModel:
    """Return a quarter of a tube, x, z >= 0, of facets across and along, hung up at its foot."""
    mesh = half_tube(across, along, RADIUS, length, caps)
    foot = mesh.node_sets["foot"]
    hang = foot[[np.argmin(mesh.points[foot, 2])]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    supports = {"symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)}
    if not caps:
        supports["end"] = (2,)
    warp = tube_warp(mesh, length)
    return InflatedModel(mesh, THICKNESS, warp, list(pressures), supports, copies=4)


def radius_and_stresses(
    model: InflatedModel, history: History, stress: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return radius (mm), axial and hoop stress (MPa) at z = 0 of an inflated cylinder.

    Parameters
    ----------
    model : InflatedModel
    history : History
        Analysis of the model; its last increment is evaluated.
    stress : (quads, points, 3) array, MPa
        Axial, hoop and shear stress at the integration points of the quads.
    """
    is_at_middle = model.mesh.points[model.mesh.quads][..., 2].min(axis=1) < 1e-6
    ring = np.flatnonzero(model.mesh.points[:, 2] < 1e-6)
    height = (model.mesh.points + history.displacement[-1])[ring, 1]
    axial, hoop, _ = stress[is_at_middle].mean(axis=(0, 1))
    return 0.5 * np.ptp(height), axial, hoop


def sphere_model(n: int, pressures: Sequence[float]) -> InflatedModel:
    """Return an octant of a sphere, of 3 n^2 facets."""
    mesh = sphere_octant(n, RADIUS)
    warp = (0.3, 0.2, 1.0)
    supports = {"symmetry_x": (0,), "symmetry_y": (1,), "symmetry_z": (2,)}
    return InflatedModel(mesh, THICKNESS, warp, list(pressures), supports, copies=8)


def sphere(pressures: Sequence[float]) -> tuple[float, float, float]:
    """Compute radius (mm), volume (mm^3) and stress (MPa) of a sphere at the last pressure."""
    model = sphere_model(12, pressures)
    solver = MembraneSolver(1e-9)
    history = solver.run(model, ISOTROPIC)
    radius = np.linalg.norm(model.mesh.points + history.displacement[-1], axis=1).mean()
    volume = history.cavity_volume
    assert volume is not None
    return float(radius), volume[-1], solver.stress[..., :2].mean()
