"""Compare published and closed-form numbers with those of the program as it is installed.

bf.verify().table() lists them all, bf.verify(["bars"]) those of a subject.

Outline: published results of Marc, Abaqus and the thesis (bars, bubbles, strips, Poisson's ratio);
closed forms (Hencky's membrane, thin-walled tubes and spheres, a tube with wrinkles); the subjects.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, newton

from ...arguments import checked_arguments
from ...errors import SolverFailure, check_one_of
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import PlainWall, TubeCrossSection
from ...meshes.bubble_model import BubbleModel, default_increments
from ...meshes.closed_surfaces import half_tube, sphere_octant, tube_warp
from ...meshes.cylinder_model import InflatedModel
from ...meshes.disk import disk_mesh
from ...meshes.mesh import Mesh
from ...meshes.strain import surface_strain
from ...meshes.strip_models import WIDTH, TubeModel, bias_strip, straight_strip
from ...readers.curves import fit_load_polynomial, read_load_curves
from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.base import History, Solver
from ...solvers.calculix.solver import CalculixSolver, diagnose
from ...solvers.membrane.closed import closed_membrane
from ...solvers.membrane.solver import MembraneSolver
from ...solvers.membrane.wall import Wall
from ..progress import Listener, listener


@dataclass(frozen=True)
class Number:
    """A published or closed-form number, and the one that this program computes for it.
    what : the quantity and the case. ours, theirs : in `unit` ("" for a pure number). allowed :
    largest deviation, relative or in `unit` where `absolute`, by the error of model, mesh or the
    reading of a figure. source : publication or closed form."""

    what: str
    ours: float
    theirs: float
    unit: str
    allowed: float
    source: str
    absolute: bool = False

    @property
    def deviation(self) -> float:
        """Return ours less theirs, relative to theirs, or in `unit` where `absolute`."""
        off = self.ours - self.theirs
        return off if self.absolute else off / abs(self.theirs)

    @property
    def met(self) -> bool:
        """Return True where the deviation is allowed; NaN is not."""
        return abs(self.deviation) <= self.allowed

    @property
    def row(self) -> dict[str, Any]:
        return {**asdict(self), "deviation": self.deviation, "met": self.met}


SOURCE = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"


def marc_bars(stresses: Sequence[float] | None = None, program: str = "") -> Iterator[Number]:
    """Compare end stresses (MPa) of the four bars, in order, with Marc's; `program` begins each
    name. Those of the embedded membrane unless given."""
    for bar, stress in zip(BARS, stresses or strip_stresses(MembraneSolver()), strict=True):
        what = f"{program}end stress, {bar.model} {bar.direction} bar"
        yield Number(what, stress, bar.stress, "MPa", TOLERANCE, SOURCE)


PUBLISHED = Path(__file__).parent / "published"
TABLE = PUBLISHED / "abaqus_linear_orthotropic.csv"
SOURCE_ABAQUS = "Abaqus M3D4; figures of inv_bubble_opt (Jekel)"
#: Error of reading the published figures, mm.
DIGITISED = 0.03
#: A lower pressure, where reading the figure is 0.3 %, and the highest.
LOW_BAR = 1.0
ELEMENTS = 1600


def abaqus_bubbles() -> Iterator[Number]:
    """Compare the apex at about 100 kPa and at the highest pressure, and in-plane displacements."""
    for (test, model), rows in cases():
        found = shapes(rows, ELEMENTS, MembraneSolver())
        low = int((rows["p_bar"] - LOW_BAR).abs().to_numpy().argmin())
        high = len(rows) - 1
        for i in (low, high):
            where = f"test {test} {model}, {100 * rows['p_bar'][i]:.0f} kPa"
            apex = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
            yield Number(f"apex, {where}", found["apex"][i], apex, "mm", 1e-3, SOURCE_ABAQUS)
        for axis in "xy":
            ours = found[f"du_{axis}"][high]
            theirs = rows[f"du_{axis}_max"][high]
            what = f"largest u_{axis}, {where}"
            yield Number(what, ours, theirs, "mm", DIGITISED, SOURCE_ABAQUS, absolute=True)


def cases() -> Iterator[tuple[tuple[int, str], pd.DataFrame]]:
    """Yield test and model with the rows of the published table."""
    table = pd.read_csv(TABLE, comment="#")
    for test, model in table[["test", "model"]].drop_duplicates().itertuples(index=False):
        rows = table[(table["test"] == test) & (table["model"] == model)]
        yield (int(str(test)), str(model)), rows.reset_index(drop=True)


def shapes(rows: pd.DataFrame, elements: int, solver: Solver) -> pd.DataFrame:
    """Return apex and the largest in-plane displacements du_x, du_y (mm) at the rows' pressures."""
    warp, fill, shear = 1e3 * rows[["E1", "E2", "G12"]].iloc[0].to_numpy(float)
    law = HypoelasticLaw.linear(warp, fill, shear, 0.24, "incompressible")
    pressures = (0.1 * rows["p_bar"]).tolist()
    mesh = disk_mesh(100.0, elements, "quarter")
    steps = sorted({0.25 * pressures[0], 0.5 * pressures[0], *pressures})
    u = solver.run(BubbleModel(mesh, 0.81, pressures, steps), law).displacement
    apex, (du_x, du_y, _) = u[:, mesh.node_sets["apex"][0], 2], u.max(axis=1).T
    return pd.DataFrame({"apex": apex, "du_x": du_x, "du_y": du_y})


TABLE_MARC_BUBBLE = PUBLISHED / "marc_bubble_profiles.csv"
SOURCE_MARC_BUBBLE = "MSC Marc; Jekel et al., preprint of SMO (2016)"
#: Table 4.2, "solution", GPa.
SOLUTION = (
    -7.96788e-3,
    7.10747e-1,
    -1.56912e-1,
    2.00439e-2,
    -1.06241e1,
    1.37830e1,
    -9.31830e-1,
    1.39437e-1,
    -4.79622e2,
    2.12650e2,
    -2.02028e1,
    8.06350e-1,
)
STRAIN_RANGE = (0.13, 0.13, 0.13)
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
#: Two figures of the paper disagree by 5 %, and the load stepping is not known.
ALLOWED = 0.06
ELEMENTS_MARC_BUBBLE = 800


def known_law(nu12: float = 0.24) -> HypoelasticLaw:
    """Return the law of Table 4.2."""
    return HypoelasticLaw(1e3 * np.array(SOLUTION), nu12, np.array(STRAIN_RANGE))


def known_bubble() -> BubbleModel:
    """Return a quarter of the thesis' bubble: radius 100 mm, thickness 0.81 mm, seven pressures."""
    mesh = disk_mesh(100.0, ELEMENTS_MARC_BUBBLE, "quarter")
    return BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))


def marc_bubble() -> Iterator[Number]:
    """Compare the height of the apex at the seven pressures."""
    table = pd.read_csv(TABLE_MARC_BUBBLE, comment="#")
    model = known_bubble()
    history = MembraneSolver().run(model, known_law())
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    for pressure, ours in zip(1e3 * np.array(PRESSURES), apex, strict=True):
        theirs = table[np.isclose(table["p_kPa"], pressure)]["z_mm"].max()
        what = f"apex of Table 4.2, {pressure:g} kPa"
        yield Number(what, float(ours), float(theirs), "mm", ALLOWED, SOURCE_MARC_BUBBLE)


#: Over the mean of the five, by nu12, read off the figure to three decimals.
FIGURE = {0.05: 1.029, 0.15: 1.016, 0.25: 1.0015, 0.35: 0.985, 0.45: 0.967}
#: Marc's pressure did not follow the surface (docs/validation/published-bubble.md): with dead
#: pressure ours are within 0.0005, with pressure that follows as a gas does at most 0.0070 off.
ALLOWED_POISSON = 0.0075
SOURCE_POISSON = "thesis Fig. 4.2"


def poisson_ratios() -> Iterator[Number]:
    """Compare the largest displacements, relative to the mean of the five."""
    model = known_bubble()
    largest = []
    for nu12 in FIGURE:
        history = MembraneSolver().run(model, known_law(nu12))
        largest.append(float(np.linalg.norm(history.displacement[-1], axis=1).max()))
    mean = float(np.mean(largest))
    for (nu12, theirs), ours in zip(FIGURE.items(), largest, strict=True):
        what = f"largest displacement over the mean, nu12 {nu12:g}"
        yield Number(what, ours / mean, theirs, "", ALLOWED_POISSON, SOURCE_POISSON, absolute=True)


THICKNESS = 0.81
#: Table 3.1: gauge length at rest and at the end, mm; engineering strain; R^2 of the polynomial.
TABLE_3_1 = {
    "warp": (20.022, 23.329, 0.165, 0.998),
    "fill": (22.780, 28.721, 0.261, 0.959),
    "bias": (19.767, 30.734, 0.555, 0.987),
}
#: Half a unit of the last digit printed.
PRINTED = 5e-4
#: One of the fill points is not among those that were digitised: R^2 0.9576 without it.
DIGITISED_STRIPS = 2e-3
FILE = "valmex7318_load_gauge.csv"


def strips() -> Iterator[Number]:
    """Compare strains of the gauge, and end loads with the integral of the modulus."""
    for direction, (first, last, strain, _) in TABLE_3_1.items():
        model = bias_strip(first, last, THICKNESS)
        if direction != "bias":
            yarn: Literal["warp", "fill"] = "warp" if direction == "warp" else "fill"
            model = straight_strip(yarn, first, last, THICKNESS)
        history = MembraneSolver(1e-10).run(model, known_law())
        lower, upper = (model.mesh.points + history.displacement[-1])[model.mesh.node_sets["gauge"]]
        ours = float(np.linalg.norm(upper - lower)) / first - 1
        what = f"engineering strain of the gauge, {direction} strip"
        yield Number(what, ours, strain, "", PRINTED, "thesis Table 3.1", absolute=True)
        if direction != "bias":
            theirs = end_load(direction, float(np.log(last / first)))
            what = f"end load, {direction} strip of Table 4.2"
            yield Number(what, float(history.load[-1]), theirs, "N", 1e-6, "integral of E")


def measured_strips(folder: Path) -> Iterator[Number]:
    """Compare R^2 of the fourth-order polynomials through measured points; raises InputError."""
    for curve in read_load_curves(folder / FILE):
        ours = fit_load_polynomial(curve.elongation, curve.load).r_squared
        theirs = TABLE_3_1[str(curve.direction)][3]
        what = f"R^2 of the {curve.direction} polynomial"
        yield Number(what, ours, theirs, "", DIGITISED_STRIPS, "thesis Table 3.1", absolute=True)


def end_load(direction: str, strain: float) -> float:
    """Return the load (N) of a homogeneous strip of Table 4.2's law at a log strain.
    Across, d eps1 = -nu21 d eps2 with nu21 = nu12 E2/E1, and d eps2 = -nu12 d eps1. In the fill
    test E1 is held at its value at zero strain, because the warp gets shorter. A modulus is held
    beyond its strain range."""
    law = known_law()
    modulus, end = (law.E1, 0) if direction == "warp" else (law.E2, 1)
    knots = [0.0, min(strain, float(law.strain_range[end])), strain]
    stress = 0.0
    for a, b in pairwise(knots):
        x, weight = np.polynomial.legendre.leggauss(4)
        stress += 0.5 * (b - a) * float(weight @ modulus(0.5 * (a + b) + 0.5 * (b - a) * x))
    across = -law.nu12 * (strain if direction == "warp" else stress / float(law.E1(0.0)))
    return stress * WIDTH * THICKNESS * float(np.exp(across))


#: Test and model of Abaqus' bubble. Shells of 432 quads a disk are 0.3 % off at most.
CASE, ELEMENTS_CALCULIX, ALLOWED_CALCULIX = (2, "e"), 432, 3e-3


def with_calculix() -> Iterator[Number]:
    """Compare CalculiX' bars with Marc's, a bubble with Abaqus'; nothing without a usable ccx."""
    usable = next((one for one in diagnose() if one.usable), None)
    if usable is None or usable.stresses is None or usable.path is None:
        return
    yield from marc_bars(usable.stresses, "CalculiX: ")
    rows = dict(cases())[CASE]
    found = shapes(rows, ELEMENTS_CALCULIX, CalculixSolver(usable.path))
    for i in (len(rows) // 2, len(rows) - 1):
        what = f"CalculiX: apex, test {CASE[0]} {CASE[1]}, {100 * rows['p_bar'][i]:.0f} kPa"
        theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
        yield Number(what, found["apex"][i], theirs, "mm", ALLOWED_CALCULIX, SOURCE_ABAQUS)


# Closed forms.
# Hencky's inflated circular membrane (1915): with S = N_r (E t p^2 R^2)^(-1/3) and r in units of R
# the equilibrium and compatibility of a flat, linear elastic membrane under vertical pressure are
# S'' + 3 S'/r + 1/(8 S^2) = 0, regular at r = 0, with u = 0 at the rim: N_theta = nu N_r,
# (1 - nu) S + S' = 0 at r = 1. Integrating the slope -r/(2 S) (p R/(E t))^(1/3) gives the height.
#
# A tube under pressure p bent beyond its first wrinkle (Comer and Levy 1963), its ends plane and
# turned against each other: no stress at angles below t from the compressed side, where cos t =
# (mean strain over strain by bending), and M/(pi p r^3) between 1/2 (first wrinkle) and 1.

TERMS = 60
RADIUS, THICKNESS, MODULUS = 100.0, 0.81, 300.0
#: b_0 = 4 S(0) by nu.
FICHTER = {0.0: 1.6204, 0.1: 1.6487, 0.2: 1.6827, 0.3: 1.7244, 0.34: 1.7439, 0.4: 1.7769}
HENCKY = "Fichter, NASA TP 3658 (1997)"
#: Height over radius at which ours are computed (strains of about 2.5e-4), and quads of the disk.
HEIGHT, QUADS = 0.02, 3200
#: Ours is 2e-4 off for the mesh and for slopes that are not small; 0.653 has three digits.
WITHIN, APEX_ALLOWED = 1e-3, 2e-3


def stress_series(first: float) -> NDArray[np.float64]:
    """Return the coefficients c_n (TERMS,) of S = sum c_n r^(2n) for S(0) = first."""
    c = np.zeros(TERMS)
    square = np.zeros(TERMS)
    c[0] = first
    square[0] = first**2
    # Powers of S^2 (S'' + 3 S'/r) = -1/8; S'' + 3 S'/r = sum 2n (2n + 2) c_n r^(2n - 2).
    curvature = np.zeros(TERMS)
    for n in range(1, TERMS):
        k = n - 1
        target = -0.125 if k == 0 else 0.0
        curvature[k] = (target - square[1 : k + 1] @ curvature[k - 1 :: -1][:k]) / square[0]
        c[n] = curvature[k] / (2 * n * (2 * n + 2))
        square[n] = c[: n + 1] @ c[n::-1]
    return c


def first_coefficient(nu: float) -> float:
    """Return the S(0) whose series fulfils the condition at the rim."""
    powers = 2 * np.arange(TERMS)

    def rim(first: float) -> float:
        c = stress_series(first)
        return float((1 - nu) * c.sum() + powers @ c)

    # The series converges at the rim for all of these; b_0 is 1.6 to 2 in the tables.
    return float(brentq(rim, 0.36, 0.60, xtol=1e-14))


def apex_coefficient(nu: float) -> float:
    """Return the apex height over R (p R/(E t))^(1/3)."""
    c = stress_series(first_coefficient(nu))
    powers = 2 * np.arange(TERMS)
    r, weight = np.polynomial.legendre.leggauss(40)
    r = 0.5 * (r + 1)
    weight = 0.5 * weight
    return float(weight @ (r / (2 * (c @ r ** powers[:, None]))))


def hencky_membranes() -> Iterator[Number]:
    """Compare the stress at the centre and the height of the apex of the embedded membrane."""
    for nu, b_0 in FICHTER.items():
        height, stress = bubble(nu)
        yield Number(f"b_0 of Hencky's membrane, nu {nu:g}", stress, b_0, "", WITHIN, HENCKY)
        if nu == 0.3:
            what = "apex over R (pR/Et)^(1/3), nu 0.3"
            yield Number(what, height, 0.653, "", APEX_ALLOWED, "Hencky (1915)")


def bubble(nu: float) -> tuple[float, float]:
    """Return apex over R (p R/(E t))^(1/3), and b_0 from the strain at the centre, computed."""
    pressure = (HEIGHT / apex_coefficient(nu)) ** 3 * MODULUS * THICKNESS / RADIUS
    law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2 / (1 + nu), nu)
    mesh = disk_mesh(RADIUS, QUADS, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, [pressure]), law)
    u = history.displacement[0]
    apex = mesh.node_sets["apex"][0]
    height = u[apex, 2] / RADIUS * (pressure * RADIUS / MODULUS / THICKNESS) ** (-1 / 3)
    around = np.flatnonzero((mesh.quads == apex).any(axis=1))
    strain = surface_strain(mesh, u, np.array([1.0, 0.0, 0.0]))[around, :2].mean()
    force = MODULUS * THICKNESS * strain / (1 - nu)
    scale = (MODULUS * THICKNESS * pressure**2 * RADIUS**2) ** (1 / 3)
    return float(height), float(4 * force / scale)


E, NU, THICKNESS_THIN_WALLS, RADIUS_THIN_WALLS = 300.0, 0.3, 0.8, 75.0
ISOTROPIC = HypoelasticLaw.linear(E, E, 0.5 * E / (1 + NU), NU)
OCTANT = {"symmetry_x": (0,), "symmetry_y": (1,), "symmetry_z": (2,)}
ALLOWED_THIN_WALLS = 5e-3
TUBE_MPA, SPHERE_MPA = 0.2, 0.8


def thin_walls() -> Iterator[Number]:
    """Compare radius and stresses of a tube and a sphere, by the embedded membrane."""
    strain = capped_strain(ISOTROPIC, TUBE_MPA, RADIUS_THIN_WALLS, THICKNESS_THIN_WALLS)
    radius = RADIUS_THIN_WALLS * float(np.exp(strain[1]))
    hoop = TUBE_MPA * radius / THICKNESS_THIN_WALLS
    steps = TUBE_MPA * np.array([0.05, *np.arange(1, 11) / 10])
    model = tube_model(24, 12, 600.0, steps)
    solver = MembraneSolver(1e-9)
    found = in_the_middle(model, solver.run(model, ISOTROPIC), solver.stress)
    exact = (radius, hoop / 2, hoop)
    names = ("radius", "axial stress", "hoop stress")
    for name, unit, ours, theirs in zip(names, ("mm", "MPa", "MPa"), found, exact, strict=True):
        what = f"{name} of a capped tube"
        source = "p r/t and p r/(2 t)"
        yield Number(what, ours, theirs, unit, ALLOWED_THIN_WALLS, source)
    strain_of_sphere = sphere_strain(SPHERE_MPA)
    radius = RADIUS_THIN_WALLS * float(np.exp(strain_of_sphere))
    found = sphere((0.01, 0.1, 0.4, SPHERE_MPA))
    exact = (radius, 4 / 3 * np.pi * radius**3, E / (1 - NU) * strain_of_sphere)
    names = ("radius", "volume", "stress")
    for name, unit, ours, theirs in zip(names, ("mm", "mm3", "MPa"), found, exact, strict=True):
        yield Number(f"{name} of a sphere", ours, theirs, unit, ALLOWED_THIN_WALLS, "p r/(2 t)")


def capped_strain(
    law: HypoelasticLaw, pressure: float, radius: float, thickness: float
) -> NDArray[np.float64]:
    """Return axial and hoop log strain of a long capped tube: D(eps) deps = d(p r/(2 t), p r/t)."""
    parts = np.array([0.5, 1.0])

    def rate(p: float, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        e1 = float(law.E1(strain[0]))
        e2 = float(law.E2(strain[1]))
        den = 1 - law.nu12**2 * e2 / e1
        d = np.array([[e1, law.nu12 * e2], [law.nu12 * e2, e2]]) / den
        line = radius * np.exp(strain[1]) / thickness * parts
        return np.linalg.solve(d - p * np.outer(line, [0.0, 1.0]), line)

    solution = solve_ivp(rate, (0, pressure), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    return np.asarray(solution.y[:, -1])


def sphere_strain(pressure: float) -> float:
    """Return the log strain of a sphere: p r/(2 t) = E/(1 - nu) log(r/R), constant thickness."""

    def excess(strain: float) -> float:
        load = pressure * RADIUS_THIN_WALLS * np.exp(strain)
        return E / (1 - NU) * strain - load / (2 * THICKNESS_THIN_WALLS)

    return float(brentq(excess, 0.0, 0.9))


def tube_model(
    across: int,
    along: int,
    length: float,
    pressures: Sequence[float] | NDArray[np.float64],
    caps: bool = True,
) -> InflatedModel:
    """Return a quarter of a tube, x, z >= 0, of facets across and along, hung up at its foot."""
    mesh = half_tube(across, along, RADIUS_THIN_WALLS, length, caps)
    hang = mesh.node_sets["foot"][[np.argmin(mesh.points[mesh.node_sets["foot"], 2])]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    supports: dict[str, tuple[int, ...]] = {"symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)}
    if not caps:
        supports["end"] = (2,)
    warp = tube_warp(mesh, length)
    return InflatedModel(mesh, THICKNESS_THIN_WALLS, warp, list(pressures), supports, copies=4)


def in_the_middle(
    model: InflatedModel, history: History, stress: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return radius (mm), axial and hoop stress (MPa) at z = 0; stress : (quads, points, 3)."""
    near = model.mesh.points[model.mesh.quads][..., 2].min(axis=1) < 1e-6
    ring = np.flatnonzero(model.mesh.points[:, 2] < 1e-6)
    height = (model.mesh.points + history.displacement[-1])[ring, 1]
    axial, hoop, _ = stress[near].mean(axis=(0, 1))
    return 0.5 * float(np.ptp(height)), float(axial), float(hoop)


def sphere_model(n: int, pressures: Sequence[float]) -> InflatedModel:
    """Return an octant of a sphere, of 3 n^2 facets."""
    mesh = sphere_octant(n, RADIUS_THIN_WALLS)
    warp = (0.3, 0.2, 1.0)
    return InflatedModel(mesh, THICKNESS_THIN_WALLS, warp, list(pressures), OCTANT, copies=8)


def sphere(pressures: Sequence[float]) -> tuple[float, float, float]:
    """Compute radius (mm), volume (mm^3) and stress (MPa) of a sphere at the last pressure."""
    model = sphere_model(12, pressures)
    solver = MembraneSolver(1e-9)
    history = solver.run(model, ISOTROPIC)
    radius = np.linalg.norm(model.mesh.points + history.displacement[-1], axis=1).mean()
    volume = history.cavity_volume
    assert volume is not None
    return float(radius), float(volume[-1]), float(solver.stress[..., :2].mean())


RADIUS_BENT_TUBE, LENGTH, PRESSURE = 100.0, 60.0, 0.02
THICKNESS_BENT_TUBE, MODULUS_BENT_TUBE = 1.0, 1000.0
#: Curvature (1/mm) at which the first wrinkle comes, and multiples of it.
FIRST = 0.5 * PRESSURE / (THICKNESS_BENT_TUBE * MODULUS_BENT_TUBE)
TIMES = (1.5, 2.5, 4.0)
FACETS, SHARE = 32, 1e-4
SOURCE_BENT_TUBE = "Comer and Levy, AIAA Journal 1 (1963)"


def bent_tubes() -> Iterator[Number]:
    """Compare bending moments at multiples of the curvature of the first wrinkle."""
    tube = PlaneEnds(FACETS, SHARE)
    for times in TIMES:
        _, moment, radius = tube.moment(times * FIRST)
        what = f"M/(pi p r^3) at {times:g} times the first wrinkle's curvature"
        theirs = published_moment(times * FIRST, radius)[1]
        yield Number(what, moment, theirs, "", 2e-3, SOURCE_BENT_TUBE)


def published_moment(curvature: float, radius: float) -> tuple[float, float]:
    """Return the wrinkled share of the circumference, and M/(pi p r^3), at a curvature in 1/mm."""

    def excess_force(t: float) -> float:
        by_bending = 2.0 * radius**2 * THICKNESS_BENT_TUBE * MODULUS_BENT_TUBE * curvature
        return by_bending * ((np.pi - t) * np.cos(t) + np.sin(t)) - np.pi * radius**2 * PRESSURE

    t = float(brentq(excess_force, 0.0, 3.1))
    moment = (2 * np.pi - 2 * t + np.sin(2 * t)) / (4 * (np.sin(t) + (np.pi - t) * np.cos(t)))
    return t / np.pi, float(moment)


class PlaneEnds:
    """A quarter of a tube whose end at `LENGTH` stays plane, at a given turn and stretch.
    across : facets around the half circle. share : of its stiffness that the wall keeps across
    wrinkles; None carries compression. Raises SolverFailure: here and in `moment`, no equilibrium
    was found."""

    def __init__(self, across: int, share: float | None) -> None:
        tube = half_tube(across, across // 8, RADIUS_BENT_TUBE, LENGTH, caps=False)
        self.points = tube.points
        self.end = np.flatnonzero(tube.points[:, 2] > LENGTH - 1e-6)
        low = np.array([np.argmin(tube.points @ [0.0, 1.0, 1e-3])])
        sets = {**tube.node_sets, "end": self.end, "low": low}
        mesh = Mesh(tube.points, tube.quads, sets)
        supports = {"symmetry_x": (0,), "symmetry_z": (2,), "end": (2,), "low": (1,)}
        t = THICKNESS_BENT_TUBE
        e = MODULUS_BENT_TUBE
        model = InflatedModel(mesh, t, tube_warp(mesh, LENGTH), [PRESSURE], supports, 4)
        law = HypoelasticLaw.linear(e, e, e / 2.6, 0.3)
        self.membrane = closed_membrane(model, law, 1e-9, model.fixed(), Wall(share))
        self.stretched = 0.2 * PRESSURE * RADIUS_BENT_TUBE / (t * e)
        start = np.zeros_like(self.points)
        start[self.end, 2] = LENGTH * self.stretched
        self.displacement = _found(self.membrane.equilibrium_from_slack(start, PRESSURE))

    def moment(self, curvature: float) -> tuple[float, float, float]:
        """Return the wrinkled share of the wall, M/(pi p r^3) and r; p pushes on the end."""

        def excess_force(stretch: float) -> float:
            start = self.displacement.copy()
            start[self.end, 2] = LENGTH * (stretch + curvature * self.points[self.end, 1])
            self.displacement = _found(self.membrane.equilibrium(start, PRESSURE))
            return float(self.pull().sum() - np.pi * self.radius() ** 2 * PRESSURE)

        ahead = self.stretched - 0.05 * curvature * RADIUS_BENT_TUBE
        self.stretched = float(newton(excess_force, self.stretched, x1=ahead, tol=1e-11))
        excess_force(self.stretched)
        radius = self.radius()
        height = (self.points + self.displacement)[self.end, 1]
        middle = 0.5 * (height.max() + height.min())
        wrinkled = self.membrane.wrinkled_share(np.ones(len(self.membrane.quads), dtype=bool))
        moment = float(self.pull() @ (height - middle)) / (np.pi * PRESSURE * radius**3)
        return wrinkled, moment, radius

    def pull(self) -> NDArray[np.float64]:
        """Return the forces (nodes of the end,) N along the tube, of the whole circumference."""
        return np.asarray(2.0 * self.membrane.residual.reshape(-1, 3)[self.end, 2])

    def radius(self) -> float:
        """Return the mean radius of the end, mm."""
        return float(np.hypot(*(self.points + self.displacement)[self.end, :2].T).mean())


def _found(displacement: NDArray[np.float64] | None) -> NDArray[np.float64]:
    if displacement is None:
        raise SolverFailure("no equilibrium of a bent tube", "membrane")
    return displacement


#: A thin tube: mm, MPa and N/mm; loads are small, so that the closed forms of a rigid shape hold.
RADIUS_TUBE, THICKNESS_TUBE, LAW_TUBE = 100.0, 0.8, HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)
LOADS_TUBE = {"pressure": (1e-5, 0.0, 0.0), "tension": (0.0, 1.0, 0.0), "torsion": (0.0, 0.0, 10.0)}
SOURCE_BREUKELS = "Breukels, TU Delft (2011), fits to tests of kite tubes, as in kite_fem"
#: bar and m, of the range of these tests; the tube's wall plays no part in the load.
BREUKELS = ((0.2, 0.08), (0.3, 0.08), (0.5, 0.08))
#: The fits themselves are off the membrane's load by that much, with a sign that turns.
ALLOWED_BREUKELS = 0.25


def loaded_tubes() -> Iterator[Number]:
    """Compare strains of thin tubes with closed forms, collapse loads of cantilevers with tests."""
    r = RADIUS_TUBE
    t = THICKNESS_TUBE
    for name, (pressure, force, torque) in LOADS_TUBE.items():
        model = TubeModel(np.array([[pressure, force, torque]]), r, t)
        ours = model.strains(MembraneSolver().run(model, LAW_TUBE).displacement)[0]
        axial = 0.5 * pressure * r + force / (2 * np.pi * r)
        hoop = pressure * r
        theirs = (
            (axial - 0.24 * hoop) / 400 / t,
            hoop / 300 / t - 0.24 * axial / 400 / t,
            torque / (2 * np.pi * r**2 * t * 20),
        )
        at = {"pressure": 1, "tension": 0, "torsion": 2}[name]
        what = f"strain of a thin tube by {name}"
        yield Number(what, float(ours[at]), theirs[at], "", 1e-4, "closed form")
    for bar, metre in BREUKELS:
        what = f"collapse load of a cantilever of 1 m, radius {metre:g} m, {bar:g} bar"
        ours_load = collapse_load(0.1 * bar, 1e3 * metre)
        theirs_load = breukels_load(bar, metre)
        yield Number(what, ours_load, theirs_load, "N", ALLOWED_BREUKELS, SOURCE_BREUKELS)


def collapse_load(pressure: float, radius: float) -> float:
    """Return the tip load (N) at which a cantilever of 1 m is wrinkled almost around."""
    section = TubeCrossSection(radius, pressure, PlainWall(200.0, 200.0, 30.0))
    bend = 20 * 0.5 * pressure / 200.0
    strain = np.zeros(1)
    for _ in range(50):
        normal, moment, slope = section.resultants(strain, np.array([bend]))
        strain = strain - normal / slope[:, 0, 0]
    return float(moment[0]) / 1e3


def breukels_load(bar: float, metre: float) -> float:
    """Return the tip load (N) at Breukels' collapse deflection of a tube of 1 m."""
    top = (6582.82 * metre - 272.43) * bar**2 + 40852.38 * metre**3 + 14.31
    slope = (271865251.42 * metre**5 + 215.93) * bar + 14021.79 * metre - 589.05
    collapse = (322.55 * metre**4 + 0.0239) * bar + 5.3833 * metre**2 + 0.0461
    return float(top * (1 - np.exp(-slope * collapse / top)))


SUBJECTS: Mapping[str, Callable[[], Iterable[Number]]] = {
    "bars": marc_bars,
    "hencky": hencky_membranes,
    "abaqus": abaqus_bubbles,
    "marc bubble": marc_bubble,
    "strips": strips,
    "thin walls": thin_walls,
    "bent tube": bent_tubes,
    "loaded tubes": loaded_tubes,
    "nu12": poisson_ratios,
    "calculix": with_calculix,
}


@dataclass(frozen=True, eq=False)
class Verification:
    """Numbers beside published ones by subject, none where the program for it is not here."""

    subjects: Mapping[str, Sequence[Number]]

    @property
    def missed(self) -> list[Number]:
        return [one for several in self.subjects.values() for one in several if not one.met]

    @property
    def result(self) -> dict[str, Any]:
        """Return all numbers as plain values, as the command prints them with --json."""
        rows = [
            {"subject": s, **one.row} for s, several in self.subjects.items() for one in several
        ]
        return {"ok": not self.missed, "numbers": rows}

    def table(self) -> pd.DataFrame:
        return pd.DataFrame(self.result["numbers"])


@checked_arguments
def verify(
    subjects: Sequence[str] | None = None,
    *,
    data: Path | str | None = None,
    progress: Listener = None,
    saw: Callable[[str, Sequence[Number]], None] = lambda subject, found: None,
) -> Verification:
    """Compare this installation with published numbers and closed forms; takes a few minutes.
    subjects : by name, all unless given. data : folder of the measured strips, compared at last.
    progress : receives subjects done, all, and the one that begins. saw : receives the numbers of
    each subject as it ends. InputError : no such subject."""
    chosen = list(SUBJECTS if subjects is None else subjects)
    for subject in chosen:
        check_one_of(subject, SUBJECTS, "--subject")
    every: dict[str, Callable[[], Iterable[Number]]] = {name: SUBJECTS[name] for name in chosen}
    if data is not None:
        every["measured strips"] = functools.partial(measured_strips, Path(data))
    tell = listener(progress)
    found = dict[str, Sequence[Number]]()
    for done, (subject, compare) in enumerate(every.items()):
        tell(done, len(every), subject)
        found[subject] = list(compare())
        saw(subject, found[subject])
    tell(len(every), len(every), "")
    return Verification(found)
