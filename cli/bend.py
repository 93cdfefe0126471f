"""`bubblefit bend PROJECT.toml`: inflate and bend cylinders with material cards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .arguments import DATA, PROJECT
from .examples import examples
from .options import data_folders, folder_beside
from .predicting import prediction_options, run_predictions

KIND = "cylinder"


@click.command(
    "bend",
    epilog=examples(
        "bubblefit bend fabric.toml",
        "bubblefit bend fabric.toml --card out/fabric/material.toml --samples 0",
        'bubblefit bend fabric.toml --test "150 mm, 140 kPa" --resume',
    ),
)
@PROJECT
@DATA
@click.option(
    "--test", "--case", "tests", multiple=True, help="A cylinder by its name; several [all]."
)
@click.option(
    "--card", "cards", multiple=True,
    help="A card by its name, or a card's file; several [all, else the one just fitted].",
)  # fmt: skip
@prediction_options
def command(
    project: Path,
    data: tuple[str, ...],
    tests: tuple[str, ...],
    cards: tuple[str, ...],
    **options: Any,
) -> None:
    """Inflate and bend every cylinder of PROJECT.toml with every material card.

    Without a card in the project, or named, with the one that `bubblefit fit` wrote. Writes
    result.json, load_deflection.csv, runs.csv, figures, the bent beams for ParaView and
    report.html into the output folder. A run that fails is named and left out, everything else is
    written, the exit code is 4, and --resume tries it again.
    """
    from ..project.cards import usual_folder
    from ..project.project import read_project

    settings = read_project(project, data_folders(data))
    folder = options["out"]
    if folder is None:
        # Beside the folder of the project's fits, where it has any.
        alone = all(test.kind == KIND for test in settings.tests.values())
        folder = usual_folder(project) if alone else folder_beside(project, "bend")
    run_predictions(settings, folder, options, tests or [KIND], cards)
