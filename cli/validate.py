"""`bubblefit validate PROJECT.toml`: does a fit foretell the test that it was not given?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from .exits import resumable
from .fitting import fit_options
from .options import (
    command_line,
    data_folders,
    folder_beside,
    read_with_solver,
    result_folder,
)
from .progress import FitsProgress


@click.command("validate")
@click.option(
    "--form",
    "forms",
    multiple=True,
    metavar="NAME",
    help="Of the moduli; several.  [the project's]",
)
@click.option(
    "--card", "cards", multiple=True, metavar="CARD", help="Judge it instead of a fit; several."
)
@fit_options
def command(forms: tuple[str, ...], cards: tuple[str, ...], **options: Any) -> None:
    """Leave each test of PROJECT.toml out of the fit in turn, and judge the fit there.

    Or judge cards at the tests, without a fit. Writes validation.csv and result.json, and a folder
    for each fit, into the output folder.
    """
    from ..fits.cards import chosen_cards
    from ..notes import lines as note_lines
    from ..studies.validation import STARTS, judge_cards, validate

    path: Path = options["project"]
    folder: Path = options["out"] or folder_beside(path, "validated")
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    trusted = [*project.fit.trust, *options["trust"]]
    project = project.with_fit(**{k: options[k] for k in ("seed", "method", "jobs")}, trust=trusted)
    tests, starts = options["tests"] or None, options["starts"] or STARTS
    quiet = options["quiet"] or options["as_json"]
    if cards:
        folder = result_folder(path, "validated", options["out"], options["overwrite"])
        validation = judge_cards(project, chosen_cards(project, cards), tests)
    else:
        with resumable(folder), FitsProgress(starts, quiet) as progress:
            validation = validate(
                project, tests, forms, starts=starts, out=folder, resume=options["resume"],
                overwrite=options["overwrite"], progress=progress.saw,
                command_line=command_line(),
            )  # fmt: skip
    validation.write(folder)
    lines = [*validation.lines(), *note_lines(validation.notes), f"written to {folder}"]
    said = json.dumps(validation.result, indent=1) if options["as_json"] else "\n".join(lines)
    click.echo(said)
