"""`bubblefit export` and `bubblefit biaxial`: cards for other programs, constants of designers."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import click

from ..errors import InputError, OutputError, rows
from ..errors import lines as note_lines
from ..experiments.biaxial.data import plain_ratio
from ..experiments.biaxial.evaluation import evaluate_test, lines_of, numbers_of
from ..experiments.biaxial.report import write_tables
from ..experiments.biaxial.test import BiaxialTest
from ..experiments.kinds import Output
from ..files import __version__, replacing, write_notes
from ..materials.card import read_card
from ..materials.designers import Minimise, Options
from ..materials.exports.base import Export, Option, options_of
from ..project.project import read_project
from ..runs.folder import Store
from ..solvers.registry import FORMATS
from .options import (
    AS_JSON,
    DATA,
    OVERWRITE,
    PROJECT,
    TESTS,
    data_folders,
    out_option,
    result_folder,
)
from .terminal import FILE, command, show, written_to

#: --paths of five ratios: whether the strains of unloaded yarns are used.
UNLOADED = {"8": False, "10": True}


def format_options(command: Any) -> Any:
    """Add the options of all formats to the command."""
    for name, known in reversed(list(options_of(FORMATS.values()).items())):
        command = click.option(f"--{name}", type=_values(known), help=known.help)(command)
    return command


def _values(known: Option) -> click.ParamType:
    if known.choices:
        return click.Choice(known.choices)
    least = known.least if known.above is None else known.above
    if known.kind is int:
        return click.IntRange(None if least is None else int(least))
    return click.FloatRange(least, known.most, min_open=known.above is not None)


@command(
    "export",
    "bubblefit export out/fabric/material.toml --format marc",
    "bubblefit export material.toml --format calculix --out for-ccx --force",
)
@click.argument("card", type=FILE)
@click.option("--format", "name", type=click.Choice(list(FORMATS)), required=True)
@click.option(
    "--out", type=FILE, help="File or folder to write to [CARD-FORMAT.* here]; others go beside it."
)
@click.option("--force", is_flag=True, help="Write over files that are there.")
@format_options
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def export_command(
    card: Path, name: str, out: Path | None, force: bool, as_json: bool, **options: Any
) -> None:
    """Write the material of CARD (a material.toml) for another program.

    Each file begins with the parts of the law that the target keeps, those it loses, and those to
    be confirmed there; the same is printed. See `bubblefit docs exports`.
    """
    given = {option: value for option, value in options.items() if value is not None}
    FORMATS[name].check(given)
    material = read_card(card)
    try:
        export = FORMATS[name].export(material, **given)
    except InputError as error:
        raise InputError(card, error.field, error.problem) from None
    paths = _targets(export, out, f"{card.stem}-{name}")
    for path in paths:
        if path.exists() and path.samefile(card):
            raise InputError(None, "--out", f"{path} is the card itself; name another file")
        if path.exists() and not force:
            raise OutputError(f"{path}: is already there; use --force or another --out")
    for path, text in zip(paths, export.files.values(), strict=True):
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    files = [str(path) for path in paths]
    said: dict[str, Any] = {"carries": export.says.carries, "loses": export.says.loses}
    said |= {"confirm": export.says.confirm, "notes": rows(export.says.notes)}
    lines = [*export.says.lines(), f"written to {', '.join(files)}"]
    show({"files": files, "format": name, **said}, lines, as_json)


def _targets(export: Export, out: Path | None, default: str) -> list[Path]:
    """Return a path for each file; the first has the name that was given."""
    first, *others = export.files
    target = Path(default + first) if out is None else out
    if target.is_dir():
        target = target / (default + first)
    paths = [target, *(target.with_suffix(suffix) for suffix in others)]
    if len(set(paths)) < len(paths):
        problem = f"{', '.join(others)} is what another file ends in; use {first}"
        raise InputError(None, "--out", f"{target}: {problem}")
    return paths


@command(
    "biaxial",
    "bubblefit biaxial project.toml",
    "bubblefit biaxial project.toml --paths 10 --free",
    "bubblefit biaxial project.toml --ratio 1:1 --ratio 2:1 --out out/two-ratios",
)
@PROJECT
@TESTS
@click.option("--paths", type=click.Choice(list(UNLOADED)), default="8", show_default=True,
              help="Of five ratios: 10 with the strains of unloaded yarns, 8 without.")  # fmt: skip
@click.option("--reciprocal/--free", default=True, show_default=True,
              help="Require nu_warp / E_fill = nu_fill / E_warp, or not.")  # fmt: skip
@click.option("--minimise", type=click.Choice(["strain", "load"]), default="strain",
              show_default=True, help="The squares that are minimised.")  # fmt: skip
@click.option("--ratio", "ratios", multiple=True, metavar="W:F", help="Ratios; several.  [all]")
@out_option("out/NAME-biaxial")
@DATA
@OVERWRITE
@AS_JSON
def biaxial_command(
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
    """Evaluate linear constants per width (E, nu) of the biaxial tests of PROJECT.toml.

    Replaces each yarn's strain by a line over the larger load, then takes least squares. The
    results of all other choices of options are written beside. `bubblefit fit` fits a law of any
    form to the same tests, and `bubblefit export` turns it into such constants.
    """
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
    show(result, [*said, *note_lines(notes), written_to(folder)], as_json)
