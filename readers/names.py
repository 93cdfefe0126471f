"""Numbers in the names of files: a pressure, a time, the number of a picture."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import ends
from .columns import MOST_NAMES, split_unit
from .machine_tables import Channel, in_unit
from .tables import HOLES, read_lines
from .text_frames import SEPARATORS, TOP, Lines, cells_of

# Without a sign: in a name it is a dash.
#: One repeat in a pattern ends soon on any name; of several it is seen whether they do (s).
SECONDS = 5.0
_REPEATS = re.compile(r"[*+?{]")
_NUMBER = r"\d+(?:[.,]\d+)?"


def number_in_name(
    path: Path,
    units: Mapping[str, float],
    pattern: str | None = None,
    unit: str | None = None,
    field: str = "",
) -> float:
    """Return the number in a file's name, times what its unit is in `units`.

    pattern : regular expression with one group; None looks for the one number that is followed by a
    unit, as in `step_012_35.5kPa.csv`. unit : of the number of the pattern; none is 1. field : name
    of the pattern in errors.
    """
    if pattern is not None:
        hard = len(_REPEATS.findall(pattern)) > 1
        if hard and not ends(partial(_searched, pattern, path), SECONDS):
            problem = f"the pattern {pattern!r} takes too long; repeat (+, *) less in it"
            raise InputError(path, field, problem)
        found = _searched(pattern, path)
        if found is None:
            raise InputError(path, field, f"the file's name does not fit the pattern {pattern!r}")
        try:
            number = float((found[1] or "").replace(",", "."))
        except ValueError:
            problem = f"expected a number in the group of {pattern!r}, found {found[1]!r}"
            raise InputError(path, field, problem) from None
        return number * (1.0 if unit is None else units[unit])
    known = "|".join(sorted(units, key=len, reverse=True))
    # A letter after the unit makes it a word: "12max" is not 12 m.
    every = re.findall(rf"({_NUMBER})[ _]?({known})(?![^\W\d_])", path.stem)
    if len(every) != 1:
        seen = " and ".join(f"{number} {name}" for number, name in every) or "none"
        problem = (
            f"expected one number with its unit ({', '.join(units)}) in the file's name, found "
            f"{seen}; a pattern with one group says where it is"
        )
        raise InputError(path, field, problem)
    number, name = every[0]
    return float(number.replace(",", ".")) * units[name]


def _searched(pattern: str, path: Path) -> re.Match[str] | None:
    return re.search(pattern, path.name)


def check_pattern(pattern: str) -> str | None:
    """Return the fault of a pattern, None where there is none."""
    try:
        groups = re.compile(pattern).groups
    except re.error as error:
        return f"is no regular expression ({error}): {pattern!r}"
    if groups != 1:
        return f"expected one group, in brackets, around the number; {pattern!r} has {groups}"
    return None


#: Units of readings that a scale makes something of.
VOLTS = ("V", "mV")
#: Letters of a line in which a value is looked for.
LONGEST = 1000
_NUMBER_FILE_VALUES = r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?"


def value_in_file(path: Path, channel: Channel, units: Mapping[str, float]) -> float:
    """Return the value that `channel.column` names, in the unit of `units`.

    A column must hold the same value in each row. Else a line above the numbers says it, such as `#
    pressure [kPa] = 35.5` or `Pressure;35,5;kPa`.
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
            numbers = any(re.fullmatch(_NUMBER_FILE_VALUES, cell) for cell in names)
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
    numbers = sum(bool(re.fullmatch(_NUMBER_FILE_VALUES, cell)) for cell in row)
    return len(row) >= len(names) - 1 and 2 * numbers >= len(names)


def _constant(
    path: Path, lines: Lines, separator: str | None, name: str, column: int
) -> tuple[float, str, str]:
    """Return the one value of a column, its unit and place; `lines` begin with the names."""
    unit, first = split_unit(name)[1], None
    for number, text in lines[1:]:
        row = cells_of(text, separator) or []
        cell = row[column] if column < len(row) else ""
        if re.fullmatch(_NUMBER_FILE_VALUES, cell) is None:
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
    """Find a line such as "name [unit] = number", "name_unit=number" or "name: number unit"."""
    known = "|".join(sorted(units, key=len, reverse=True))
    says = re.compile(
        rf"(?<!\w){re.escape(name)}(?:_({known}))?(?!\w)[ _]*(?:[(\[<]([^)\]>]*)[)\]>])?"
        rf"[\s:=;,]*({_NUMBER_FILE_VALUES})(?:[\s;,]*({known})(?!\w))?"
    )
    every = [(found, line) for line, text in lines[:TOP] if (found := says.search(text[:LONGEST]))]
    if not every:
        return None
    values = {float(found[3].replace(",", ".")) for found, _ in every}
    if len(values) > 1:
        first, second = every[0][1], every[1][1]
        raise InputError(path, f"line {second}", f"says another {name!r} than line {first}")
    found, line = every[0]
    own = found[1] or found[2] or found[4] or split_unit(name)[1]
    return values.pop(), own.strip(), f"line {line}"
