"""One value that a text file of points tells beside them: in a column, or above the table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from .channels import Channel, in_unit
from .column_names import MOST_NAMES, split_unit
from .tables import HOLES, read_lines
from .text_layouts import SEPARATORS, TOP, Lines, cells_of

#: Units of readings that a scale makes something of.
VOLTS = ("V", "mV")
#: Letters of a line in which a value is looked for.
LONGEST = 1000
_NUMBER = r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?"


def value_in_file(path: Path, channel: Channel, units: Mapping[str, float]) -> float:
    """The value that `channel.column` names, in the unit of `units`.

    A column must hold the same value in each row. Else a line above the numbers says it, such as
    `# pressure [kPa] = 35.5` or `Pressure;35,5;kPa`.

    Raises
    ------
    InputError : naming file and line: no such column or line, several values, no or unknown units.
    """
    name = channel.column or ""
    # Comments are kept: a value may stand in one.
    lines = read_lines(path, "", any_encoding=True)
    found = _in_column(path, lines, name) or _above(path, lines, name, (*units, *VOLTS))
    if found is None:
        problem = (
            f"neither a column {name!r} nor a line above the numbers that says {name!r} and a value"
        )
        raise InputError(path, "", problem)
    value, unit, at = found
    return float(in_unit(np.array([value]), unit, channel, units, path, at)[0])


def _in_column(path: Path, lines: Lines, name: str) -> tuple[float, str, str] | None:
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:TOP]):
            if name not in text:
                continue
            names = [cell.lstrip("# ") for cell in cells_of(text, separator) or []]
            where = [i for i, cell in enumerate(names) if name in (cell, split_unit(cell)[0])]
            below = [cells_of(text, separator) or [] for _, text in lines[index + 1 : index + 3]]
            numbers = any(re.fullmatch(_NUMBER, cell) for cell in names)
            if (
                not 2 <= len(names) <= MOST_NAMES
                or numbers
                or not any(_is_of_numbers(row, names) for row in below)
            ):
                continue
            if len(where) > 1:
                problem = f"{len(where)} columns are called {name!r}"
                raise InputError(path, f"line {lines[index][0]}", problem)
            if where:
                return _constant(path, lines[index:], separator, names[where[0]], where[0])
    return None


def _is_of_numbers(row: list[str], names: list[str]) -> bool:
    numbers = sum(bool(re.fullmatch(_NUMBER, cell)) for cell in row)
    return len(row) >= len(names) - 1 and 2 * numbers >= len(names)


def _constant(
    path: Path, lines: Lines, separator: str | None, name: str, column: int
) -> tuple[float, str, str]:
    """The one value of a column, its unit, and where it stands. `lines` begin with the names."""
    unit, first = split_unit(name)[1], None
    for number, text in lines[1:]:
        row = cells_of(text, separator) or []
        cell = row[column] if column < len(row) else ""
        if re.fullmatch(_NUMBER, cell) is None:
            # The row of units stands right below the names.
            if first is None and number <= lines[0][0] + 2 and cell:
                unit = cell.strip("()[]<>{} ")
            elif cell.casefold() not in HOLES:
                problem = f"expected a number, found {cell[:40]!r}"
                raise InputError(path, f"line {number}, column {name!r}", problem)
            continue
        value = float(cell.replace(",", "."))
        if first is None:
            first = value, number
        elif value != first[0]:
            problem = f"expected the same number as in line {first[1]}, one a file"
            raise InputError(path, f"line {number}, column {name!r}", problem)
    if first is None:
        raise InputError(path, f"line {lines[0][0]}, column {name!r}", "holds no number")
    return first[0], unit, f"line {lines[0][0]}, column {name!r}"


def _above(
    path: Path, lines: Lines, name: str, units: Sequence[str]
) -> tuple[float, str, str] | None:
    """A line such as "name [unit] = number", "name_unit=number" or "name: number unit"."""
    known = "|".join(sorted(units, key=len, reverse=True))
    says = re.compile(
        rf"(?<!\w){re.escape(name)}(?:_({known}))?(?!\w)[ _]*(?:[(\[<]([^)\]>]*)[)\]>])?"
        rf"[\s:=;,]*({_NUMBER})(?:[\s;,]*({known})(?!\w))?"
    )
    every = [(found, line) for line, text in lines[:TOP] if (found := says.search(text[:LONGEST]))]
    if not every:
        return None
    values = {float(found[3].replace(",", ".")) for found, _ in every}
    if len(values) > 1:
        first, second = every[0][1], every[1][1]
        problem = f"says another {name!r} than line {first}"
        raise InputError(path, f"line {second}", problem)
    found, line = every[0]
    own = found[1] or found[2] or found[4] or split_unit(name)[1]
    return values.pop(), own.strip(), f"line {line}"
