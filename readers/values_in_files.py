"""Read a value such as the pressure from a file of points, or from the names of files."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..light_dataclasses import dataclass
from ..processes import ends_within
from .frames import Array
from .machine_tables import Channel, in_unit
from .quantities import MAX_COLUMNS, heading_of
from .tables import (
    MAX_LINES_ABOVE,
    NUMBER,
    SEPARATORS,
    Cells,
    Lines,
    Rows,
    is_hole,
    is_number,
    parse_number,
    read_lines,
    row_of,
)
from .units import PRESSURE_UNITS, split_unit, without_brackets

#: Number of characters of a line that are searched.
MAX_LINE_LENGTH = 1000
#: Units of readings that a scale makes something of.
VOLTS = ("V", "mV")


@dataclass(frozen=True)
class FileValues:
    """Values of a file, one for each frame, their unit, and their line and column for messages."""

    values: Sequence[float]
    unit: str
    location: str


def values_in_file(path: Path, channel: Channel, units: Mapping[str, float]) -> Array:
    """Return the values that a file of frames names, such as its pressure.

    Parameters
    ----------
    path : Path
    channel : Channel
        Its column is the name of a column that is constant in each frame, or stands in a line
        above the numbers with the value behind it.
    units : mapping
        Table of units of the quantity.

    Returns
    -------
    (frames,) array
        In the base unit.

    Raises
    ------
    InputError
        There is no such value, several in a frame, or no unit.
    """
    name = channel.column or ""
    # With comments: a value may stand in one.
    lines = read_lines(path, "", any_encoding=True)
    result = _in_column(path, lines, name) or _above_numbers(path, lines, name, (*units, *VOLTS))
    if result is None:
        problem = f"neither a column {name!r} nor a line above the numbers that says {name!r}"
        raise InputError(path, "", f"{problem} and a value")
    values = np.array(result.values)
    return in_unit(
        values,
        result.unit,
        channel,
        units,
        path,
        result.location,
    )


def _in_column(path: Path, lines: Lines, name: str) -> FileValues | None:
    """Return the values of a column, None where there is none of this name."""
    for rows in _tables_naming(lines, name):
        line = rows[0].line
        names = [cell.lstrip("# ") for cell in rows[0].cells]
        columns = [i for i, cell in enumerate(names) if name in (cell, split_unit(cell)[0])]
        if len(columns) > 1:
            raise InputError(path, f"line {line}", f"{len(columns)} columns are called {name!r}")
        if columns:
            return _constants(path, rows, names, columns[0])
    return None


def _tables_naming(lines: Lines, name: str) -> Iterator[Rows]:
    """Yield the rows from each header on in which a name stands, at each separator."""
    for separator in SEPARATORS:
        for index, (_, text) in enumerate(lines[:MAX_LINES_ABOVE]):
            if name not in text:
                continue
            top = [row_of(*line, separator) for line in lines[index : index + 3]]
            if _is_header(top):
                yield [row_of(*line, separator) for line in lines[index:]]


def _is_header(rows: Rows) -> bool:
    """Return whether the first of three rows has names, and one of the others numbers of them."""
    names = [cell.lstrip("# ") for cell in rows[0].cells]
    if not 2 <= len(names) <= MAX_COLUMNS or any(map(is_number, names)):
        return False
    return any(
        len(row.cells) >= len(names) - 1 and 2 * sum(map(is_number, row.cells)) >= len(names)
        for row in rows[1:]
    )


def _constants(
    path: Path,
    rows: Rows,
    names: Cells,
    column: int,
) -> FileValues:
    """Return the value of a column in each frame, by the numbers of frames if there are any."""
    name = names[column]
    unit = split_unit(name)[1]
    header = rows[0].line
    frame_column = _frame_column(names)
    values: dict[float, float] = {}
    first_lines: dict[float, int] = {}
    for line, cells in rows[1:]:
        cell = cells[column] if column < len(cells) else ""
        field = f"line {line}, column {name!r}"
        if not is_number(cell):
            # The row of units stands right below the names.
            if not values and line <= header + 2 and cell:
                unit = without_brackets(cell)
            elif not is_hole(cell):
                raise InputError(path, field, f"expected a number, found {cell[:40]!r}")
            continue
        number = _frame_number(path, line, names, cells, frame_column)
        value = parse_number(cell)
        if values.setdefault(number, value) != value:
            problem = f"expected the same number as in line {first_lines[number]}, one a file"
            raise InputError(path, field, problem)
        first_lines.setdefault(number, line)
    location = f"line {header}, column {name!r}"
    if not values:
        raise InputError(path, location, "holds no number")
    return FileValues([values[number] for number in sorted(values)], unit, location)


def _frame_column(names: Cells) -> int | None:
    """Return the column of the numbers of frames; None where there is none, or several."""
    columns = [i for i, name in enumerate(names) if heading_of(name).quantity == "frame"]
    return columns[0] if len(columns) == 1 else None


def _frame_number(
    path: Path,
    line: int,
    names: Cells,
    cells: Cells,
    frame_column: int | None,
) -> float:
    """Return the number of the frame that a row is of; 0 in a file of one."""
    if frame_column is None or frame_column >= len(cells):
        return 0.0
    if not is_number(cells[frame_column]):
        problem = f"expected a number, found {cells[frame_column][:40]!r}"
        raise InputError(path, f"line {line}, column {names[frame_column]!r}", problem)
    return parse_number(cells[frame_column])


def _above_numbers(
    path: Path,
    lines: Lines,
    name: str,
    units: Sequence[str],
) -> FileValues | None:
    """Find a line such as "name [unit] = number", "name_unit=number" or "name: number unit"."""
    unit_names = "|".join(sorted(units, key=len, reverse=True))
    statement = re.compile(
        rf"(?<!\w){re.escape(name)}(?:_({unit_names}))?(?!\w)[ _]*(?:[(\[<]([^)\]>]*)[)\]>])?"
        rf"[\s:=;,]*({NUMBER})(?![\d.,]*\d)(?:[\s;,]*({unit_names})(?!\w))?"
    )
    matches = []
    for line, text in lines[:MAX_LINES_ABOVE]:
        match = statement.search(text[:MAX_LINE_LENGTH])
        if match:
            matches.append((line, match))
    if not matches:
        return None
    values = {parse_number(match[3]) for _, match in matches}
    line, match = matches[0]
    if len(values) > 1:
        second = matches[1][0]
        raise InputError(path, f"line {second}", f"says another {name!r} than line {line}")
    unit = match[1] or match[2] or match[4] or split_unit(name)[1]
    return FileValues([*values], unit.strip(), f"line {line}")


#: One repeat in a pattern ends soon on any name; of several it is seen whether they do (s).
SEARCH_SECONDS = 5.0
_REPEATS = re.compile(r"[*+?{]")
#: Without a sign: in a name it is a dash.
_UNSIGNED = r"\d+(?:[.,]\d+)?"
#: Missing numbers of pictures that are listed.
MAX_LISTED_NUMBERS = 5


def numbers_in_names(
    files: Sequence[Path],
    units: Mapping[str, float],
    pattern: str | None = None,
    unit: str | None = None,
    field: str = "",
) -> Array:
    """Return the values (files,) of a quantity that the names of a sequence of files hold.

    As `number_in_name`. Without a pattern, "1_5bar" is refused too, unless the sequence shows that
    the first of two whole numbers is a counter and no part of the value.
    """
    values = np.array([number_in_name(file, units, pattern, unit, field) for file in files])
    if pattern is None and (doubtful := doubtful_name(files, units)):
        file, match = doubtful
        counter, mark, number, name = match.groups()
        behind = match[0][match.end(3) - match.start() :]
        problem = (
            f"{number} {name} may be {counter}.{number} {name}, and the names of the files do not "
            f"show which; write 1.5 with a point, or a pattern with one group says what is meant: "
            rf"'(\d+{mark}\d+){behind}' or '{mark}(\d+){behind}', with its unit"
        )
        raise InputError(file, field, problem)
    return values


def doubtful_name(files: Sequence[Path], units: Iterable[str]) -> tuple[Path, re.Match[str]] | None:
    """Return a name with a number that may be the decimals of the one before it, and where."""
    split = re.compile(rf"(?<![\d.,])(\d+)([_ -]){_number_with(units)}")
    matches = [(file, match) for file in files if (match := split.search(file.stem))]
    # One with decimals or of three digits, or a counter with zeros in front, says what all are.
    settled = re.compile(r"^0\d|[ _-](\d+[.,]|\d{3})")
    if not matches or any(settled.search(match[0]) for _, match in matches):
        return None
    counters = np.array([int(match[1]) for _, match in matches])
    numbers = np.array([int(match[3]) for _, match in matches])
    if len(matches) == len(files) and _is_counted(counters, numbers):
        return None
    return matches[0]


def _is_counted(counters: Array, numbers: Array) -> bool:
    """Return whether whole numbers before others (files,) name the test or count its files."""
    rises = np.diff(numbers)
    # Single digits are the usual decimals.
    if numbers.max() < 10 or not rises.any():
        return False
    if (counters == counters[0]).all():
        return bool(counters[0] > 0 and (rises > 0).all())
    min_files = 5 if (rises >= 0).all() else 10
    return bool((np.diff(counters) == 1).all() and len(numbers) >= min_files)


def number_in_name(
    path: Path,
    units: Mapping[str, float],
    pattern: str | None = None,
    unit: str | None = None,
    field: str = "",
) -> float:
    """Return the value of a quantity, such as a pressure, that a file's name holds.

    Parameters
    ----------
    path : Path
    units : mapping
        Table of units of the quantity.
    pattern : str, optional
        Regular expression whose group is the number; if omitted it stands before one of the units.
    unit : str, optional
        Unit of the number that the pattern finds; the base unit if omitted.
    field : str
        Key or argument that errors name.

    Returns
    -------
    float
        Value in the base unit.

    Raises
    ------
    InputError
        There is no such number, or several.
    """
    if pattern is not None:
        return _number_by_pattern(path, pattern, units, unit, field)
    matches = re.findall(_number_with(units), path.stem)
    if len(matches) != 1:
        listed = " and ".join(f"{number} {name}" for number, name in matches) or "none"
        problem = (
            f"expected one number with its unit ({', '.join(units)}) in the file's name, found "
            f"{listed}; a pattern with one group says where it is"
        )
        raise InputError(path, field, problem)
    ((number, name),) = matches
    if re.search(rf"\d[pe]{re.escape(number)}[ _]?{name}", path.stem, re.IGNORECASE):
        problem = f"{number} {name} stands behind a letter that may be a decimal mark or a power"
        raise InputError(path, field, f"{problem}; a pattern with one group says what is meant")
    return parse_number(number) * units[name]


def _number_with(units: Iterable[str]) -> str:
    """Return the pattern of a number and its unit."""
    return rf"({_UNSIGNED})[ _]?{_unit_of(units)}"


def _unit_of(units: Iterable[str]) -> str:
    """Return the pattern of a unit's name."""
    names = "|".join(sorted(units, key=len, reverse=True))
    # A letter after the unit makes it a word: "12max" is not 12 m.
    return rf"({names})(?![^\W\d_])"


def _number_by_pattern(
    path: Path, pattern: str, units: Mapping[str, float], unit: str | None, field: str
) -> float:
    """Return the value in the base unit that the group of a pattern finds in a file's name.

    Raises
    ------
    InputError
        The pattern takes too long or does not fit, its group holds no number, or another unit
        stands right behind it.
    """
    match = _match(path, pattern, field)
    # A group of two whole numbers is one with decimals.
    text = re.sub(r"(?<=\d)[_ p-](?=\d+$)", ".", match[1] or "")
    try:
        number = parse_number(text)
    except ValueError:
        problem = f"expected a number in the group of {pattern!r}, found {match[1]!r}"
        raise InputError(path, field, problem) from None
    size = 1.0 if unit is None else units[unit]
    behind = re.match(_unit_of(units), path.name[match.end(1) :])
    if behind and units[behind[1]] != size:
        base_unit = next(name for name in units if units[name] == size)
        problem = f"{behind[1]} stands behind the number, which {pattern!r} reads in {base_unit}"
        raise InputError(path, field, problem)
    return number * size


def _match(path: Path, pattern: str, field: str) -> re.Match[str]:
    """Return where a pattern fits the file's name; InputError where it does not, or takes long."""
    has_several_repeats = len(_REPEATS.findall(pattern)) > 1
    if has_several_repeats and not ends_within(SEARCH_SECONDS, partial(_search, pattern, path)):
        problem = f"the pattern {pattern!r} takes too long; repeat (+, *) less in it"
        raise InputError(path, field, problem)
    match = _search(pattern, path)
    if match is None:
        raise InputError(path, field, f"the file's name does not fit the pattern {pattern!r}")
    return match


def _search(pattern: str, path: Path) -> re.Match[str] | None:
    """Return where a pattern fits the file's name."""
    return re.search(pattern, path.name)


def check_pattern(pattern: str) -> str | None:
    """Return what is wrong with a pattern for numbers, None if it is valid."""
    try:
        groups = re.compile(pattern).groups
    except re.error as error:
        return f"is no regular expression ({error}): {pattern!r}"
    if groups != 1:
        return f"expected one group, in brackets, around the number; {pattern!r} has {groups}"
    return None


def picture_numbers(
    files: Sequence[Path], file_numbers: Sequence[float | None], by_trigger: bool = False
) -> tuple[Array, list[str]]:
    """Return the numbers of the pictures that frames are of.

    Parameters
    ----------
    files : sequence of Path
    file_numbers : (frames,) sequence of float or None
        Numbers of the frames in their files; where some have none, those in the names count.
    by_trigger : bool
        Whether the offset of the clocks is given, so that the first frame's time counts.

    Returns
    -------
    numbers : (frames,) array
        From 0.
    doubts : list of str
    """
    if None not in file_numbers:
        numbers = np.array(file_numbers, dtype=float)
    elif len(files) == len(file_numbers) and (counters := _counters(files)):
        # Of several, those that rise at every frame, and by least: a counter, no time of the day.
        numbers = min(counters, key=lambda n: ((np.diff(n) <= 0).sum(), n[-1] - n[0]))
    else:
        return np.arange(len(file_numbers), dtype=float), []
    return numbers - numbers[0], _doubts_of_numbers(numbers, by_trigger)


def _counters(files: Sequence[Path]) -> list[Array]:
    """Return the numbers in the names of files that never fall, each (files,); no pressures."""
    pressure = _number_with(PRESSURE_UNITS)
    plain_names = [re.sub(pressure, "", str(file.with_suffix(""))) for file in files]
    rows = [[float(digits) for digits in re.findall(r"\d+", name)] for name in plain_names]
    columns = map(np.array, zip(*rows, strict=False))
    return [n for n in columns if (np.diff(n) >= 0).all() and n[-1] > n[0]]


def _doubts_of_numbers(numbers: Array, by_trigger: bool) -> list[str]:
    """Return what is doubtful in numbers (frames,) of which times are made."""
    steps = np.diff(numbers)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else 1.0
    subject = f"the frames' numbers, {numbers[0]:.10g} to {numbers[-1]:.10g},"
    advice = "times are numbers over 'rate'; time_in_name = false counts the frames instead"
    doubts = []
    if usual != 1:
        doubts.append(f"{subject} go up by {usual:g}: {advice}")
    if (steps > usual).any():
        missing = np.setdiff1d(np.arange(numbers[0], numbers[-1], usual), numbers)
        listed = _list_numbers(missing) or "unevenly"
        if len(missing) > MAX_LISTED_NUMBERS:
            listed += ", ..."
        doubts.append(f"{subject} leave out {len(missing)} ({listed}): {advice}")
    if (steps <= 0).any():
        repeated = _list_numbers(np.unique(numbers[1:][steps <= 0]))
        doubts.append(f"{subject} come again ({repeated}): two frames of one time; {advice}")
    if by_trigger and numbers[0] not in (0, 1):
        clock = "the given offset is the log's time of it"
        doubts.append(f"{subject} are times from the first: {clock}")
    return doubts


def _list_numbers(numbers: Array) -> str:
    """Return the first numbers (n,) as text, with commas."""
    return ", ".join(f"{number:.10g}" for number in numbers[:MAX_LISTED_NUMBERS])
