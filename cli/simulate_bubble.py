"""`bubblefit simulate bubble`: inflate a bubble with a material card."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..materials.card import read_card
from ..projects.bubble import read_project
from ..reports import plot_profiles, write_vtu
from ..studies.bubble_setup import bubble_model
from ..studies.results import STRAINS, UNSTABLE, beyond_card, strains_of
from ..studies.setup import project_solver
from ..writing import replacing
from .options import exits, result_folder, solver_choice, with_solver
from .progress import run_progress


@click.command("bubble")
@click.argument("project", type=click.Path(path_type=Path))
@click.option("--card", "card_path", type=click.Path(path_type=Path), required=True)
@click.option("--out", type=click.Path(path_type=Path), help="Output folder [out/NAME-simulated].")
@solver_choice
@click.option("--overwrite", is_flag=True, help="Replace what the output folder holds.")
@click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
@exits
def simulate_bubble(
    project: Path,
    card_path: Path,
    out: Path | None,
    solver_given: dict[str, Any],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Inflate the bubble of PROJECT.toml with the material of a card."""
    settings = with_solver(read_project(project, need_data=False), solver_given)
    card = read_card(card_path)
    solver = project_solver(settings)
    folder = result_folder(project, "simulated", out, overwrite)
    model = replace(bubble_model(settings), thickness=card.thickness)
    with run_progress(solver, len(model.increments), as_json):
        history = solver.run(model, card.law)
    u = history.displacement
    apex = int(model.mesh.node_sets["apex"][0])
    reached = strains_of(history)
    beyond = beyond_card(reached, card)
    unstable = [UNSTABLE] if history.stable is False else []
    result = {
        "command": "simulate bubble",
        "solver": solver.name,
        "card": str(card_path),
        "pressure_kPa": (1e3 * history.load).tolist(),
        "apex_mm": u[:, apex, 2].tolist(),
        "strain_reached": dict(zip(STRAINS, reached.tolist(), strict=True)),
        "warnings": [*history.remarks, *beyond, *unstable],
    }
    with replacing(folder / "displacement.csv") as path:
        path.write_text(_table(1e3 * history.load, model.mesh.points, u), encoding="utf-8")
    write_vtu(model.mesh, u[-1], folder / "bubble.vtu")
    plot_profiles(folder / "profiles.png", settings.pressures, model.mesh.points, u)
    # Last: where it is, the output is complete.
    with replacing(folder / "result.json") as path:
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    for p, height in zip(1e3 * history.load, u[:, apex, 2], strict=True):
        click.echo(f"{p:8.1f} kPa   apex {height:8.3f} mm")
    for words in result["warnings"]:
        click.echo(f"note: {words}")
    click.echo(f"written to {folder}")


def _table(pressures: np.ndarray, points: np.ndarray, displacement: np.ndarray) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["pressure_kPa", "node", "x_mm", "y_mm", "dx_mm", "dy_mm", "dz_mm"])
    for pressure, frame in zip(pressures, displacement, strict=True):
        for node, (point, move) in enumerate(zip(points, frame, strict=True)):
            values = (pressure, *point[:2], *move)
            row = [f"{v:.9g}" for v in values]
            writer.writerow([row[0], node, *row[1:]])
    return text.getvalue()
