"""Forward analyses of a bubble test with cards: quantities of interest, tables, figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import QhullError, cKDTree

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import surface_strain
from ...reports.bubbles import cut_charts
from ...reports.vega import save
from ...reports.vtu import write_pvd, write_vtu
from ...solvers.base import History
from ...writing import replacing
from ..kinds import STRAINS, CardRun, Output, Simulation, Studied, strains_of
from .section import Sheet
from .test import PART, BubbleTest

# The inflated sheet pressure by pressure: strain, stress, wrinkles, and what a fit leaves.
#
# For ParaView: bubble.pvd, which plays one .vtu a pressure.

Array = NDArray[np.float64]

#: States of a quad by its principal stresses, as the files have them.
TAUT, WRINKLED, SLACK = 0, 1, 2
#: Stress over the largest of the sheet that is taken as none.
NONE = 1e-6
#: Distances between neighbouring measured places: farther from all of them nothing is measured.
FAR = 2.0


@dataclass(frozen=True, eq=False)
class InflatedSheet:
    """The sheet at one reported pressure.

    pressure : MPa. displacement : (nodes, 3) mm. strain : (quads, 3) log strain (eps1, eps2,
    gamma12) in the middle of the quads; stress : (quads, 3) MPa, Cauchy, along the turned yarns, in
    the same order. state : (quads,) of `TAUT`, `WRINKLED` (tension in one direction only), `SLACK`
    (in none).
    """

    pressure: float
    displacement: Array
    strain: Array
    stress: Array
    state: NDArray[np.intp]


def inflated_sheets(
    model: BubbleModel, history: History, law: HypoelasticLaw
) -> Iterator[InflatedSheet]:
    """One a reported pressure; the law is integrated along the increments that the history has."""
    path, reported = history.path, model.reported
    if path is None or len(path) != len(model.increments):
        path, reported = history.displacement, np.arange(len(history.displacement))
    frames = {int(step): frame for frame, step in enumerate(reported)}
    strain = stress = np.zeros((len(model.mesh.quads), 3))
    for step, u in enumerate(path):
        before, strain = strain, sheet_strain(model, u)
        stress, _ = law.increment(before, strain, stress)
        if step in frames:
            load = float(history.load[frames[step]])
            yield InflatedSheet(load, u, strain, stress, states(stress))


def sheet_strain(model: BubbleModel, displacement: Array) -> Array:
    """(quads, 3) log strain since the sheet was without stress; displacement (nodes, 3) mm."""
    mesh, rest = model.mesh, model.stress_free
    warp = mesh.warp
    if warp is None:
        warp = np.tile([1.0, 0.0, 0.0], (len(mesh.quads), 1))
    return surface_strain(replace(mesh, points=rest, warp=warp), mesh.points + displacement - rest)


def states(stress: Array) -> NDArray[np.intp]:
    """(n,) states of stresses (n, 3) of one sheet."""
    mean, half = 0.5 * (stress[:, 0] + stress[:, 1]), 0.5 * (stress[:, 0] - stress[:, 1])
    size = np.hypot(half, stress[:, 2])
    none = NONE * float(np.abs(mean).max() + size.max())
    largest, least = mean + size, mean - size
    return np.where(largest <= none, SLACK, np.where(least <= none, WRINKLED, TAUT))


def at_nodes(nodes: Array, places: Array, values: Array) -> Array:
    """Values (n, 3) at measured places (n, 2) carried to nodes (nodes, 2); NaN where none is near.

    Linear between the places; a node beyond them, or in a hole of them, has none.
    """
    if len(places) == len(nodes) and np.allclose(places, nodes):
        return values
    found = np.full((len(nodes), 3), np.nan)
    if len(places) < 4:
        return found
    tree = cKDTree(places)
    apart = float(np.median(tree.query(places, k=2)[0][:, 1]))
    near = tree.query(nodes)[0] <= FAR * apart
    if near.any():
        with suppress(QhullError):  # all places on one line: there is nothing between them
            found[near] = LinearNDInterpolator(places, values)(nodes[near])
    return found


def write_series(
    model: BubbleModel,
    history: History,
    law: HypoelasticLaw,
    path: Path,
    residuals: Sequence[Array | None] = (),
) -> Path:
    """Write the series; each file holds the sheet as it is inflated, with its fields.

    Point data: displacement (mm), and residual_mm, measured less modelled, where there are
    `residuals` (nodes, 3), one a reported pressure. Cell data: log_strain_1_2_12,
    stress_1_2_12_MPa, wrinkling (0 taut, 1 wrinkled, 2 slack).

    Parameters
    ----------
    path : of the collection, ends in .pvd; the files lie in a folder of its name.

    Raises
    ------
    OutputError : they cannot be written.
    """
    folder, files = path.with_name(f"{path.stem}-vtu"), []
    for number, sheet in enumerate(inflated_sheets(model, history, law)):
        own = residuals[number] if number < len(residuals) else None
        file = folder / f"{number:03d}-{1e3 * sheet.pressure:.4g}kPa.vtu"
        write_vtu(
            model.mesh,
            sheet.displacement,
            file,
            {} if own is None else {"residual_mm": own},
            {
                "log_strain_1_2_12": sheet.strain,
                "stress_1_2_12_MPa": sheet.stress,
                "wrinkling": sheet.state,
            },
        )
        files.append((1e3 * sheet.pressure, file))
    return write_pvd(path, files)


def apex_heights(model: BubbleModel, history: History) -> np.ndarray:
    """(frames,) mm."""
    apex = int(model.mesh.node_sets["apex"][0])
    return np.asarray(history.displacement[:, apex, 2])


def quantities(model: BubbleModel, history: History) -> dict[str, float]:
    """Apex heights, and the largest in-plane displacement at the last pressure."""
    kilo, heights = 1e3 * history.load, apex_heights(model, history)
    in_plane = np.linalg.norm(history.displacement[-1, :, :2], axis=1).max()
    values = {f"apex at {p:.4g} kPa, mm": float(z) for p, z in zip(kilo, heights, strict=True)}
    last = f"largest in-plane displacement at {kilo[-1]:.4g} kPa, mm"
    return {**values, last: float(in_plane)}


def responses(model: BubbleModel, history: History) -> dict[str, float]:
    """Largest displacement at every pressure, mm."""
    largest = np.linalg.norm(history.displacement, axis=2).max(axis=1)
    return {f"{p:.4g} kPa": float(u) for p, u in zip(1e3 * history.load, largest, strict=True)}


STUDIED = Studied(
    steps=lambda model: model.increments,
    quantities=quantities,
    responses=responses,
    response="largest displacement",
)


def simulate(
    test: BubbleTest,
    cards: Mapping[str, MaterialCard],
    runs: Mapping[tuple[str, str], CardRun],
    out: Output,
    within_range: bool = False,
) -> Simulation:
    """displacement.csv, bubble.pvd and profiles.png of every card, and the apex heights."""
    numbers: dict[str, dict[str, object]] = {}
    lines: list[str] = []
    for i, name in enumerate(cards, start=1):
        run = runs[name, PART]
        if isinstance(run.outcome, SolverFailure):
            numbers[name] = {"failed": run.outcome.reason}
            lines.append(f"{name}: failed: {run.outcome.reason}")
            continue
        suffix = "" if len(cards) == 1 else f"-{i}"
        history, model = run.outcome, run.model
        heights = apex_heights(model, history)
        reached = strains_of(history)
        numbers[name] = {
            "pressure_kPa": (1e3 * history.load).tolist(),
            "apex_mm": heights.tolist(),
            "strain_reached": dict(zip(STRAINS, reached.tolist(), strict=True)),
        }
        with replacing(out.path(f"displacement{suffix}.csv")) as path:
            displacement_table(model, history).to_csv(path, index=False, float_format="%.9g")
        write_series(model, history, cards[name].law, out.path(f"bubble{suffix}.pvd"))
        cuts = cut_charts(name, test.pressures, model.mesh.points, history.displacement)
        save(out.path(f"profiles{suffix}.png"), cuts)
        lines += [f"{name}:"] if len(cards) > 1 else []
        lines += [
            f"{p:8.1f} kPa   apex {z:8.3f} mm"
            for p, z in zip(1e3 * history.load, heights, strict=True)
        ]
    lines += [f"note: {words}" for words in _flat(test)]
    only = numbers[next(iter(cards))] if len(cards) == 1 else {}
    return Simulation({**only, "cards": numbers}, lines)


def _flat(test: BubbleTest) -> list[str]:
    """That a forward analysis knows nothing of how the sheet of the test lay."""
    if test.sheet == Sheet():
        return []
    return ["simulated from a flat and taut sheet with a fixed rim, whatever [bubble.sheet] says"]


def displacement_table(model: BubbleModel, history: History) -> pd.DataFrame:
    """A row a node and pressure: pressure_kPa, node, x_mm, y_mm, dx_mm, dy_mm, dz_mm."""
    points, count = model.mesh.points[:, :2], len(model.mesh.points)
    frames = [
        pd.DataFrame(
            {
                "pressure_kPa": np.full(count, 1e3 * load),
                "node": np.arange(count),
                "x_mm": points[:, 0],
                "y_mm": points[:, 1],
                **{f"d{axis}_mm": u[:, k] for k, axis in enumerate("xyz")},
            }
        )
        for load, u in zip(history.load, history.displacement, strict=True)
    ]
    return pd.concat(frames, ignore_index=True)
