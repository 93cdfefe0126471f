"""Points of a frame from text: columns by pandas, else cell by cell so that errors name lines."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import pandas as pd
from . import frames, tables

Array = NDArray[np.float64]
#: Line number from 1 and text.
Lines = list[tuple[int, str]]
#: None is any number of blanks.
SEPARATORS = ("\t", ";", ",", None)
#: The row of names stands within so many lines; rows looked at for the decimal mark.
TOP, SAMPLE = 300, 500
#: Rows of units and other words between the names and the numbers.
MOST_BELOW = 3


@dataclass(frozen=True)
class TextLayout:
    """Layout of a file; separator None: blanks; header: line of names; below: rows left out."""

    separator: str | None
    headings: Sequence[frames.Heading]
    columns: Mapping[str, Sequence[int]]
    header: int
    body: Lines
    decimal: str
    below: int = 0


_INCH = re.compile(r'[\[(]"[\])]')


def cells_of(text: str, separator: str | None) -> list[str] | None:
    """Return the cells of one line; None where a quotation mark is not closed on it."""
    if separator is None and '"' not in text:
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    text = _INCH.sub("[in]", text)
    if text.count('"') % 2:
        return None
    try:
        row = next(csv.reader([text.strip()], delimiter=separator or " ", skipinitialspace=True))
    except csv.Error:
        return None
    return [cell.strip(' "') for cell in row if cell or separator is not None]


def find_layout(
    path: Path,
    quantities: Sequence[str],
    named: Mapping[str, str],
    comment: str,
    decimal: str | None = None,
    upper: bool = False,
) -> TextLayout:
    """Find the layout of a file, by its own names of some quantities; names may be a comment."""
    lines = tables.read_lines(path, comment, any_encoding=True)
    found = _best_header(lines, quantities, named, upper)
    if found is None and comment:
        # The names may be a comment, as numpy.savetxt writes them.
        above = [
            (n, t.lstrip(comment).strip())
            for n, t in tables.read_lines(path, "", any_encoding=True)
        ]
        first = lines[0][0] if lines else 0
        heads = [one for one in above if one[0] < first][-2:]
        found = _best_header(heads + lines, quantities, named, upper)
        lines = heads + lines if found is not None else lines
    if found is None:
        raise InputError(path, "", _nothing_found(lines))
    index, separator, names = found
    header = lines[index][0]
    body = lines[index + 1 :]
    units = [""] * len(names)
    # A row of units, some of them lengths, among rows below the names that have no number.
    for k, (_, text) in enumerate(body[:MOST_BELOW]):
        plain = [cell.strip("()[]<>{} ") for cell in cells_of(text, separator) or []]
        words = {cell.casefold() for cell in plain} - {*tables.HOLES, *WORDS}
        if not words or any(map(tables.is_number, plain)):
            body = body[k:] if any(units) else body
            break
        if {*frames.LENGTHS, *frames.PIXELS} & words:
            units = plain + units
    else:
        body = body[MOST_BELOW:] if any(units) else body
    headings = [frames.heading_of(name, unit) for name, unit in zip(names, units, strict=False)]
    columns = frames.columns_of(headings, named, upper)
    total = len(body)
    while len(body) > 1 and _is_summary(body[-1][1], body[0][1], separator):
        body = body[:-1]
    if not body:
        problem = "expected a header line and rows of numbers, found only a header line"
        raise InputError(path, f"line {header}", problem)
    tables.check_width(path, header, len(names), len(body), sum(len(text) for _, text in body))
    wanted = [i for key, where in columns.items() if key not in ("valid", "invalid") for i in where]
    sample = [(number, cells_of(text, separator) or []) for number, text in body[:SAMPLE]]
    cells = [(number, names[i], row[i]) for number, row in sample for i in wanted if i < len(row)]
    mark = decimal or tables.decimal_mark(path, cells)
    return TextLayout(separator, headings, columns, header, body, mark, total - len(body))


def _is_summary(text: str, first: str, separator: str | None) -> bool:
    """Return whether a row has a label, "Mean", or begins with a word, unlike the `first`."""
    row, before = (cells_of(one, separator) or [""] for one in (text, first))
    if tables.has_statistic(row) and not tables.has_statistic(before):
        return True
    known = row[0].casefold() in {*tables.HOLES, *WORDS}
    return row[0][:1].isalpha() and not known and tables.is_number(before[0])


def _best_header(
    lines: Lines, quantities: Sequence[str], named: Mapping[str, str], upper: bool
) -> tuple[int, str | None, list[str]] | None:
    """Return the row of names with most quantities: index, separator, names."""
    best: tuple[tuple[int, bool, bool, bool, int], int, str | None, list[str]] | None = None
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:TOP]):
            names = cells_of(text, separator)
            if names is None or not 2 <= len(names) <= tables.MOST_NAMES or _is_numbers(names):
                continue
            columns = frames.columns_of([frames.heading_of(name) for name in names], named, upper)
            known = {key.split()[0] for key, where in columns.items() if where}
            hits = len(known & {*quantities})
            rows = [cells_of(text, separator) for _, text in lines[index + 1 : index + 3]]
            numbers = [row for row in rows if row is not None and _is_numbers(row)]
            # A heading with a blank in it makes more names than there are numbers.
            fits = any(len(names) in (len(row), len(row) - (not row[-1])) for row in numbers)
            score = (hits, bool(numbers), fits, separator is not None, len(names))
            if hits >= 2 and (best is None or score > best[0]):
                best = score, index, separator, names
    return None if best is None else best[1:]


def _is_numbers(row: Sequence[str]) -> bool:
    """Return whether half of the cells or more are numbers."""
    return 2 * sum(tables.is_number(cell) for cell in row) >= max(len(row), 1)


def _nothing_found(lines: Lines) -> str:
    if len(lines) < 2:
        found = "only a header line" if lines else "nothing"
        return f"expected a header line and rows of numbers, found {found}"
    return (
        "no row of names with places and displacements (x, y, dx, dy, dz and the like) was found;"
        f" name them with columns. Line {lines[0][0]} is: {' '.join(lines[0][1].split())[:100]}"
    )


#: Which column is a flag, and which of its values are those of good rows; None: all but zero.
Flag = tuple[int, Sequence[int] | None]


def flag_columns(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    options: frames.FrameOptions,
    status: tuple[str, Sequence[int]] | None,
) -> list[Flag]:
    """Return the flags that are named, else those of `status` and the headings."""
    names = [heading.name for heading in layout.headings]
    asked: list[tuple[str | None, Sequence[int] | None]]
    asked = [(options.flag_column, (0,)), (options.valid_column, None)]
    found = [
        (_named(path, names, name.strip(' "')), good) for name, good in asked if name is not None
    ]
    if found:
        return found
    if status is not None and status[0] in names:
        return [(names.index(status[0]), status[1])]
    shown: list[tuple[str, Sequence[int] | None]] = [("valid", None), ("invalid", (0,))]
    return [(columns[key], good) for key, good in shown if key in columns]


def _one(
    path: Path, layout: TextLayout, key: str, where: Sequence[int], named: Mapping[str, str]
) -> int:
    """Return the one column of a quantity."""
    if len(where) == 1:
        return where[0]
    names = [heading.name for heading in layout.headings]
    may = [names[i] for i in where]
    if len({*may}) == 1:
        cells = (cells_of(text, layout.separator) or [] for _, text in layout.body)
        # A column that comes twice with the same cells is one.
        if all(len({tuple(row[i : i + 1]) for i in where}) == 1 for row in cells):
            return where[0]
    if key in named or len({*may}) == 1:
        return _named(path, names, named.get(key) or may[0])
    several = " or ".join(repr(name) for name in may[:6])
    problem = f"the column of {key} may be {several}; name one with columns"
    raise InputError(path, f"line {layout.header}", problem)


def _named(path: Path, names: Sequence[str], name: str) -> int:
    tables.check_one(path, names, name)
    return names.index(name)


def quantity_columns(
    path: Path, layout: TextLayout, named: Mapping[str, str], options: frames.FrameOptions
) -> dict[str, int]:
    """Return the one column of each quantity and flag; `named` gives the file's own names."""
    # Numbers of frames and points help where they are there, clear, and of use.
    unclear = {key for key in ("frame", "id") if not _numbers(layout, key)}
    unclear |= {"id"} if options.quantities != frames.PLACES else set()
    found = {key: where for key, where in layout.columns.items() if key not in unclear}
    columns = {key: _one(path, layout, key, where, named) for key, where in found.items()}
    if options.quantities == frames.PLACES and not {*frames.QUANTITIES} & {*columns}:
        columns |= {
            q: columns.pop(f"{q} deformed") for q in frames.PLACES if f"{q} deformed" in columns
        }
    planar = options.planar and not {"z", "dz", "z deformed"} & {*columns}
    for quantity in options.quantities:
        axis = quantity[-1]
        both = {axis, f"d{axis}"} - {quantity}
        computed = f"{axis} deformed" in columns and both <= {*columns}
        if quantity not in columns and not computed and not (planar and axis == "z"):
            there = ", ".join(heading.name for heading in layout.headings)[:300]
            problem = f"this column is missing; the file has: {there}"
            raise InputError(path, f"column {quantity!r}", problem)
    return columns


def _numbers(layout: TextLayout, key: str) -> bool:
    """Return whether one column is of this kind, and begins with a number, no name."""
    where = layout.columns.get(key, ())
    row = cells_of(layout.body[0][1], layout.separator) or []
    return len(where) == 1 and where[0] < len(row) and tables.is_number(row[where[0]])


#: Flags in words, in small letters.
WORDS = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "valid": 1.0, "invalid": 0.0}


def read_numbers(
    path: Path, layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Return the numbers (good rows,) by quantity, and the mask (rows,) of rows that flags pass."""
    return _quick(layout, columns, flags) or _slow(path, layout, columns, flags)


def _quick(
    layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]] | None:
    """Read all rows by pandas; None where they have to be read one by one."""
    separator = layout.separator
    width = len(layout.headings)
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
    holes = [
        word for hole in tables.HOLES for word in {hole, hole.upper(), hole.replace("nan", "NaN")}
    ]
    try:
        table = pd.read_csv(
            StringIO("\n".join(texts)),
            header=None,
            sep=separator or r"\s+",
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
    good = _passed(((table[i].to_numpy(), values) for i, values in flags), len(table))
    return {key: table[i].to_numpy(dtype=float)[good] for key, i in columns.items()}, good


def _passed(flags: Iterable[tuple[Array, Sequence[int] | None]], count: int) -> NDArray[np.bool_]:
    """Return the mask of rows whose flags are among the good values; None: all but zero."""
    good = np.ones(count, dtype=bool)
    for flag, values in flags:
        good &= (flag != 0) if values is None else np.isin(flag, values)
    return good


def _slow(
    path: Path, layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Read row by row, flags first: a doubtful row may hold anything."""
    width = len(layout.headings)
    rows = []
    for number, text in layout.body:
        row = cells_of(text, layout.separator)
        if row is None:
            problem = "a quotation mark that is opened and not closed"
            raise InputError(path, f"line {number}", problem)
        # Blanks leave no empty cells: a short row has lost its place.
        tables.check_row(path, number, row, width, layout.separator, "the header", short=True)
        rows.append((row + [""] * width)[:width])
    lines = np.array([number for number, _ in layout.body])
    # By position: names may appear twice where they are not asked for.
    cells = pd.DataFrame(rows, dtype=str)

    def table(i: int, keep: NDArray[np.bool_]) -> tuple[tables.TextTable, str]:
        name = layout.headings[i].name
        one = cells[[i]][keep].set_axis([name], axis=1)
        return tables.TextTable(path, one, lines[keep], layout.decimal), name

    def flag_of(i: int) -> Array:
        flag = np.asarray(cells[i].str.casefold().map(WORDS), dtype=float)
        one, name = table(i, np.ones(len(rows), dtype=bool))
        return one.numbers(name) if np.isnan(flag).any() else flag

    good = _passed(((flag_of(i), values) for i, values in flags), len(rows))
    kept = {key: table(i, good) for key, i in columns.items()}
    return {key: one.numbers(name, holes=True) for key, (one, name) in kept.items()}, good


#: Rows that a numbered frame has at least; fewer number the rows.
LEAST_ROWS = 3
#: Names of columns that say whether a row is good, but not in which way.
UNCLEAR = frozenset({"flag", "mask", "status", "quality", "state"})


def read_text(
    path: Path, options: frames.FrameOptions, format: str, **settings: Any
) -> list[frames.Frame]:
    """Read the frames of a text file; format : its name. settings : of `read_text_rows`."""
    every = read_text_rows(path, options, **settings)
    return [frames.frame_of(rows, options, path, format) for rows in every]


def read_text_rows(
    path: Path,
    options: frames.FrameOptions,
    *,
    comment: str | None = None,
    upper: bool = False,
    camera_axes: bool = False,
    names: Mapping[str, str] | None = None,
    status: tuple[str, Sequence[int]] | None = None,
) -> list[frames.FrameRows]:
    """Read the rows of the frames in a text file: one, or as many as a column numbers.

    names : the format's names, after the user's. status : a column of states, its good values.
    """
    own = {key: name.strip(' "') for key, name in (options.columns or {}).items()}
    named = {**(names or {}), **own}
    mark = options.comment if comment is None else comment
    layout = find_layout(path, options.quantities, named, mark, options.decimal, upper)
    columns = quantity_columns(path, layout, named, options)
    flags = flag_columns(path, layout, columns, options, status)
    numbers = {key: i for key, i in columns.items() if key not in ("valid", "invalid")}
    values, good = read_numbers(path, layout, numbers, flags)
    sigma, ids, frame = (values.pop(key, None) for key in ("sigma", "id", "frame"))
    headings = {key: layout.headings[i] for key, i in numbers.items() if key in values}
    notes = tuple(
        f"column {heading.name!r} is not used; flag_column or valid_column says what it means"
        for heading in layout.headings
        if heading.name.casefold() in UNCLEAR
        and heading.name not in (options.flag_column, options.valid_column)
    )
    named = {key: heading.name for key, heading in headings.items()}
    units = {key: heading.unit for key, heading in headings.items() if heading.unit}
    lost = {frames.FLAGGED: int((~good).sum()), frames.BELOW: layout.below}
    whole = frames.FrameRows(values, named, units, None, sigma, camera_axes, lost, notes, ids)
    if frame is None:
        return [whole]
    every = np.unique(frame)
    if len(every) < 2 or LEAST_ROWS * len(every) > len(frame) or np.isnan(every).any():
        return [whole]
    return [
        replace(
            whole,
            values={key: value[frame == number] for key, value in values.items()},
            sigma=None if sigma is None else sigma[frame == number],
            number=float(number),
            ids=None if ids is None else ids[frame == number],
            dropped=lost if number == every[0] else {},
        )
        for number in every
    ]
