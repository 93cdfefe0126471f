"""Verification of bubbles: Hencky's series, figures of Abaqus, and MSC Marc in the thesis.

Hencky (1915): with S = N_r (E t p^2 R^2)^(-1/3) and r in units of R the equilibrium and
compatibility of a flat, linear elastic membrane under vertical pressure are
S'' + 3 S'/r + 1/(8 S^2) = 0, regular at r = 0, with u = 0 at the rim: N_theta = nu N_r,
(1 - nu) S + S' = 0 at r = 1. Integrating the slope -r/(2 S) (p R/(E t))^(1/3) gives the height.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from ...lazy_modules import pandas as pd
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel, default_increments
from ...meshes.disk import disk_mesh
from ...meshes.mesh import surface_strain
from ...solvers.base import Solver
from ...solvers.membrane.solver import MembraneSolver
from . import PUBLISHED, Number

#: Number of terms of the series.
TERMS = 60
#: Radius and thickness of the membrane that is computed, mm; its modulus, MPa.
RADIUS = 100.0
THICKNESS = 0.81
MODULUS = 300.0
#: Published coefficients b_0 = 4 S(0) by Poisson's ratio nu.
FICHTER = {0.0: 1.6204, 0.1: 1.6487, 0.2: 1.6827, 0.3: 1.7244, 0.34: 1.7439, 0.4: 1.7769}


def hencky_membranes() -> Iterator[Number]:
    """Compare the stress at the centre and the height of the apex of the embedded membrane.

    Ours is 2e-4 off for the mesh and for slopes that are not small; 0.653 has three digits.
    """
    for nu, b_0 in FICHTER.items():
        height, stress = computed_coefficients(nu)
        quantity = f"b_0 of Hencky's membrane, nu {nu:g}"
        yield Number(quantity, stress, b_0, "", 1e-3, "Fichter, NASA TP 3658 (1997)")
        if nu == 0.3:
            quantity = "apex over R (pR/Et)^(1/3), nu 0.3"
            yield Number(quantity, height, 0.653, "", 2e-3, "Hencky (1915)")


def stress_series(central_stress: float) -> NDArray[np.float64]:
    """Return the coefficients c_n (TERMS,) of S = sum c_n r^(2n) for S(0)."""
    c = np.zeros(TERMS)
    square = np.zeros(TERMS)
    c[0] = central_stress
    square[0] = central_stress**2
    # Powers of S^2 (S'' + 3 S'/r) = -1/8; S'' + 3 S'/r = sum 2n (2n + 2) c_n r^(2n - 2).
    curvature = np.zeros(TERMS)
    for n in range(1, TERMS):
        k = n - 1
        target = -0.125 if k == 0 else 0.0
        earlier = curvature[k - 1 :: -1][:k]
        curvature[k] = (target - square[1 : k + 1] @ earlier) / square[0]
        c[n] = curvature[k] / (2 * n * (2 * n + 2))
        square[n] = c[: n + 1] @ c[n::-1]
    return c


def central_stress(nu: float) -> float:
    """Return the S(0) of `stress_series` whose series fulfils the condition at the rim."""
    powers = 2 * np.arange(TERMS)

    def rim_condition(trial_stress: float) -> float:
        c = stress_series(trial_stress)
        return float((1 - nu) * c.sum() + powers @ c)

    # The series converges at the rim for all of these; b_0 is 1.6 to 2 in the tables.
    return float(scipy.optimize.brentq(rim_condition, 0.36, 0.60, xtol=1e-14))


def apex_coefficient(nu: float) -> float:
    """Return the apex height over R (p R/(E t))^(1/3)."""
    c = stress_series(central_stress(nu))
    powers = 2 * np.arange(TERMS)
    points, weights = np.polynomial.legendre.leggauss(40)
    r = 0.5 * (points + 1)
    return float(0.5 * weights @ (r / (2 * (c @ r ** powers[:, None]))))


def pressure_at(height: float, nu: float) -> float:
    """Return the pressure (MPa) at which the apex is `height` radii high."""
    return (height / apex_coefficient(nu)) ** 3 * MODULUS * THICKNESS / RADIUS


def computed_coefficients(nu: float) -> tuple[float, float]:
    """Return apex over R (p R/(E t))^(1/3), and b_0 from the strain at the centre, computed.

    The apex is at 2 % of the radius: strains are about 2.5e-4.
    """
    pressure = pressure_at(0.02, nu)
    law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2 / (1 + nu), nu)
    mesh = disk_mesh(RADIUS, 3200, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, [pressure]), law)
    displacement = history.displacement[0]
    apex = mesh.node_sets["apex"][0]
    scale = (pressure * RADIUS / MODULUS / THICKNESS) ** (-1 / 3)
    height = displacement[apex, 2] / RADIUS * scale
    apex_quads = np.flatnonzero((mesh.quads == apex).any(axis=1))
    strains = surface_strain(mesh, displacement, np.array([1.0, 0.0, 0.0]))[apex_quads, :2]
    force = MODULUS * THICKNESS * strains.mean() / (1 - nu)
    force_scale = (MODULUS * THICKNESS * pressure**2 * RADIUS**2) ** (1 / 3)
    return float(height), float(4 * force / force_scale)


TABLE = PUBLISHED / "abaqus_linear_orthotropic.csv"
ABAQUS_SOURCE = "Abaqus M3D4; figures of inv_bubble_opt (Jekel)"


def abaqus_bubbles(elements: int = 1600) -> Iterator[Number]:
    """Compare the apex at about 100 kPa and at the highest pressure, and in-plane displacements."""
    for (test, model), rows in published_cases():
        computed = bubble_shapes(rows, elements, MembraneSolver())
        theirs = published_apex(rows)
        names = [f"test {test} {model}, {100 * bar:.0f} kPa" for bar in rows["p_bar"]]
        # At 100 kPa the figure can be read to 0.3 %.
        low = int((rows["p_bar"] - 1.0).abs().to_numpy().argmin())
        high = len(rows) - 1
        for row in (low, high):
            apex = computed["apex"][row]
            yield Number(f"apex, {names[row]}", apex, theirs[row], "mm", 1e-3, ABAQUS_SOURCE)
        for axis in "xy":
            yield Number(
                f"largest u_{axis}, {names[high]}",
                computed[f"du_{axis}"][high],
                rows[f"du_{axis}_max"][high],
                "mm",
                0.03,  # of reading the published figures
                ABAQUS_SOURCE,
                absolute=True,
            )


def published_cases() -> Iterator[tuple[tuple[int, str], pd.DataFrame]]:
    """Yield test and model with the rows of the published table."""
    table = pd.read_csv(TABLE, comment="#")
    for test, model in table[["test", "model"]].drop_duplicates().itertuples(index=False):
        rows = table[(table["test"] == test) & (table["model"] == model)]
        yield (int(str(test)), str(model)), rows.reset_index(drop=True)


def published_apex(rows: pd.DataFrame) -> pd.Series:
    """Return the height of the apex (mm), the mean of its two profiles, by row."""
    return rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)


def bubble_shapes(rows: pd.DataFrame, elements: int, solver: Solver) -> pd.DataFrame:
    """Compute the bubble of a case.

    Parameters
    ----------
    rows : DataFrame
        Of a case: moduli `E1`, `E2`, `G12` (GPa) and pressures `p_bar`.
    elements : int
        Of the whole disk.
    solver : Solver

    Returns
    -------
    DataFrame
        One row per pressure: the height `apex`, and the largest in-plane displacements `du_x` and
        `du_y`, mm.
    """
    warp, fill, shear = 1e3 * rows[["E1", "E2", "G12"]].iloc[0].to_numpy(float)
    law = HypoelasticLaw.linear(warp, fill, shear, 0.24, "incompressible")
    pressures = (0.1 * rows["p_bar"]).tolist()
    mesh = disk_mesh(100.0, elements, "quarter")
    increments = sorted({0.25 * pressures[0], 0.5 * pressures[0], *pressures})
    model = BubbleModel(mesh, 0.81, pressures, increments)
    displacement = solver.run(model, law).displacement
    largest = displacement.max(axis=1)
    return pd.DataFrame(
        {
            "apex": displacement[:, mesh.node_sets["apex"][0], 2],
            "du_x": largest[:, 0],
            "du_y": largest[:, 1],
        }
    )


#: Coefficients of the law in Table 4.2 of the thesis, row "solution", GPa.
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
#: MPa.
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
#: Largest displacement over the mean of the five, by nu12, read off Fig. 4.2 to three decimals.
FIGURE_4_2 = {0.05: 1.029, 0.15: 1.016, 0.25: 1.0015, 0.35: 0.985, 0.45: 0.967}


def table_4_2_law(nu12: float = 0.24) -> HypoelasticLaw:
    """Return the law of Table 4.2."""
    return HypoelasticLaw(1e3 * np.array(SOLUTION), nu12, np.array([0.13, 0.13, 0.13]))


def thesis_bubble() -> BubbleModel:
    """Return a quarter of the thesis' bubble: radius 100 mm, thickness 0.81 mm, seven pressures."""
    mesh = disk_mesh(100.0, 800, "quarter")
    return BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))


def marc_bubble() -> Iterator[Number]:
    """Compare the height of the apex with Marc's at the seven pressures.

    Two figures of the paper disagree by 5 %, and the load stepping is not known.
    """
    table = pd.read_csv(PUBLISHED / "marc_bubble_profiles.csv", comment="#")
    model = thesis_bubble()
    history = MembraneSolver().run(model, table_4_2_law())
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    source = "MSC Marc; Jekel et al., preprint of SMO (2016)"
    for pressure, ours in zip(1e3 * np.array(PRESSURES), apex, strict=True):
        theirs = table[np.isclose(table["p_kPa"], pressure)]["z_mm"].max()
        quantity = f"apex of Table 4.2, {pressure:g} kPa"
        yield Number(quantity, float(ours), float(theirs), "mm", 0.06, source)


def poisson_ratios() -> Iterator[Number]:
    """Compare the largest displacements, relative to the mean of the five.

    Marc's pressure did not follow the surface (docs/validation/published-bubble.md): with dead
    pressure ours are within 0.0005, with pressure that follows as a gas does at most 0.0070 off.
    """
    model = thesis_bubble()
    largest = []
    for nu12 in FIGURE_4_2:
        history = MembraneSolver().run(model, table_4_2_law(nu12))
        largest.append(np.linalg.norm(history.displacement[-1], axis=1).max())
    mean = np.mean(largest)
    for (nu12, theirs), displacement in zip(FIGURE_4_2.items(), largest, strict=True):
        quantity = f"largest displacement over the mean, nu12 {nu12:g}"
        ours = displacement / mean
        yield Number(quantity, ours, theirs, "", 0.0075, "thesis Fig. 4.2", absolute=True)
