"""Bubbles of linear orthotropic constants, computed with Abaqus' incompressible membranes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from ...materials.law import HypoelasticLaw
from ...meshes.disk import disk_mesh
from ...models.bubble import BubbleModel
from ...solvers.base import Solver
from ...solvers.membrane.solver import MembraneSolver
from .number import Number

PUBLISHED = Path(__file__).parent / "published"
TABLE = PUBLISHED / "abaqus_linear_orthotropic.csv"
SOURCE = "Abaqus M3D4; figures of inv_bubble_opt (Jekel)"
#: Error of reading the published figures, mm.
DIGITISED = 0.03
#: A lower pressure, where reading the figure is 0.3 %, and the highest.
LOW_BAR = 1.0
ELEMENTS = 1600


def abaqus_bubbles() -> Iterator[Number]:
    """Apex at about 100 kPa and at the highest pressure, and the largest in-plane displacements."""
    for (test, model), rows in cases():
        found = shapes(rows, ELEMENTS, MembraneSolver())
        low, high = int((rows["p_bar"] - LOW_BAR).abs().to_numpy().argmin()), len(rows) - 1
        for i in (low, high):
            where = f"test {test} {model}, {100 * rows['p_bar'][i]:.0f} kPa"
            apex = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
            yield Number(f"apex, {where}", found["apex"][i], apex, "mm", 1e-3, SOURCE)
        for axis in "xy":
            ours, theirs = found[f"du_{axis}"][high], rows[f"du_{axis}_max"][high]
            what = f"largest u_{axis}, {where}"
            yield Number(what, ours, theirs, "mm", DIGITISED, SOURCE, absolute=True)


def cases() -> Iterator[tuple[tuple[int, str], pd.DataFrame]]:
    """Test and model, with the rows of the published table."""
    table = pd.read_csv(TABLE, comment="#")
    for test, model in table[["test", "model"]].drop_duplicates().itertuples(index=False):
        rows = table[(table["test"] == test) & (table["model"] == model)]
        yield (int(str(test)), str(model)), rows.reset_index(drop=True)


def shapes(rows: pd.DataFrame, elements: int, solver: Solver) -> pd.DataFrame:
    """apex, du_x and du_y (mm, the largest in-plane displacements) at the pressures of `rows`."""
    warp, fill, shear = 1e3 * rows[["E1", "E2", "G12"]].iloc[0].to_numpy(float)
    law = HypoelasticLaw.linear(warp, fill, shear, 0.24, "incompressible")
    pressures = (0.1 * rows["p_bar"]).tolist()
    mesh = disk_mesh(100.0, elements, "quarter")
    steps = sorted({0.25 * pressures[0], 0.5 * pressures[0], *pressures})
    u = solver.run(BubbleModel(mesh, 0.81, pressures, steps), law).displacement
    return pd.DataFrame(
        {
            "apex": u[:, mesh.node_sets["apex"][0], 2],
            "du_x": u[..., 0].max(axis=1),
            "du_y": u[..., 1].max(axis=1),
        }
    )
