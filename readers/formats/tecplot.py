"""Tecplot's text files (.dat), as LaVision DaVis and others export them: a frame a zone.

    VARIABLES = "x[mm]" "y[mm]" "z[mm]" "Vx[mm]" "Vy[mm]" "Vz[mm]" "isValid"

Source: a public reader of DaVis' snapshots (`DATAPACKING = POINT`) and Tecplot's format guide:
POINT (a row a point) or BLOCK (a variable after the other). Vx, Vy, Vz are inferred to be
displacements where their unit is a length. Finite elements' zones are refused.
"""

import math
import re
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...files import pandas as pd
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..headings import Heading, columns_of, heading_of
from ..numerals import is_number
from ..registry import Format, register_format
from ..tables import read_lines

_VARIABLES = re.compile(rb"^[ \t]*+VARIABLES[ \t]*+=", re.IGNORECASE | re.MULTILINE)
_WORD = re.compile(r"^\s*(TITLE|VARIABLES|ZONE|DATASETAUXDATA|TEXT|GEOMETRY)\b", re.IGNORECASE)
_KEY = re.compile(r'\b([A-Z]+)\s*=\s*("[^"]*"|\([^)]*\)|[^\s,"(]+)', re.IGNORECASE)
_NUMBERS = re.compile(r"^(?:[\s\d+\-.,e]|nan)*$", re.IGNORECASE)
FLAGS = ("valid", "invalid", "sigma")


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a line lists variables."""
    return bool(_VARIABLES.search(head[:16384]))


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the frames of a file, one a zone."""
    names, zones = _zones(path)
    headings = _with_vectors([heading_of(name) for name in names])
    columns = _columns(path, headings, options)
    found = {key: headings[i] for key, i in columns.items() if key not in FLAGS}
    named = {key: heading.name for key, heading in found.items()}
    units = {key: heading.unit for key, heading in found.items()}
    frames = []
    for line, keys, numbered in zones:
        table = _numbers(path, line, keys, numbered, len(names))
        values = {key: table[:, i] for key, i in columns.items()}
        valid, invalid, sigma = (values.pop(key, None) for key in FLAGS)
        good = np.ones(len(table), dtype=bool) if valid is None else valid != 0
        good &= True if invalid is None else invalid == 0
        rows = FrameRows(values, named, units, valid=good, sigma=sigma)
        frames.append(frame_of(rows, options, path, "tecplot"))
    return frames


#: Line number of the zone, its keys in capitals, and the lines of its numbers.
Zone = tuple[int, dict[str, str], list[tuple[int, str]]]


def _zones(path: Path) -> tuple[list[str], list[Zone]]:
    names: list[str] = []
    zones: list[Zone] = []
    state = ""
    for number, text in read_lines(path, "#", any_encoding=True):
        word = _WORD.match(text)
        if word:
            state = word[1].upper()
            if state == "ZONE":
                zones.append((number, {}, []))
        rest = text[word.end() :] if word else text
        if state == "VARIABLES":
            names += [a or b for a, b in re.findall(r'"([^"]*)"|([^\s,="]+)', rest)]
        elif state == "ZONE" and not _NUMBERS.match(rest):
            keys = {key.upper(): value for key, value in _KEY.findall(rest)}
            if not word and (zones[-1][2] or not keys):
                raise InputError(path, f"line {number}", f"expected numbers, found {rest[:40]!r}")
            zones[-1][1].update(keys)
        elif state == "ZONE":
            zones[-1][2].append((number, rest))
    if not names or not zones:
        problem = f"expected VARIABLES and a ZONE, found no {'ZONE' if names else 'VARIABLES'}"
        raise InputError(path, "", problem)
    return [name.strip() for name in names], zones


def _numbers(
    path: Path, line: int, keys: Mapping[str, str], lines: list[tuple[int, str]], width: int
) -> NDArray[np.float64]:
    """Return the numbers of a zone, (points, variables)."""
    packing = keys.get("DATAPACKING", keys.get("F", "POINT")).upper()
    if packing not in ("POINT", "BLOCK") or "FE" in keys.get("ZONETYPE", "").upper():
        kind = f"{packing} {keys.get('ZONETYPE', '')}".strip()[:40]
        problem = f"a zone of points as POINT or BLOCK is needed, this is {kind!r}"
        raise InputError(path, f"line {line}", problem)
    try:
        flat = _flat([text for _, text in lines], width)
    except ValueError:
        tokens = ((n, token) for n, text in lines for token in text.replace(",", " ").split())
        bad = (own for own in tokens if not is_number(own[1]) and own[1].casefold() != "nan")
        number, token = next(bad, (line, "nothing else"))
        problem = f"expected a number, found {token[:40]!r}"
        raise InputError(path, f"line {number}", problem) from None
    if not flat.size or flat.size % width:
        problem = f"expected {width} numbers a point, found {flat.size} numbers in the zone"
        raise InputError(path, f"line {line}", problem)
    given = [int(keys[key][:9]) for key in "IJK" if keys.get(key, "").isdecimal()]
    if given and math.prod(given) != flat.size // width:
        said = " x ".join(map(str, given))
        problem = f"the zone says {said} points, its numbers are {flat.size // width}"
        raise InputError(path, f"line {line}", problem)
    return flat.reshape(-1, width) if packing == "POINT" else flat.reshape(width, -1).T


def _flat(lines: list[str], width: int) -> NDArray[np.float64]:
    """Return all numbers, as they follow each other: rows of one length by pandas' reader."""
    if {len(line.split()) for line in lines} == {width} and not any("," in line for line in lines):
        table = pd.read_csv(
            StringIO("\n".join(lines)),
            sep=r"\s+",
            header=None,
            dtype=float,
            keep_default_na=False,
            na_values=["nan", "NaN", "NAN"],
        )
        return table.to_numpy().ravel()
    return np.array(" ".join(lines).replace(",", " ").split(), dtype=float)


def _with_vectors(headings: list[Heading]) -> list[Heading]:
    """Return the headings with Vx, Vy, Vz without a unit as displacements, in that of the place."""
    if any(heading.quantity in ("dx", "dy", "dz") for heading in headings):
        return headings
    units = {h.quantity: h.unit for h in headings if h.quantity in (*"xyz",)}
    names = {f"v{axis}": axis for axis in "xyz"}
    return [
        Heading(h.name, units.get(axis, ""), f"d{axis}")
        if not h.unit and (axis := names.get(h.name.strip().casefold(), ""))
        else h
        for h in headings
    ]


def _columns(path: Path, headings: Sequence[Heading], options: FrameOptions) -> dict[str, int]:
    named = dict(options.columns or {})
    flags = {"invalid": options.flag_column, "valid": options.valid_column}
    named |= {key: name for key, name in flags.items() if name is not None}
    found = {}
    there = ", ".join(heading.name for heading in headings)[:300]
    for key, where in columns_of(headings, named).items():
        if key in ("frame", "id"):
            continue
        if len(where) != 1:
            what = f"{named[key]!r} is missing" if not where else "may be one of several"
            problem = f"the variable of {key} {what}; name one with columns. The file has: {there}"
            raise InputError(path, "VARIABLES", problem)
        found[key] = where[0]
    if not {"x", "y", "x deformed"} & {*found}:
        raise InputError(path, "VARIABLES", f"no places are among them; the file has: {there}")
    return found


register_format(Format("tecplot", "frame", "text of Tecplot, as DaVis exports", read, recognises))
