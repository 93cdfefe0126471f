"""Tables of a bubble test: misfit by pressure, surfaces, every residual."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ...data.surfaces import write_surfaces
from ...identification.blocks import Blocks
from ...reports import Table
from ...writing import replacing
from ..exhibit import Output, Shown
from ..fittable import FittedTest
from .findings import objective_of

if TYPE_CHECKING:
    from .prepared import PreparedBubble

NOT_MATCHED = "for the record: the fit matched the points themselves"
SURFACES = "surfaces.csv"


def misfit_table(prepared: PreparedBubble, fitted: FittedTest) -> Table:
    """The blocks of the test's own objective, pressure by pressure."""
    objective = objective_of(fitted)
    residual = objective.residual(fitted.histories[0], fitted.nuisance)
    norms = Blocks(objective.sizes).norms(residual).reshape(-1, 3)
    note = (
        "RMS error over the largest measured value, direction by direction"
        if prepared.test.objective == "e"
        else "RMS error in mm, direction by direction"
    )
    kilo = [1e3 * t.pressure for t in objective.targets]
    rows: list[list[object]] = [[p, *n.tolist()] for p, n in zip(kilo, norms, strict=True)]
    return Table("Misfit by pressure", ["pressure, kPa", "x", "y", "z"], rows, note)


def surface_tables(prepared: PreparedBubble) -> list[Table]:
    """R^2 of the polynomial surfaces, where there are any."""
    if not prepared.surfaces:
        return []
    test = prepared.test
    rows: list[list[object]] = [
        [1e3 * p, *(f"{r:.5f}" for r in s.r_squared)]
        for p, s in zip(test.pressures, prepared.surfaces, strict=True)
    ]
    note = "" if test.match_by == "surfaces" else NOT_MATCHED
    title = f"R² of polynomial surfaces of degree {test.match_degree}"
    return [Table(title, ["pressure, kPa", "x", "y", "z"], rows, note)]


def write_surface_table(prepared: PreparedBubble, out: Output) -> list[Shown]:
    """surfaces.csv, where there are surfaces."""
    if not prepared.surfaces:
        return []
    with replacing(out.path(SURFACES)) as path:
        write_surfaces(prepared.surfaces, path)
    return [(out.name(SURFACES), "polynomial surfaces of the data")]


def residual_table(prepared: PreparedBubble, fitted: FittedTest) -> pd.DataFrame:
    """A row a place, pressure and direction.

    Columns part, frame (the number of the pressure, from 1), pressure_kPa, x_mm, y_mm, quantity
    (dx, dy, dz), measured, modelled, difference (modelled less measured, offset included), unit.
    """
    objective = objective_of(fitted)
    (comparison,) = fitted.comparisons
    nodes = comparison.model.mesh.points[:, :2]
    frames = []
    every = objective.modelled(fitted.histories[0].displacement, fitted.nuisance)
    for frame, (target, modelled) in enumerate(zip(objective.targets, every, strict=True), 1):
        places = target.at(nodes)
        for axis, name in enumerate(("dx", "dy", "dz")):
            frames.append(
                pd.DataFrame(
                    {
                        "part": "bubble",
                        "frame": frame,
                        "pressure_kPa": 1e3 * target.pressure,
                        "x_mm": places[:, 0],
                        "y_mm": places[:, 1],
                        "quantity": name,
                        "measured": np.asarray(target.displacement)[:, axis],
                        "modelled": modelled[:, axis],
                    }
                )
            )
    table = pd.concat(frames, ignore_index=True)
    table["difference"] = table["modelled"] - table["measured"]
    table["unit"] = objective.unit
    return table
