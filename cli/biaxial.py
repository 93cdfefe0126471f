"""`bubblefit biaxial PROJECT.toml`: constants that a designer types in, from biaxial tests."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import click

from .arguments import AS_JSON, DATA, OVERWRITE, PROJECT, TESTS, out_option
from .ending import tell, written_to
from .examples import examples
from .exits import exits
from .options import data_folders, result_folder

UNLOADED = {"8": False, "10": True}


@click.command(
    "biaxial",
    epilog=examples(
        "bubblefit biaxial project.toml",
        "bubblefit biaxial project.toml --paths 10 --free",
        "bubblefit biaxial project.toml --ratio 1:1 --ratio 2:1 --out out/two-ratios",
    ),
)
@PROJECT
@TESTS
@click.option("--paths", type=click.Choice(list(UNLOADED)), default="8", show_default=True,
              help="Of five ratios: 10 with the strains of unloaded yarns, 8 without.")  # fmt: skip
@click.option("--reciprocal/--free", default=True, show_default=True,
              help="Whether nu_warp / E_fill = nu_fill / E_warp is asked for.")  # fmt: skip
@click.option("--minimise", type=click.Choice(["strain", "load"]), default="strain",
              show_default=True, help="Whose squares are least.")  # fmt: skip
@click.option("--ratio", "ratios", multiple=True, metavar="W:F", help="Only these; several.  [all]")
@out_option("out/NAME-biaxial")
@DATA
@OVERWRITE
@AS_JSON
@exits
def command(
    project: Path,
    tests: tuple[str, ...],
    paths: str,
    reciprocal: bool,
    minimise: str,
    ratios: tuple[str, ...],
    out: Path | None,
    data: tuple[str, ...],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Linear constants per width (E, nu) of the biaxial tests of PROJECT.toml.

    Each yarn's strain is replaced by a line over the larger load, then least squares. What is
    chosen here is written beside what all other choices give. A law of any form is fitted to the
    same tests by `bubblefit fit`, and made into such constants by `bubblefit export`.
    """
    from ..experiments.biaxial.data import plain_ratio
    from ..experiments.biaxial.evaluation import evaluate_test, lines_of, numbers_of
    from ..experiments.biaxial.report import write_tables
    from ..experiments.biaxial.test import BiaxialTest
    from ..experiments.kinds import Output
    from ..files import __version__
    from ..materials.designers import Minimise, Options
    from ..notes import lines as note_lines
    from ..notes import write_notes
    from ..project.project import read_project
    from ..runs.folder import Store

    read = read_project(project, data_folders(data))
    chosen = read.chosen(list(tests) or "biaxial", fitted=True)
    found = [test for test in chosen if isinstance(test, BiaxialTest)]
    wanted = tuple(plain_ratio(ratio) for ratio in ratios)
    options = Options(UNLOADED[paths], reciprocal, cast(Minimise, minimise), wanted)
    evaluations = [evaluate_test(test, options) for test in found]
    folder = result_folder(project, "biaxial", out, overwrite)
    folder.mkdir(parents=True, exist_ok=True)
    for one in evaluations:
        write_tables(one, folder, Output.of(folder, one.test, len(evaluations) > 1).prefix)
    notes = [note for one in evaluations for note in one.notes]
    write_notes(folder, notes)
    result = {
        "command": "biaxial",
        "title": read.title,
        "version": __version__,
        "tests": {one.test: numbers_of(one) for one in evaluations},
    }
    Store(folder).finish(result)
    said = [line for one in evaluations for line in lines_of(one)]
    tell(result, [*said, *note_lines(notes), written_to(folder)], as_json)
