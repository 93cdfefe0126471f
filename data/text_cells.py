"""The numbers of a table in a text file, at the speed of pandas' reader where it can.

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
from .tables import HOLES, TextTable
from .text_columns import Flag
from .text_layouts import TextLayout, cells_of

Array = NDArray[np.float64]
#: Flags in words, in small letters.
WORDS = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "valid": 1.0, "invalid": 0.0}


def read_numbers(
    path: Path, layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """The numbers (good rows,) of each quantity, and which rows (rows,) the flags call good.

    Raises
    ------
    InputError : naming line and column.
    """
    return _quick(layout, columns, flags) or _slow(path, layout, columns, flags)


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
