"""Forward analyses of a bubble test with cards: quantities of interest, tables, figures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...models.bubble import BubbleModel
from ...reports import plot_profiles
from ...solvers.base import History
from ...writing import replacing
from ..base import CardRun, Simulation, Studied
from ..exhibit import Output
from ..notes import STRAINS, strains_of
from .inflated import write_series
from .sheet_section import Sheet
from .test import PART, BubbleTest


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
        plot_profiles(
            out.path(f"profiles{suffix}.png"),
            test.pressures,
            model.mesh.points,
            history.displacement,
        )
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
