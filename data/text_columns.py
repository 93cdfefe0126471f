"""Which column of a table of points holds what: its quantities, and its flags of doubtful rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import InputError
from .frames import FrameOptions
from .text_layouts import TextLayout

#: Which column is a flag, and which of its values are those of good rows; None: all but zero.
Flag = tuple[int, Sequence[int] | None]


def quantity_columns(
    path: Path, layout: TextLayout, named: Mapping[str, str], options: FrameOptions
) -> dict[str, int]:
    """The one column of each quantity and flag that the headings tell; `named` : the file's own.

    Raises
    ------
    InputError : a quantity that was asked for is missing, or may be in several columns.
    """
    columns = {key: _one(path, layout, key, where, named) for key, where in layout.columns.items()}
    _check_there(path, layout, columns, options)
    return columns


def flag_columns(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    options: FrameOptions,
    status: tuple[str, Sequence[int]] | None,
) -> list[Flag]:
    """The flags that are named; those the headings tell only where none is.

    status : a column of states, and the values of good rows.

    Raises
    ------
    InputError : a column that is named is missing, or there are two of the name.
    """
    names = [heading.name for heading in layout.headings]
    asked = [(options.flag_column, (0,)), (options.valid_column, None)]
    found: list[Flag] = []
    for name, good in asked:
        if name is not None:
            found.append((_named(path, names, name.strip(' "')), good))
    if found:
        return found
    if status is not None and status[0] in names:
        return [(names.index(status[0]), status[1])]
    found += [(columns["valid"], None)] if "valid" in columns else []
    return found + ([(columns["invalid"], (0,))] if "invalid" in columns else [])


def _one(
    path: Path, layout: TextLayout, key: str, where: Sequence[int], named: Mapping[str, str]
) -> int:
    """The one column of a quantity."""
    if len(where) == 1:
        return where[0]
    names = [heading.name for heading in layout.headings]
    if key in named:
        return _named(path, names, named[key])
    may = [names[i] for i in where]
    if len({*may}) == 1:
        return _named(path, names, may[0])
    several = " or ".join(repr(name) for name in may[:6])
    problem = f"the column of {key} may be {several}; name one with columns"
    raise InputError(path, f"line {layout.header}", problem)


def _named(path: Path, names: Sequence[str], name: str) -> int:
    if names.count(name) == 1:
        return names.index(name)
    what = "appears twice" if name in names else "is missing"
    problem = f"this column {what}; the file has: {', '.join(names)[:300]}"
    raise InputError(path, f"column {name!r}", problem)


def _check_there(
    path: Path, layout: TextLayout, columns: Mapping[str, int], options: FrameOptions
) -> None:
    """Every quantity asked for is there, or can be had of the places before and after."""
    spare = {"z", "dz"} if options.planar else set()
    for quantity in options.quantities:
        axis = quantity[-1]
        both = {axis, f"d{axis}"} - {quantity}
        if quantity in columns or (f"{axis} deformed" in columns and both <= {*columns}):
            continue
        if quantity in spare and not {"z", "dz", "z deformed"} & {*columns}:
            continue
        there = ", ".join(heading.name for heading in layout.headings)[:300]
        problem = f"this column is missing; the file has: {there}"
        raise InputError(path, f"column {quantity!r}", problem)
