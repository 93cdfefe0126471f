"""Numbers in the names of files: a pressure, a time, the number of a picture."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from ..errors import InputError
from .trials import ends

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
    """The number in a file's name, times what its unit is in `units`.

    Parameters
    ----------
    pattern : regular expression with one group, which holds the number; None looks for the one
        number that is followed by a unit, as in `step_012_35.5kPa.csv`.
    unit : of the number that the pattern finds; one in `units`, or a number without a unit (1).
    field : what complaints call the pattern.

    Raises
    ------
    InputError : no such number in the name, or several.
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
    """What is wrong with a pattern, None where nothing is."""
    try:
        groups = re.compile(pattern).groups
    except re.error as error:
        return f"is no regular expression ({error}): {pattern!r}"
    if groups != 1:
        return f"expected one group, in brackets, around the number; {pattern!r} has {groups}"
    return None
