"""The points of a frame from a table in a text file, at the speed of pandas' reader where it can.

The quick way takes whole columns as numbers; whatever does not fit it (a comment amidst the rows, a
cell that is no number, a row with a cell too many) is read again cell by cell, so that a complaint
names its line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frame_headings import Heading
from .frame_rows import FrameRows
from .frames import FLAGGED, FrameOptions
from .tables import HOLES, TextTable
from .text_layouts import TextLayout, cells_of, find_layout

Array = NDArray[np.float64]
#: Flags in words, in small letters.
WORDS = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "valid": 1.0, "invalid": 0.0}
#: Names of columns that say whether a row is good, but not in which way.
UNCLEAR = frozenset({"flag", "mask", "status", "quality", "state"})


def read_text_rows(
    path: Path,
    options: FrameOptions,
    *,
    comment: str | None = None,
    upper: bool = False,
    camera_axes: bool = False,
    names: Mapping[str, str] | None = None,
    status: tuple[str, Sequence[int]] | None = None,
) -> FrameRows:
    """The rows of the one frame in a text file.

    Parameters
    ----------
    comment : that of the format, where it has one of its own.
    upper : of two names that differ only in their letters' size, the large one is the length.
    names : what the format calls some quantities; the user's own come first.
    status : a column of states, and the values of good rows.

    Raises
    ------
    InputError : naming file, line and column: no such file, missing columns, cells that are not
        numbers.
    """
    own = {key: name.strip(' "') for key, name in (options.columns or {}).items()}
    named = {**(names or {}), **own}
    mark = options.comment if comment is None else comment
    wanted = [*options.quantities]
    layout = find_layout(path, wanted, named, mark, options.decimal, upper)
    columns = {key: _one(path, layout, key, where, named) for key, where in layout.columns.items()}
    _check_there(path, layout, columns, options)
    flags = _flags(path, layout, columns, options, status)
    numbers = {key: i for key, i in columns.items() if key not in ("valid", "invalid")}
    values, good = _quick(layout, numbers, flags) or _slow(path, layout, numbers, flags)
    sigma = values.pop("sigma", None)
    headings = {key: layout.headings[i] for key, i in numbers.items() if key != "sigma"}
    unclear = [h.name for h in layout.headings if h.name.casefold() in UNCLEAR]
    notes = [
        f"column {name!r} is not used; flag_column or valid_column says what it means"
        for name in unclear
        if name not in (options.flag_column, options.valid_column)
    ]
    return FrameRows(
        values,
        {key: heading.name for key, heading in headings.items()},
        {key: heading.unit for key, heading in headings.items() if heading.unit},
        sigma=sigma,
        camera_axes=camera_axes,
        dropped={FLAGGED: int((~good).sum())},
        notes=tuple(notes),
    )


#: Which column is a flag, and which of its values are those of good rows; None: all but zero.
Flag = tuple[int, Sequence[int] | None]


def _flags(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    options: FrameOptions,
    status: tuple[str, Sequence[int]] | None,
) -> list[Flag]:
    """The flags that are named; those the headings tell only where none is."""
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


def _quick(
    layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]] | None:
    """All rows by pandas' reader; None where they have to be looked at one by one."""
    import pandas as pd

    separator, width = layout.separator, len(layout.headings)
    texts = [text for _, text in layout.body]
    if separator is None and {len(text.split()) for text in texts} != {width}:
        return None
    if separator is not None:
        # pandas takes what it needs of a row that is too long, so that a cell with a decimal
        # comma would shift the rest.
        counts = {text.count(separator) for text in texts}
        if not (counts <= {width - 1} or counts <= {width}) or any('"' in text for text in texts):
            return None
        if counts == {width} and any(not text.rstrip().endswith(separator) for text in texts):
            return None
    wanted = sorted({*columns.values(), *(i for i, _ in flags)})
    holes = [word for hole in HOLES for word in {hole, hole.upper(), hole.replace("nan", "NaN")}]
    try:
        table = pd.read_csv(
            StringIO("\n".join(texts)),
            header=None,
            sep=r"\s+" if separator is None else separator,
            decimal=layout.decimal,
            usecols=None if separator is None else wanted,
            dtype=dict.fromkeys(wanted, float),
            na_values=holes,
            keep_default_na=False,
            skipinitialspace=True,
        )
    except (ValueError, OverflowError, KeyError):
        return None
    if len(table) != len(texts) or (separator is None and table.shape[1] != width):
        return None
    if np.isinf(table[wanted].to_numpy()).any() or any(table[i].isna().any() for i, _ in flags):
        return None
    good = np.ones(len(table), dtype=bool)
    for i, values in flags:
        flag = table[i].to_numpy()
        good &= (flag != 0) if values is None else np.isin(flag, values)
    return {key: table[i].to_numpy(dtype=float)[good] for key, i in columns.items()}, good


def _slow(
    path: Path, layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Row by row; flags first: a doubtful row may hold anything.

    Raises
    ------
    InputError : naming line and column.
    """
    import pandas as pd

    width, rows = len(layout.headings), []
    for number, text in layout.body:
        row = cells_of(text, layout.separator)
        if row is None:
            problem = "a quotation mark that is opened and not closed"
            raise InputError(path, f"line {number}", problem)
        # Blanks leave no empty cells: a short row has lost its place.
        if any(row[width:]) or (layout.separator is None and len(row) < width):
            problem = f"expected {width} cells as in the header, found {len(row)}"
            if layout.separator == ",":
                problem += "; decimal commas need another separator, or quotation marks"
            raise InputError(path, f"line {number}", problem)
        rows.append((row + [""] * width)[:width])
    names = [heading.name for heading in layout.headings]
    lines = np.array([number for number, _ in layout.body])
    # By position: names may appear twice where nobody asks for them.
    cells = pd.DataFrame(rows, dtype=str)
    good = np.ones(len(rows), dtype=bool)
    for i, values in flags:
        flag = cells[i].str.casefold().map(WORDS).to_numpy(dtype=float)
        if np.isnan(flag).any():
            one = TextTable(path, cells[[i]].set_axis([names[i]], axis=1), lines, layout.decimal)
            flag = one.numbers(names[i])
        good &= (flag != 0) if values is None else np.isin(flag, values)
    read = {}
    for key, i in columns.items():
        kept = cells[[i]][good].set_axis([names[i]], axis=1)
        read[key] = TextTable(path, kept, lines[good], layout.decimal).numbers(names[i], holes=True)
    return read, good


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
    names: list[Heading] = list(layout.headings)
    spare = {"z", "dz"} if options.planar else set()
    for quantity in options.quantities:
        axis = quantity[-1]
        both = {axis, f"d{axis}"} - {quantity}
        if quantity in columns or (f"{axis} deformed" in columns and both <= {*columns}):
            continue
        if quantity in spare and not {"z", "dz", "z deformed"} & {*columns}:
            continue
        there = ", ".join(heading.name for heading in names)[:300]
        problem = f"this column is missing; the file has: {there}"
        raise InputError(path, f"column {quantity!r}", problem)
