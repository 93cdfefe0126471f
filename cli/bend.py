"""`bubblefit bend PROJECT.toml`: inflate and bend cylinders with material cards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..projects.bend import read_bend
from ..studies.bend_setup import chosen
from .bend_runs import bend_options, run_bend_study
from .options import default_folder, with_solver


@click.command("bend")
@click.argument("project", type=click.Path(path_type=Path))
@click.option("--data", type=click.Path(path_type=Path), help="Folder of the measured data.")
@click.option("--case", "cases", multiple=True, help="A case by its name; several [all].")
@click.option(
    "--card", "cards", multiple=True, help="A card by its name, or a card's file; several [all]."
)
@bend_options
def command(
    project: Path,
    data: Path | None,
    cases: tuple[str, ...],
    cards: tuple[str, ...],
    **options: Any,
) -> None:
    """Inflate and bend every cylinder of PROJECT.toml with every material card.

    Writes result.json, load_deflection.csv, runs.csv, figures, the bent beams for ParaView and
    report.html into the output folder. A run that fails is named and left out; when none ends
    well the exit code is 4.
    """
    settings = with_solver(read_bend(project, data), options["solver_given"])
    picked = chosen(settings, cases, cards)
    run_bend_study("bend", picked, options["out"] or default_folder(project), options)
