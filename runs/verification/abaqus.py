"""Verification of bubbles with linear laws against Abaqus, as read off published figures."""

from __future__ import annotations

from collections.abc import Iterator

from ...lazy_modules import pandas as pd
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import disk_mesh
from ...solvers.base import Solver
from ...solvers.membrane.solver import MembraneSolver
from .number import PUBLISHED, Number

TABLE = PUBLISHED / "abaqus_linear_orthotropic.csv"
SOURCE = "Abaqus M3D4; figures of inv_bubble_opt (Jekel)"


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
            yield Number(f"apex, {names[row]}", apex, theirs[row], "mm", 1e-3, SOURCE)
        for axis in "xy":
            yield Number(
                f"largest u_{axis}, {names[high]}",
                computed[f"du_{axis}"][high],
                rows[f"du_{axis}_max"][high],
                "mm",
                0.03,  # of reading the published figures
                SOURCE,
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
