"""`bubblefit export`: a material card for another program."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..errors import InputError, OutputError
from ..materials.card import read_card
from ..materials.exports.abaqus_fabric import fabric
from ..materials.exports.abaqus_umat import umat
from ..materials.exports.base import Export, Format, Options, check_positive
from ..materials.exports.csv_tables import csv
from ..materials.exports.ls_dyna_mat34 import mat34
from ..materials.exports.marc_hypela2 import hypela2
from ..materials.exports.marc_nlelast import nlelast
from ..materials.responses import MEASURES, Measure
from ..materials.tables import POINTS, REACH
from ..solvers.calculix.export import calculix
from ..writing import replacing
from .options import exits

FORMATS: dict[str, Format] = {
    "marc": nlelast,
    "marc-hypela2": hypela2,
    "calculix": calculix,
    "abaqus-umat": umat,
    "abaqus-fabric": fabric,
    "ls-dyna-mat34": mat34,
    "csv": csv,
}
#: The formats that some options mean something to.
USES = {
    "points": ("marc", "abaqus-fabric", "ls-dyna-mat34", "csv"),
    "reach": ("marc", "abaqus-fabric", "ls-dyna-mat34", "csv"),
    "density": ("abaqus-fabric", "ls-dyna-mat34"),
    "measure": ("ls-dyna-mat34",),
}


@click.command("export")
@click.argument("card", type=click.Path(path_type=Path))
@click.option("--format", "name", type=click.Choice(list(FORMATS)), required=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File or folder to write to [CARD-FORMAT.* here]; a second file goes beside it.",
)
@click.option("--force", is_flag=True, help="Write over files that are there.")
@click.option("--points", type=click.IntRange(2), help=f"Points of a table or curve [{POINTS}].")
@click.option(
    "--reach",
    type=click.FloatRange(0, 10, min_open=True),
    help=f"Log strain where a table ends if the card has no range [{REACH}].",
)
@click.option(
    "--density", type=click.FloatRange(0, min_open=True), help="t/mm3, where the target needs one."
)
@click.option("--measure", type=click.Choice(MEASURES), help="Measure of LS-DYNA's curves [green].")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
@exits
def command(
    card: Path,
    name: str,
    out: Path | None,
    force: bool,
    points: int | None,
    reach: float | None,
    density: float | None,
    measure: Measure | None,
    as_json: bool,
) -> None:
    """Write the material of CARD (a material.toml) for another program.

    Each file begins with what the target carries of the law, what it loses, and what is to be
    confirmed there; the same is printed. See docs/exports.md.
    """
    given = {"points": points, "reach": reach, "density": density, "measure": measure}
    for option, value in given.items():
        if value is not None and name not in USES[option]:
            raise InputError(None, f"--{option}", f"means nothing to the format {name}")
    options = Options(
        POINTS if points is None else points, REACH if reach is None else reach, density, measure
    )
    material = read_card(card)
    try:
        check_positive(material)
        export = FORMATS[name](material, options)
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
    if as_json:
        said = {"carries": export.says.carries, "loses": export.says.loses}
        content = {"format": name, **said, "confirm": export.says.confirm}
        click.echo(json.dumps({"files": [str(path) for path in paths], **content}, indent=1))
        return
    for line in export.says.lines():
        click.echo(line)
    click.echo(f"written to {', '.join(map(str, paths))}")


def _targets(export: Export, out: Path | None, default: str) -> list[Path]:
    """A path for each file; the first has the very name that was asked for."""
    first, *others = export.files
    target = Path(default + first) if out is None else out
    if target.is_dir():
        target = target / (default + first)
    paths = [target, *(target.with_suffix(suffix) for suffix in others)]
    if len(set(paths)) < len(paths):
        problem = f"{', '.join(others)} is for the second file; use {first}"
        raise InputError(None, "--out", f"{target}: {problem}")
    return paths
