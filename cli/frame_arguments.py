"""What commands that read frames share: how they are read, a file to write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from ..errors import InputError, OutputError
from ..readers.frames import QUANTITIES
from ..readers.sections import LENGTH_UNITS
from .arguments import Command, Decorator, with_options


def frame_options(command: Command) -> Command:
    """How the files are read: --format, --columns, --flag-column, --length-unit."""
    units = click.Choice(list(LENGTH_UNITS))
    decorators: list[Decorator] = [
        click.option("--format", metavar="NAME", help="Of the frames; found by their content."),
        click.option("--columns", metavar="x=..,..", help="Names in the files, where not found."),
        click.option("--flag-column", metavar="NAME", help="Rows where it is not 0 are lost."),
        click.option("--length-unit", type=units, default="mm", help="Of the files [mm]."),
    ]
    return with_options(command, decorators)


def check_out(out: Path, inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Whether a file may be written: not one of those read, nor one that is there.

    Raises
    ------
    OutputError : it may not.
    """
    if out.resolve() in [file.resolve() for file in inputs if file is not None]:
        raise OutputError(f"{out}: is one of the files to be read; choose another --out")
    if out.exists() and not overwrite:
        raise OutputError(f"{out}: is already there; use --overwrite or another --out")


def columns_named(given: str | None) -> dict[str, str] | None:
    """Names in the files of some of x, y, z, dx, dy, dz, as in "x=X,dz=W".

    Raises
    ------
    InputError : what is not written so, no such quantity, a column for two.
    """
    if given is None:
        return None
    names: dict[str, str] = {}
    for part in given.split(","):
        quantity, equals, name = (piece.strip() for piece in part.partition("="))
        if not (equals and name):
            problem = f"expected such as x=X,y=Y,z=Z,dx=U,dy=V,dz=W, got {part.strip()!r}"
            raise InputError(None, "columns", problem)
        if quantity not in QUANTITIES:
            problem = f"unknown quantity {quantity!r}; expected {', '.join(QUANTITIES)}"
            raise InputError(None, "columns", problem)
        names[quantity] = name
    for quantity, name in names.items():
        first = next(other for other in names if names[other] == name)
        if first != quantity:
            problem = f"column {name!r} is named for {first} and for {quantity}"
            raise InputError(None, "columns", problem)
    return names
