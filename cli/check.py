"""`bubblefit check PROJECT.toml`: look at the data before anything is fitted."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from .arguments import DATA, PROJECT, TESTS, TRUST, out_option
from .ending import tell, written_to
from .examples import examples
from .exits import exits
from .options import data_folders, folder_beside

DOUBTFUL = 2  # as for any bad input


@click.command(
    "check",
    epilog=examples(
        "bubblefit check project.toml",
        "bubblefit check project.toml --test bubble --trust preload",
    ),
)
@PROJECT
@TESTS
@out_option("out/NAME-check")
@DATA
@TRUST
@click.option("--json", "as_json", is_flag=True, help="Print check.json on stdout.")
@exits
def command(
    project: Path,
    tests: tuple[str, ...],
    out: Path | None,
    data: tuple[str, ...],
    trust: tuple[str, ...],
    as_json: bool,
) -> None:
    """Look at the data of PROJECT.toml, as every fit does before it begins.

    Names the traps that data can fall into: wrong units, flipped or swapped axes, coordinates of
    the deformed sheet, rejected points at zero, frames repeated or out of order, a frame that is
    turned, tilted or off the centre, preload, rows after failure. Writes pictures and tables into
    the output folder. Exit code 2 where a fit would not begin.
    """
    from ..project.project import read_project
    from ..runs.check import check

    found = check(read_project(project, data_folders(data)), tests or None, trust)
    folder = out or folder_beside(project, "check")
    found.report(folder)
    tell(found.result, [*found.lines(), written_to(folder)], as_json)
    if not found.sound:
        sys.exit(DOUBTFUL)
