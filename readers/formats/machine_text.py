"""A test machine's export as text: header row, unit row, separator and decimal mark are found.

As MTS TestSuite and TestWorks, Instron Bluehill and ZwickRoell testXpert write it: lines about the
test, a row of names, mostly one of units, numbers. A table of results may stand above the readings,
and specimens one block after the other: of several tables the one with most rows is read, and all
blocks with the same names.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...files import pandas as pd
from .. import tables
from ..machine_tables import MachineTable, TableOptions
from ..registry import Format, register_format
from ..text_frames import SEPARATORS, cells_of

#: Line number from 1 and cells.
Rows = list[tuple[int, list[str]]]
UNITS = {*tables.LENGTH_UNITS, *tables.LOAD_UNITS, *tables.TIME_UNITS, *tables.OTHER_NAMES}
#: Rows between the names and the first numbers: units, and sometimes channels or types.
BETWEEN = 2
_LETTERS = re.compile(r"[^\W\d_]")
_LETTER = re.compile(r"[^\W\d_eE]")


def find_header(rows: Rows, named: Mapping[str, str], quantities: Sequence[str]) -> int | None:
    """Return the first row of names with numbers below it, else the first row of names."""
    first = None
    for index, (_, row) in enumerate(rows):
        if _is_header(rows, index, named, quantities):
            return index
        if first is None and _names_all(row, named, quantities):
            first = index
    return first


def _names_all(
    names: list[str], named: Mapping[str, str], quantities: Sequence[str]
) -> list[list[int]]:
    """Return the columns of each quantity; none where one has no column of its own."""
    if len(names) > tables.MOST_NAMES:
        return []
    columns = [tables.columns_of(names, quantity, named) for quantity in quantities]
    # A sentence that speaks of load and extension is one cell, and no header.
    several = all(columns) and len(set().union(*columns)) >= len(quantities)
    return columns if several else []


def _is_header(rows: Rows, index: int, named: Mapping[str, str], quantities: Sequence[str]) -> bool:
    """Return whether a row has the names, and numbers in one of the rows below."""
    # Most rows are numbers, and quickly passed over.
    if not _LETTER.search("".join(rows[index][1])):
        return False
    columns = _names_all(rows[index][1], named, quantities)
    below = [row for _, row in rows[index + 1 : index + 2 + BETWEEN]]
    if len(below) > BETWEEN and not all(map(_in_words, below[:BETWEEN])):
        below.pop()
    return bool(columns) and any(
        all(any(_is_number(row, i) for i in each) for each in columns) for row in below
    )


def _in_words(row: list[str]) -> bool:
    """Return whether a row has words and no number."""
    return bool(_LETTERS.search("".join(row))) and not any(map(is_reading, row))


@dataclass(frozen=True)
class Block:
    """A row of names with the numbers below it. line : of the names. summary : lines left out."""

    line: int
    units: dict[str, str]
    rows: Rows
    summary: tuple[int, ...] = ()


def find_blocks(
    path: Path, rows: Rows, first: int, named: Mapping[str, str], quantities: Sequence[str]
) -> dict[tuple[str, ...], list[Block]]:
    """Return the tables from the row `first` on, by names; units must not contradict these."""
    later = range(first + 1, len(rows))
    heads = [first, *(i for i in later if _is_header(rows, i, named, quantities)), len(rows)]
    blocks: dict[tuple[str, ...], list[Block]] = {}
    for head, end in pairwise(heads):
        line, names = rows[head]
        needed = [i for quantity in quantities for i in tables.columns_of(names, quantity, named)]
        units, body = {name: tables.split_unit(name)[1] for name in names}, head + 1
        below = rows[body][1] if body < end else []
        letters = any(_LETTERS.search(below[i]) for i in needed if i < len(below))
        if letters and not any(_is_number(below, i) for i in needed):
            body += 1
            if body + 1 < end and all(_in_words(rows[i][1]) for i in (body - 1, body)):
                body += any(_is_number(rows[body + 1][1], i) for i in needed)
            # Of the rows below the names, the one with most units has the units.
            number, below = max(
                rows[head + 1 : body], key=lambda one: len(UNITS & {*_units_in(one[1])})
            )
            for name, unit in zip(names, _units_in(below), strict=False):
                if unit and units[name] not in ("", unit):
                    problem = f"unit {unit!r} here, but {units[name]!r} in the column's name"
                    at = f"line {number}, column {name!r}"
                    raise InputError(path, at, f"{problem}; correct one")
                units[name] = unit or units[name]
        inside = [(n, row) for n, row in rows[body:end] if any(row)]
        # What stands between two tables begins with a word: the title of the second.
        while end < len(rows) and inside and not is_reading(next(filter(None, inside[-1][1]), "")):
            inside.pop()
        last = _count_of_readings(inside) if end == len(rows) else len(inside)
        summary = tuple(number for number, _ in inside[last:])
        blocks.setdefault(tuple(names), []).append(Block(line, units, inside[:last], summary))
    return blocks


def _units_in(row: list[str]) -> list[str]:
    return [tables.plain_unit(cell.strip("()[]<>{} ")) for cell in row]


def _is_number(row: list[str], column: int) -> bool:
    return column < len(row) and is_reading(row[column])


def _count_of_readings(rows: Rows) -> int:
    """Return the count of rows above a summary: means, or a short table after an empty line."""
    count = len(rows)
    while count > 1 and _is_summary(rows[count - 1][1], rows[0][1]):
        count -= 1
    for i in range(1, count):
        apart = rows[i][0] > rows[i - 1][0] + 1 and 4 * (len(rows) - i) <= i
        if apart and _is_summary(rows[i][1], rows[0][1]):
            return i
    return count


def _is_summary(row: list[str], first: list[str]) -> bool:
    """Return whether a row has a word where the `first` row of numbers has one of them."""
    if tables.has_statistic(row) and not tables.has_statistic(first):
        return True
    at = next(i for i, cell in enumerate(row) if cell)
    cell = row[at]
    word = _LETTERS.search(cell) and not is_reading(cell) and cell.casefold() not in tables.HOLES
    # One letter and nothing else is a slip of a reading.
    word = word and (len(cell) > 1 or any(row[at + 1 :]))
    return bool(word) and at < len(first) and (is_reading(first[at]) or not first[at])


def is_reading(cell: str) -> bool:
    """Return whether a cell holds a number or a time of a wall clock."""
    return tables.is_number(cell) or tables.is_stamp(cell)


def nothing_found(
    lines: list[tuple[int, str]], named: Mapping[str, str], quantities: Sequence[str]
) -> str:
    """Describe the row that might have been the row of names."""
    what = " and ".join(repr(named[q]) if q in named else f"one of {q}" for q in quantities)
    problem = f"no header row with the columns {what}; name them with columns"
    for index, ((number, text), (_, below)) in enumerate(pairwise(lines)):
        for separator in SEPARATORS:
            names, row = (cells_of(line, separator) or [line] for line in (text, below))
            if sum(map(tables.is_number, row)) >= 2:
                higher = cells_of(lines[index - 1][1], separator) if index else None
                # Names stand above their units.
                if higher and len(higher) == len(names) and UNITS & {*_units_in(names)}:
                    number, names = lines[index - 1][0], higher
                heads = ", ".join(name for name in names if name)[:200]
                return f"{problem}; line {number}, above the first numbers, has: {heads}"
    return f"{problem}; no line with two numbers was found either"


def read(path: Path, options: TableOptions) -> MachineTable:
    """Read the first table with all quantities asked for; InputError: none, or in doubt."""
    named, quantities = options.columns, options.quantities
    lines = tables.read_lines(path, options.comment, any_encoding=True)
    found: list[tuple[int, Rows, int, str | None]] = []
    for separator in SEPARATORS:
        if found and separator is None:
            break
        rows = [(number, cells_of(text, separator) or [text]) for number, text in lines]
        index = find_header(rows, named, quantities)
        if index is not None:
            found.append((len(rows[index][1]), rows, index, separator))
    if not found:
        raise InputError(path, "", nothing_found(lines, named, quantities))
    _, rows, index, separator = max(found, key=lambda one: one[0])
    return table_of(path, rows, index, options, separator)


def table_of(
    path: Path, rows: Rows, index: int, options: TableOptions, separator: str | None = ";"
) -> MachineTable:
    """Return the table whose names stand in the row `index`, or one below that has more rows."""
    named, quantities = options.columns, options.quantities
    blocks = find_blocks(path, rows, index, named, quantities)
    chosen = max(blocks, key=lambda names: sum(len(one.rows) for one in blocks[names]))
    names, several = list(chosen), blocks.pop(chosen)
    width, header, units = len(names), several[0].line, _units(path, several)
    rest = [row for one in several for row in one.rows]
    if not rest:
        raise InputError(path, f"line {header}", "no rows of numbers below these names")
    for number, row in rest:
        tables.check_row(path, number, row, width, separator, f"line {header}", short=True)
    tables.check_width(path, header, width, len(rest), sum(len(row) for _, row in rest))
    rest = [(number, (row + [""] * width)[:width]) for number, row in rest]
    above = dict(rows).get(max((n for n, _ in rows if n < header), default=0), [])
    names, rest, notes = _stacked(path, several[0], names, rest, above, options)
    first = {name: names.index(name) for name in names}
    # A column that comes twice with the same cells is one.
    once = [
        i for i, n in enumerate(names) if i == first[n] or any(r[i] != r[first[n]] for _, r in rest)
    ]
    names, rest = (
        [names[i] for i in once],
        [(number, [row[i] for i in once]) for number, row in rest],
    )
    rest, lost = _without_holes(rest, names, options)
    notes += tuple(
        f"{path.name}: left out, as {why}: line {', '.join(map(str, gone[:6]))}"
        + (f" and {len(gone) - 6} more" if len(gone) > 6 else "")
        for why, gone in (
            ("a row below the readings", [n for one in several for n in one.summary]),
            ("a reading without a value", lost),
        )
        if gone
    )
    cells = pd.DataFrame([row for _, row in rest], columns=names)
    needed = [i for quantity in quantities for i in tables.columns_of(names, quantity, named)]
    numbers = [(n, names[i], row[i]) for n, row in rest for i in needed if i < len(row)]
    decimal = options.decimal or tables.decimal_mark(path, numbers)
    table = tables.TextTable(path, cells, np.array([number for number, _ in rest]), decimal)
    others = [str(one.line) for several in blocks.values() for one in several]
    note = (
        f"{path.name}: the table with its names in line {header}, which has most rows, is read; not"
        f" that of line {' and '.join(others)}"
    )
    return MachineTable(table, units, header, (*notes, note) if others else notes)


def _without_holes(rows: Rows, names: list[str], options: TableOptions) -> tuple[Rows, list[int]]:
    """Return rows without those of lost readings, and the lines of these; all if most are."""
    needed: list[int] = []
    for quantity in options.quantities:
        which = tables.columns_of(names, quantity, options.columns)
        near = quantity == "elongation" and quantity not in options.columns
        needed += tables.nearest_to_strip(names, which) if near else which
    lost = [
        n for n, row in rows if any(row[i] and row[i].casefold() in tables.HOLES for i in needed)
    ]
    gone = {*lost} if 2 * len(lost) <= len(rows) else set()
    return [one for one in rows if one[0] not in gone], sorted(gone)


def _plain(name: str) -> str:
    """Return a name without its unit and numbers: that of the same column of another specimen."""
    return re.sub(r"[\W\d_]+", " ", tables.split_unit(name)[0].casefold()).strip()


def _stacked(
    path: Path, block: Block, names: list[str], rows: Rows, above: Sequence[str],
    options: TableOptions,
) -> tuple[list[str], Rows, tuple[str, ...]]:  # fmt: skip
    """Return names, rows, note of specimens side by side as if below each other; above : titles."""
    loads = tables.columns_of(names, "load", options.columns)
    apart = {b - a for a, b in pairwise(loads)}
    if "elongation" not in options.quantities or len(apart) != 1:
        return names, rows, ()
    (wide,), units = apart, {**block.units, "": ""}
    padded, count = [*names, *[""] * wide], len(loads)
    for first in range(loads[0], max(-1, loads[0] - wide), -1):
        groups = [range(first + k * wide, first + (k + 1) * wide) for k in range(count)]
        own = padded[first : first + wide]
        alike = len({tuple(_plain(padded[i]) for i in group) for group in groups}) == 1
        if alike and all(tables.columns_of(own, q, options.columns) for q in options.quantities):
            break
    else:
        return names, rows, ()
    for i, j in ((groups[0][k], group[k]) for group in groups for k in range(wide)):
        if units[padded[i]] != units[padded[j]]:
            problem = f"another unit than column {padded[i]!r} of the specimen beside it"
            raise InputError(path, f"line {block.line}, column {padded[j]!r}", problem)
    titles = [[above[i] for i in group if i < len(above) and above[i]] for group in groups]
    said = [one[0] for one in titles if len(one) == 1 and not is_reading(one[0])]
    labels = said if len({*said}) == count else [f"{path.stem} {k + 1}" for k in range(count)]
    shared = [i for i in range(len(names)) if not first <= i < first + count * wide]
    stacked = [
        (number, [*(row[i] for i in shared), *own, label])
        for group, label in zip(groups, labels, strict=True)
        for number, row in rows
        if any(own := [*row, *[""] * wide][group.start : group.stop])
    ]
    ways = {re.sub(r"[\W_]+", "", one.casefold()) for one in labels} <= {*tables.DIRECTION_ALIASES}
    what = "direction" if ways else "specimen"
    block.units.update({"": "", what: ""})
    note = f"{path.name}: {count} {what}s side by side are read: {', '.join(labels)}"
    return [*(names[i] for i in shared), *padded[first : first + wide], what], stacked, (note,)


def _units(path: Path, several: Sequence[Block]) -> dict[str, str]:
    """Return the units of tables of the same names, which are read as one."""
    first = several[0]
    for one in several[1:]:
        for name, unit in one.units.items():
            if unit and unit != first.units[name]:
                before = repr(first.units[name]) if first.units[name] else "none"
                where = f"{before} in the table of the same names in line {first.line}"
                problem = f"unit {unit!r} here, but {where}; correct one"
                raise InputError(path, f"line {one.line}, column {name!r}", problem)
    return first.units


register_format(Format("text", "machine table", "columns of text, as test machines export", read))
