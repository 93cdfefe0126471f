"""The command `export`, with the options of every format."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..materials.card import read_card
from ..materials.exports.base import Option, flag_of, options_of, write_export
from ..notes import note_records
from ..solvers.export_formats import FORMATS
from .options import with_options
from .terminal import FILE, command, show


def _values(option: Option) -> click.ParamType:
    """Return click's type for an option of an export format: its choices or its range."""
    if option.choices:
        return click.Choice(option.choices)
    smallest = option.smallest if option.exclusive_minimum is None else option.exclusive_minimum
    if option.kind is int:
        return click.IntRange(None if smallest is None else int(smallest))
    return click.FloatRange(smallest, option.largest, min_open=option.exclusive_minimum is not None)


#: The options of all export formats.
format_options = with_options(
    *(
        click.option(flag_of(name), name, type=_values(option), help=option.help)
        for name, option in options_of(FORMATS.values()).items()
    )
)


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
    settings = {option: value for option, value in options.items() if value is not None}
    FORMATS[name].check(settings)
    material = read_card(card)
    try:
        export = FORMATS[name].export(material, **settings)
    except InputError as error:
        raise InputError(card, error.field, error.problem) from None
    paths = _export_paths(card, name, list(export.files), out)
    write_export(export, paths, force)
    files = [str(path) for path in paths]
    result = {
        "files": files,
        "format": name,
        "carries": export.remarks.carries,
        "loses": export.remarks.loses,
        "confirm": export.remarks.confirm,
        "notes": note_records(export.remarks.notes),
    }
    show(result, [*export.remarks.lines(), f"written to {', '.join(files)}"], as_json)


def _export_paths(card: Path, name: str, suffixes: Sequence[str], out: Path | None) -> list[Path]:
    """Return where the files of an export go, the first to --out and the others beside it."""
    first, *further = suffixes
    default = f"{card.stem}-{name}{first}"
    target = Path(default) if out is None else out
    if target.is_dir():
        target = target / default
    # ".8" of "pvc-0.8" is no suffix.
    stem = target.with_suffix("") if target.suffix[1:2].isalpha() else target
    paths = [target, *(stem.with_name(f"{stem.name}{suffix}") for suffix in further)]
    if len(set(paths)) < len(paths):
        problem = f"{', '.join(further)} is what another file ends in; use {first}"
        raise InputError(None, "--out", f"{target}: {problem}")
    for path in paths:
        if path.exists() and path.samefile(card):
            raise InputError(None, "--out", f"{path} is the card itself; name another file")
    return paths
