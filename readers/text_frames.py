"""Read frames of image correlation from text tables, in the following steps.

- header: `find_header` takes the row that names most quantities, at the best separator;
- units: `find_units` takes them from rows of words below the names;
- columns: `columns_by_quantity`, then `quantity_columns` and `flag_columns`, name the columns;
- summary rows: `drop_summary` cuts means and remarks off the end of the numbers;
- numbers: `read_numbers` reads them by pandas, else cell by cell so that errors name their line.

`find_layout` runs the first four, `read_text_rows` all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import (
    BELOW_POINTS,
    FLAGGED,
    PLACES,
    QUANTITIES,
    Array,
    Frame,
    FrameOptions,
    FrameRows,
    frame_of,
)
from .quantities import LENGTHS, MAX_COLUMNS, PIXELS, Heading, columns_by_quantity, heading_of
from .tables import (
    HOLES,
    LETTER_BUT_E,
    MAX_LINES_ABOVE,
    SEPARATORS,
    Cells,
    Lines,
    Row,
    TextTable,
    check_name,
    check_row,
    check_width,
    decimal_mark,
    has_statistic,
    is_hole,
    is_number,
    is_numeric,
    padded,
    read_lines,
    row_of,
    split_cells,
)
from .units import without_brackets

#: Largest number of rows of units and other words between the names and the numbers.
MAX_UNIT_ROWS = 3
#: Number of rows by which the decimal mark is detected.
MARK_ROWS = 500
#: Fewest rows of a frame, on average; with fewer, a column of numbers counts rows and not frames.
MIN_ROWS_PER_FRAME = 3
#: Flags in words, in small letters.
FLAG_WORDS = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "valid": 1.0, "invalid": 0.0}
#: Names of columns that say whether a row is good, but not in which way.
UNCLEAR_FLAGS = frozenset({"flag", "mask", "status", "quality", "state"})
_NO_VALUE = {*HOLES, *FLAG_WORDS}


@dataclass(frozen=True)
class TextLayout:
    """Layout of a file of points.

    Attributes
    ----------
    separator : str or None
        Separator of cells; None stands for blanks.
    headings : sequence of Heading
        Heading of each column.
    columns : mapping
        Indices of the columns that may hold each quantity.
    header : int
        Line of the names.
    body : list of (int, str)
        Lines of the numbers.
    decimal : str
        Decimal mark of the numbers.
    summary_count : int
        Number of rows below the points that are left out.
    """

    separator: str | None
    headings: Sequence[Heading]
    columns: Mapping[str, Sequence[int]]
    header: int
    body: Lines
    decimal: str
    summary_count: int = 0

    @property
    def names(self) -> Cells:
        """Return the names of the columns."""
        return [heading.name for heading in self.headings]

    def cells(self, text: str) -> Cells:
        """Return the cells of a line; none if a quotation mark is not closed."""
        return split_cells(text, self.separator) or []


def find_layout(
    path: Path,
    quantities: Sequence[str],
    named: Mapping[str, str],
    comment: str,
    decimal: str | None = None,
    upper_is_length: bool = False,
) -> TextLayout:
    """Find the layout of a file, by the user's names of some quantities; names may be a comment."""
    lines = read_lines(path, comment, any_encoding=True)
    header = find_header(lines, quantities, named, upper_is_length)
    if header is None and comment:
        # The names may be a comment, as numpy.savetxt writes them.
        lines_with_names = comments_above(path, comment, lines) + lines
        header = find_header(lines_with_names, quantities, named, upper_is_length)
        lines = lines if header is None else lines_with_names
    if header is None:
        raise InputError(path, "", describe_missing_header(lines))
    _, position, separator, names = header
    line = lines[position][0]
    units, unit_row_count = find_units(lines[position + 1 :], separator)
    rows_below = lines[position + 1 + unit_row_count :]
    body = drop_summary(rows_below, separator)
    if not body:
        problem = "expected a header line and rows of numbers, found only a header line"
        raise InputError(path, f"line {line}", problem)
    check_width(path, line, len(names), len(body), sum(len(text) for _, text in body))
    padded_units = units + [""] * len(names)
    headings = [heading_of(name, unit) for name, unit in zip(names, padded_units, strict=False)]
    columns = columns_by_quantity(headings, named, upper_is_length)
    if decimal is None:
        decimal = decimal_mark(path, number_cells(body, names, columns, separator))
    return TextLayout(
        separator,
        headings,
        columns,
        header=line,
        body=body,
        decimal=decimal,
        summary_count=len(rows_below) - len(body),
    )


# Header -----------------------------------------------------------------------------------------


class Header(NamedTuple):
    """A row that may be that of the names, and how well it fits."""

    score: tuple[int, bool, bool, bool, int]
    position: int
    separator: str | None
    names: Cells


def find_header(
    lines: Lines,
    quantities: Sequence[str],
    named: Mapping[str, str],
    upper_is_length: bool,
) -> Header | None:
    """Return the row of names with most quantities."""
    candidates = header_candidates(lines, quantities, named, upper_is_length)
    return max(candidates, key=lambda header: header.score, default=None)


def header_candidates(
    lines: Lines,
    quantities: Sequence[str],
    named: Mapping[str, str],
    upper_is_length: bool,
) -> Iterator[Header]:
    """Yield the rows that name two quantities or more, at each separator."""
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:MAX_LINES_ABOVE]):
            if not named and not LETTER_BUT_E.search(text):
                continue
            names = split_cells(text, separator)
            if names is None or not 2 <= len(names) <= MAX_COLUMNS or is_numeric(names):
                continue
            columns = columns_by_quantity(
                [heading_of(name) for name in names], named, upper_is_length
            )
            named_quantities = {key.split()[0] for key, indices in columns.items() if indices}
            count = len(named_quantities & {*quantities})
            if count < 2:
                continue
            rows = [row_of(*line, separator).cells for line in lines[index + 1 : index + 3]]
            rows = list(filter(is_numeric, rows))
            # A heading with a blank in it makes more names than there are numbers.
            fits = any(len(names) in (len(row), len(row) - (not row[-1])) for row in rows)
            score = count, bool(rows), fits, separator is not None, len(names)
            yield Header(score, index, separator, names)


def comments_above(path: Path, comment: str, lines: Lines) -> Lines:
    """Return the last two comments above the first line, without their marks."""
    first = lines[0][0] if lines else 0
    with_comments = read_lines(path, "", any_encoding=True)
    comments = [(number, text) for number, text in with_comments if number < first]
    return [(number, text.lstrip(comment).strip()) for number, text in comments[-2:]]


def describe_missing_header(lines: Lines) -> str:
    """Describe what a file without names has instead of them."""
    if len(lines) < 2:
        content = "only a header line" if lines else "nothing"
        return f"expected a header line and rows of numbers, found {content}"
    return (
        "no row of names with places and displacements (x, y, dx, dy, dz and the like) was found;"
        f" name them with columns. Line {lines[0][0]} is: {' '.join(lines[0][1].split())[:100]}"
    )


# Units, summary rows, decimal mark --------------------------------------------------------------


def find_units(rows_below: Lines, separator: str | None) -> tuple[Cells, int]:
    """Return the units in rows of words below the names, and the number of these rows."""
    units: Cells = []
    count = 0
    for line in rows_below[:MAX_UNIT_ROWS]:
        cells = [without_brackets(cell) for cell in row_of(*line, separator).cells]
        words = {cell.casefold() for cell in cells} - _NO_VALUE
        if not words or any(map(is_number, cells)):
            break
        if words & {*LENGTHS, *PIXELS}:
            units = cells + units
        count += 1
    return units, count if any(units) else 0


def drop_summary(rows: Lines, separator: str | None) -> Lines:
    """Return the rows without means and remarks at their end."""
    count = len(rows)
    while count > 1 and is_summary(rows[count - 1][1], rows[0][1], separator):
        count -= 1
    return rows[:count]


def is_summary(text: str, first_text: str, separator: str | None) -> bool:
    """Return whether a row has a label, "Mean", or begins with a word, unlike the first row."""
    cells = split_cells(text, separator) or [""]
    first = split_cells(first_text, separator) or [""]
    if has_statistic(cells) and not has_statistic(first):
        return True
    is_word = cells[0][:1].isalpha() and cells[0].casefold() not in _NO_VALUE
    return is_word and is_number(first[0])


def number_cells(
    body: Lines,
    names: Cells,
    columns: Mapping[str, Sequence[int]],
    separator: str | None,
) -> list[tuple[int, str, str]]:
    """Return line, column and text of cells that should be numbers, of the first rows."""
    indices = [i for key in columns if key not in ("valid", "invalid") for i in columns[key]]
    rows = [row_of(*line, separator) for line in body[:MARK_ROWS]]
    return [
        (row.line, names[index], row.cells[index])
        for row in rows
        for index in indices
        if index < len(row.cells)
    ]


# Columns ----------------------------------------------------------------------------------------


class Flag(NamedTuple):
    """A column that marks good rows: by `good_values`, or by any value but zero if that is None."""

    column: int
    good_values: Sequence[int] | None


def flag_columns(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    options: FrameOptions,
    status: tuple[str, Sequence[int]] | None,
) -> list[Flag]:
    """Return the flags that the user names, else those of `status` and the headings."""
    names = layout.names
    flags = []
    if options.flag_column is not None:
        flags.append(Flag(column_called(path, names, options.flag_column.strip(' "')), (0,)))
    if options.valid_column is not None:
        flags.append(Flag(column_called(path, names, options.valid_column.strip(' "')), None))
    if flags:
        return flags
    if status is not None and status[0] in names:
        return [Flag(names.index(status[0]), status[1])]
    by_heading: dict[str, tuple[int, ...] | None] = {"valid": None, "invalid": (0,)}
    return [Flag(columns[key], good) for key, good in by_heading.items() if key in columns]


def column_called(path: Path, names: Cells, name: str) -> int:
    """Return the column of a name, which must be there once."""
    check_name(path, names, name)
    return names.index(name)


def quantity_columns(
    path: Path,
    layout: TextLayout,
    named: Mapping[str, str],
    options: FrameOptions,
) -> dict[str, int]:
    """Return the column of each quantity and flag; `named` are the user's names of some."""
    columns = {
        key: single_column(path, layout, key, candidates, named)
        for key, candidates in layout.columns.items()
        if key not in ("frame", "id") or has_numbers(layout, key, options)
    }
    if options.quantities == PLACES and not {*QUANTITIES} & {*columns}:
        # Of a file of positions alone, those after the motion are meant.
        for axis in PLACES:
            if f"{axis} deformed" in columns:
                columns[axis] = columns.pop(f"{axis} deformed")
    check_complete(path, layout, columns, options)
    return columns


def check_complete(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    options: FrameOptions,
) -> None:
    """Check that the columns hold all that is needed, or from which it is computed."""
    is_planar = options.planar and not {"z", "dz", "z deformed"} & {*columns}
    for quantity in options.quantities:
        if quantity in columns or is_computed(quantity, columns):
            continue
        if not (is_planar and quantity[-1] == "z"):
            problem = f"this column is missing; the file has: {', '.join(layout.names)[:300]}"
            raise InputError(path, f"column {quantity!r}", problem)


def has_numbers(layout: TextLayout, key: str, options: FrameOptions) -> bool:
    """Return whether numbers of frames or points are clear, of use, and no names."""
    if key == "id" and options.quantities != PLACES:
        return False
    if len(layout.columns[key]) != 1:
        return False
    (column,) = layout.columns[key]
    cells = layout.cells(layout.body[0][1])
    return column < len(cells) and is_number(cells[column])


def is_computed(quantity: str, columns: Mapping[str, int]) -> bool:
    """Return whether a position or displacement follows from the other and the position after."""
    axis = quantity[-1]
    counterpart = axis if quantity == f"d{axis}" else f"d{axis}"
    return f"{axis} deformed" in columns and counterpart in columns


def single_column(
    path: Path,
    layout: TextLayout,
    key: str,
    candidates: Sequence[int],
    named: Mapping[str, str],
) -> int:
    """Return the column of a quantity; a column that comes twice with the same cells is one."""
    if len(candidates) == 1:
        return candidates[0]
    names = [layout.headings[i].name for i in candidates]
    is_repeated = len({*names}) == 1
    if is_repeated and have_same_cells(layout, candidates):
        return candidates[0]
    if is_repeated or key in named:
        return column_called(path, layout.names, named.get(key) or names[0])
    listed = " or ".join(map(repr, names[:6]))
    problem = f"the column of {key} may be {listed}; name one with columns"
    raise InputError(path, f"line {layout.header}", problem)


def have_same_cells(layout: TextLayout, columns: Sequence[int]) -> bool:
    """Return whether columns have the same cells in every row."""
    rows = (layout.cells(text) for _, text in layout.body)
    return all(len({tuple(row[i : i + 1]) for i in columns}) == 1 for row in rows)


# Numbers ----------------------------------------------------------------------------------------

#: Numbers (good rows,) by quantity, and the mask (rows,) of good rows.
Numbers = tuple[dict[str, Array], NDArray[np.bool_]]


def read_numbers(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    flags: Sequence[Flag],
) -> Numbers:
    """Return the numbers of all rows that pass the flags, and the mask of these rows."""
    return _read_fast(layout, columns, flags) or _read_cells(path, layout, columns, flags)


def _read_fast(
    layout: TextLayout, columns: Mapping[str, int], flags: Sequence[Flag]
) -> Numbers | None:
    """Read all rows at once; None where they have to be read cell by cell."""
    texts = [text for _, text in layout.body]
    if not _is_regular(texts, layout.separator, len(layout.headings)):
        return None
    flag_indices = [flag for flag, _ in flags]
    indices = sorted({*columns.values(), *flag_indices})
    table = _parse_fast(texts, layout, indices)
    if table is None:
        return None
    values_of = dict(zip(indices, table.T, strict=True))
    if any(np.isnan(values_of[i]).any() for i in flag_indices):
        return None
    good = _pass_flags(((values_of[i], values) for i, values in flags), len(table))
    return {key: values_of[i][good] for key, i in columns.items()}, good


def _is_regular(texts: Sequence[str], separator: str | None, width: int) -> bool:
    """Return whether all rows have a cell a name, perhaps with one more separator at the end.

    numpy takes what it needs of a row that is too long, so that a cell with a decimal comma would
    shift the others.
    """
    if separator is None:
        return {len(text.split()) for text in texts} == {width}
    if any('"' in text for text in texts):
        return False
    counts = {text.count(separator) for text in texts}
    if counts == {width}:
        return all(text.rstrip().endswith(separator) for text in texts)
    return counts <= {width - 1}


def _parse_fast(texts: list[str], layout: TextLayout, indices: list[int]) -> Array | None:
    """Return finite numbers (rows, columns), NaN for holes; None if a cell is neither."""
    if layout.decimal == ",":
        if layout.separator == "," or any("." in text for text in texts):
            return None
        texts = [text.replace(",", ".") for text in texts]
    for converters in (None, _number_or_nan):  # the first is the faster, and knows no holes
        with suppress(ValueError):
            table = np.loadtxt(
                texts,
                comments=None,
                delimiter=layout.separator,
                converters=converters,
                usecols=indices,
                ndmin=2,
            )
            return table if len(table) == len(texts) and not np.isinf(table).any() else None
    return None


def _number_or_nan(cell: str) -> float:
    """Return the number in a cell, NaN for a hole; ValueError if it is neither."""
    cell = cell.strip()
    if is_hole(cell):
        return math.nan
    if not is_number(cell):
        raise ValueError(cell)
    return float(cell)


def _pass_flags(
    flags: Iterable[tuple[Array, Sequence[int] | None]], count: int
) -> NDArray[np.bool_]:
    """Return the mask of rows whose flags are among the good values; None: all but zero."""
    good = np.ones(count, dtype=bool)
    for flag, good_values in flags:
        good &= flag != 0 if good_values is None else np.isin(flag, good_values)
    return good


def _read_cells(
    path: Path,
    layout: TextLayout,
    columns: Mapping[str, int],
    flags: Sequence[Flag],
) -> Numbers:
    """Read cell by cell, flags first: a doubtful row may hold anything."""
    table = _CellTable(path, layout)
    flag_values = ((table.flag(index), good_values) for index, good_values in flags)
    good = _pass_flags(flag_values, len(layout.body))
    return {key: table.numbers(index, good, holes=True) for key, index in columns.items()}, good


class _CellTable:
    """Cells of the body, by position: names may appear twice where they are not used."""

    def __init__(self, path: Path, layout: TextLayout) -> None:
        self.path = path
        self.layout = layout
        width = len(layout.headings)
        rows = []
        for number, text in layout.body:
            cells = split_cells(text, layout.separator)
            if cells is None:
                problem = "a quotation mark that is opened and not closed"
                raise InputError(path, f"line {number}", problem)
            check_row(path, Row(number, cells), width, layout.separator, "the header")
            rows.append(padded(cells, width))
        self.rows = rows
        self.lines = np.array([number for number, _ in layout.body])

    def numbers(self, index: int, mask: NDArray[np.bool_], holes: bool) -> Array:
        """Return the numbers of a column in some rows.

        Parameters
        ----------
        index : int
            Place of the column.
        mask : (rows,) array of bool
            The rows that are read.
        holes : bool
            Whether cells may be empty, which gives NaN.
        """
        name = self.layout.headings[index].name
        column = [self.rows[row][index : index + 1] for row in np.flatnonzero(mask)]
        table = TextTable(self.path, [name], column, self.lines[mask], self.layout.decimal)
        return table.numbers(name, holes)

    def flag(self, index: int) -> Array:
        """Return the flags in a column, words or numbers."""
        words = (row[index].casefold() for row in self.rows)
        values = np.array([FLAG_WORDS.get(word, np.nan) for word in words], dtype=float)
        if not np.isnan(values).any():
            return values
        return self.numbers(index, np.ones(len(self.lines), dtype=bool), holes=False)


# Frames -----------------------------------------------------------------------------------------


def read_text(
    path: Path,
    options: FrameOptions,
    format: str,
    **settings: Any,
) -> list[Frame]:
    """Read the frames of a text file by a format's name and its settings of `read_text_rows`."""
    rows_of_frames = read_text_rows(path, options, **settings)
    return [frame_of(rows, options, path, format) for rows in rows_of_frames]


def read_text_rows(
    path: Path,
    options: FrameOptions,
    *,
    comment: str | None = None,
    upper_is_length: bool = False,
    camera_axes: bool = False,
    names: Mapping[str, str] | None = None,
    status: tuple[str, Sequence[int]] | None = None,
) -> list[FrameRows]:
    """Read the rows of the frames in a text file: one, or as many as a column numbers.

    Parameters
    ----------
    path : Path
    options : FrameOptions
        Quantities that are needed, and what the user says of the file.
    comment : str, optional
        What comments begin with, in place of that of the options.
    upper_is_length : bool
        Whether of two names that differ in case the large one is a length.
    camera_axes : bool
        Whether y points down and z away from the camera.
    names : mapping, optional
        The format's names of quantities; those of the user come first.
    status : (str, sequence of int), optional
        A column of states, and the values of good rows.

    Returns
    -------
    list of FrameRows

    Raises
    ------
    InputError
        There is no table of points, or it may be read in two ways.
    """
    user_names = {key: name.strip(' "') for key, name in (options.columns or {}).items()}
    named = {**(names or {}), **user_names}
    mark = options.comment if comment is None else comment
    layout = find_layout(
        path,
        options.quantities,
        named,
        mark,
        options.decimal,
        upper_is_length,
    )
    columns = quantity_columns(path, layout, named, options)
    flags = flag_columns(path, layout, columns, options, status)
    columns = {key: index for key, index in columns.items() if key not in ("valid", "invalid")}
    values, good = read_numbers(path, layout, columns, flags)
    sigma, ids, frame_numbers = (values.pop(key, None) for key in ("sigma", "id", "frame"))
    headings = {key: layout.headings[columns[key]] for key in values}
    rows = FrameRows(
        values,
        names={key: heading.name for key, heading in headings.items()},
        units={key: heading.unit for key, heading in headings.items() if heading.unit},
        sigma=sigma,
        camera_axes=camera_axes,
        dropped={FLAGGED: int((~good).sum()), BELOW_POINTS: layout.summary_count},
        notes=unused_flags(layout, options),
        ids=ids,
        row_numbers=np.flatnonzero(good),
    )
    return [rows] if frame_numbers is None else split_frames(rows, frame_numbers)


def unused_flags(layout: TextLayout, options: FrameOptions) -> tuple[str, ...]:
    """Return a note on each column that may be a flag and is not used."""
    return tuple(
        f"column {name!r} is not used; flag_column or valid_column says what it means"
        for name in layout.names
        if name.casefold() in UNCLEAR_FLAGS
        and name not in (options.flag_column, options.valid_column)
    )


def split_frames(rows: FrameRows, frame_numbers: Array) -> list[FrameRows]:
    """Return the rows of each frame; all together where rows, not frames, are numbered.

    Parameters
    ----------
    frame_numbers : (rows,) array
        Number of the frame that each row is of.
    """
    numbers = np.unique(frame_numbers)
    row_count = len(frame_numbers)
    if not 1 < len(numbers) <= row_count / MIN_ROWS_PER_FRAME or np.isnan(numbers).any():
        return [rows]
    frames = []
    for number in numbers:
        in_frame = frame_numbers == number
        frames.append(
            replace(
                rows,
                values={key: value[in_frame] for key, value in rows.values.items()},
                sigma=None if rows.sigma is None else rows.sigma[in_frame],
                number=float(number),
                ids=None if rows.ids is None else rows.ids[in_frame],
                dropped=rows.dropped if number == numbers[0] else {},
                row_numbers=None,
            )
        )
    return frames
