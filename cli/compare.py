"""`bubblefit compare PROJECT.toml`: which form of the moduli do the tests support?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .ending import tell, written_to
from .examples import examples
from .fitting import fit_options, settings_given
from .options import command_line, data_folders, folder_beside, read_with_solver
from .progress import FitsProgress


@click.command(
    "compare",
    epilog=examples(
        "bubblefit compare project.toml",
        "bubblefit compare project.toml --form cubic --form spline:6 --folds 4",
    ),
)
@click.option(
    "--form",
    "forms",
    multiple=True,
    metavar="NAME",
    help="Form of the moduli, spline:8 with its number of knots; several [all].",
)
@click.option(
    "--folds", type=click.IntRange(min=2), default=5, show_default=True, help="Of the validation."
)
@click.option(
    "--fold-starts", type=click.IntRange(min=1), default=2, show_default=True, help="Of each fold."
)
@fit_options
def command(forms: tuple[str, ...], folds: int, fold_starts: int, **options: Any) -> None:
    """Fit every form of the moduli to PROJECT.toml's tests and cross-validate it.

    Each form from a few starts [5]; the error at specimens that the fit was not given says whether
    more coefficients are worth it. Writes comparison.csv, figures, report.html and result.json, and
    a folder for each form, into the output folder.
    """
    from ..notes import lines as note_lines
    from ..reports.law_page import lines_of
    from ..runs.compare import STARTS, compare_laws

    path: Path = options["project"]
    folder: Path = options["out"] or folder_beside(path, "compared")
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    project = settings_given(project, options)
    starts = options["starts"] or STARTS
    quiet = options["quiet"] or options["as_json"]
    with FitsProgress(starts, quiet, "{} moduli") as progress:
        comparison = compare_laws(
            project,
            options["tests"] or None,
            forms,
            folds=folds,
            starts=starts,
            fold_starts=fold_starts,
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress.saw,
            command_line=command_line(),
        )
    comparison.report(folder)
    result = comparison.result
    lines = [
        *lines_of(result),
        *note_lines(comparison.notes),
        written_to(folder),
    ]
    tell(result, lines, options["as_json"])
