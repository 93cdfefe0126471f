"""`bubblefit export`: a material card for another program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..errors import InputError, OutputError
from ..files import replacing
from ..materials.card import read_card
from ..materials.exports.base import Export, Option, options_of
from ..notes import rows
from ..solvers.registry import FORMATS
from .ending import tell
from .examples import examples
from .exits import exits


def format_options(command: Any) -> Any:
    """Give the command the options of all formats."""
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


@click.command(
    "export",
    epilog=examples(
        "bubblefit export out/fabric/material.toml --format marc",
        "bubblefit export material.toml --format calculix --out for-ccx --force",
    ),
)
@click.argument("card", type=click.Path(path_type=Path))
@click.option("--format", "name", type=click.Choice(list(FORMATS)), required=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File or folder to write to [CARD-FORMAT.* here]; others go beside it.",
)
@click.option("--force", is_flag=True, help="Write over files that are there.")
@format_options
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
@exits
def command(
    card: Path, name: str, out: Path | None, force: bool, as_json: bool, **options: Any
) -> None:
    """Write the material of CARD (a material.toml) for another program.

    Each file begins with what the target carries of the law, what it loses, and what is to be
    confirmed there; the same is printed. See `bubblefit docs exports`.
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
    tell({"files": files, "format": name, **said}, lines, as_json)


def _targets(export: Export, out: Path | None, default: str) -> list[Path]:
    """A path for each file; the first has the very name that was asked for."""
    first, *others = export.files
    target = Path(default + first) if out is None else out
    if target.is_dir():
        target = target / (default + first)
    paths = [target, *(target.with_suffix(suffix) for suffix in others)]
    if len(set(paths)) < len(paths):
        problem = f"{', '.join(others)} is what another file ends in; use {first}"
        raise InputError(None, "--out", f"{target}: {problem}")
    return paths
