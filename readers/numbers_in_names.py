"""Read numbers from file names: pressures and times with a unit, and numbers of pictures."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..processes import ends_within
from .frames import Array
from .numerals import parse_number
from .units import PRESSURE_UNITS

#: One repeat in a pattern ends soon on any name; of several it is seen whether they do (s).
SEARCH_SECONDS = 5.0
_REPEATS = re.compile(r"[*+?{]")
#: Without a sign: in a name it is a dash.
_UNSIGNED = r"\d+(?:[.,]\d+)?"
#: Missing numbers of pictures that are listed.
MAX_LISTED_NUMBERS = 5


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
        return _number_by_pattern(path, pattern, field) * (1.0 if unit is None else units[unit])
    matches = re.findall(_number_with(units), path.stem)
    if len(matches) != 1:
        listed = " and ".join(f"{number} {name}" for number, name in matches) or "none"
        problem = (
            f"expected one number with its unit ({', '.join(units)}) in the file's name, found "
            f"{listed}; a pattern with one group says where it is"
        )
        raise InputError(path, field, problem)
    ((number, name),) = matches
    return parse_number(number) * units[name]


def _number_with(units: Iterable[str]) -> str:
    """Return the pattern of a number and its unit."""
    names = "|".join(sorted(units, key=len, reverse=True))
    # A letter after the unit makes it a word: "12max" is not 12 m.
    return rf"({_UNSIGNED})[ _]?({names})(?![^\W\d_])"


def _number_by_pattern(path: Path, pattern: str, field: str) -> float:
    has_several_repeats = len(_REPEATS.findall(pattern)) > 1
    if has_several_repeats and not ends_within(SEARCH_SECONDS, partial(_search, pattern, path)):
        problem = f"the pattern {pattern!r} takes too long; repeat (+, *) less in it"
        raise InputError(path, field, problem)
    match = _search(pattern, path)
    if match is None:
        raise InputError(path, field, f"the file's name does not fit the pattern {pattern!r}")
    try:
        return parse_number(match[1] or "")
    except ValueError:
        problem = f"expected a number in the group of {pattern!r}, found {match[1]!r}"
        raise InputError(path, field, problem) from None


def _search(pattern: str, path: Path) -> re.Match[str] | None:
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
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
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
    return ", ".join(f"{number:.10g}" for number in numbers[:MAX_LISTED_NUMBERS])
