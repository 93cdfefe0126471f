"""`bubblefit simulate uniaxial`: material cards on the three strips (Figs 5.10 to 5.12)."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import click

from ..errors import SolverFailure
from ..projects.uniaxial import read_uniaxial
from ..solvers.base import Solver
from ..studies.cards_on_strips import cards_lines, cards_result, run_cards, write_cards
from ..writing import replacing
from .options import exits, named_cards, result_folder, solver_choice, with_solver
from .progress import run_progress


@click.command("uniaxial")
@click.argument("project", type=click.Path(path_type=Path))
@click.option(
    "--card",
    "cards",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    help="A material card; several are drawn in one figure.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Output folder [out/NAME-simulated].")
@click.option("--data", type=click.Path(path_type=Path), help="Folder of the measured data.")
@solver_choice
@click.option(
    "--within-range", is_flag=True, help="End each curve where the card's valid range ends."
)
@click.option("--overwrite", is_flag=True, help="Replace what the output folder holds.")
@click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
@exits
def simulate_uniaxial(
    project: Path,
    cards: tuple[Path, ...],
    out: Path | None,
    data: Path | None,
    solver_given: dict[str, Any],
    within_range: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Pull the strips of PROJECT.toml with the materials of one or several cards.

    Measured curves are drawn beside them where they are there. A card whose analysis fails on a
    strip is left out there, and named; when nothing ends well the exit code is 4.
    """
    settings = with_solver(read_uniaxial(project, data, need_data=False), solver_given)
    named = named_cards(cards)
    folder = result_folder(project, "simulated", out, overwrite)

    def progress(solver: Solver, increments: int) -> AbstractContextManager[None]:
        return run_progress(solver, increments, as_json)

    runs = run_cards(settings, named, within_range, progress)
    failures = [run for run in runs.values() if isinstance(run, SolverFailure)]
    if len(failures) == len(runs):
        raise failures[0]
    result = cards_result(settings, named, runs)
    write_cards(settings, list(named), runs, folder)
    # Last: where it is, the output is complete.
    with replacing(folder / "result.json") as path:
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    for words in cards_lines(result):
        click.echo(words)
    click.echo(f"written to {folder}")
