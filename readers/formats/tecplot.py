"""Tecplot's text files (.dat), as LaVision DaVis and others export them: a frame a zone.

    VARIABLES = "x[mm]" "y[mm]" "z[mm]" "Vx[mm]" "Vy[mm]" "Vz[mm]" "isValid"

Source: a public reader of DaVis' snapshots (`DATAPACKING = POINT`) and Tecplot's format guide:
POINT (a row a point) or BLOCK (a variable after the other). Vx, Vy, Vz are inferred to be
displacements where their unit is a length. Finite elements' zones are refused.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..quantities import Heading, columns_by_quantity, heading_of
from ..registry import Format, register_format
from ..tables import Cells, Lines, is_number, read_lines

_VARIABLES = re.compile(rb"^[ \t]*+VARIABLES[ \t]*+=", re.IGNORECASE | re.MULTILINE)
_SECTION = re.compile(r"^\s*(TITLE|VARIABLES|ZONE|DATASETAUXDATA|TEXT|GEOMETRY)\b", re.IGNORECASE)
_KEY = re.compile(r'\b([A-Z]+)\s*=\s*("[^"]*"|\([^)]*\)|[^\s,"(]+)', re.IGNORECASE)
_NUMBERS = re.compile(r"^(?:[\s\d+\-.,e]|nan)*$", re.IGNORECASE)
FLAGS = ("valid", "invalid", "sigma")


@dataclass(frozen=True)
class Zone:
    """A zone: its line, its keys in capitals, and the lines of its numbers."""

    line: int
    keys: dict[str, str] = field(default_factory=dict)
    numbers: Lines = field(default_factory=list)


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a line lists variables."""
    return bool(_VARIABLES.search(head[:16384]))


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the frames of a file, one a zone."""
    names, zones = _read_zones(path)
    headings = _with_vectors([heading_of(name) for name in names])
    columns = _single_columns(path, headings, options)
    heading_by_key = {key: headings[i] for key, i in columns.items() if key not in FLAGS}
    frames = []
    for zone in zones:
        table = _zone_numbers(path, zone, len(names))
        values = {key: table[:, i] for key, i in columns.items()}
        valid, invalid, sigma = (values.pop(key, None) for key in FLAGS)
        good = np.ones(len(table), dtype=bool)
        if valid is not None:
            good &= valid != 0
        if invalid is not None:
            good &= invalid == 0
        rows = FrameRows(
            values,
            names={key: heading.name for key, heading in heading_by_key.items()},
            units={key: heading.unit for key, heading in heading_by_key.items()},
            valid=good,
            sigma=sigma,
        )
        frames.append(frame_of(rows, options, path, "tecplot"))
    return frames


def _read_zones(path: Path) -> tuple[Cells, list[Zone]]:
    """Return the names of the variables, and the zones."""
    names: Cells = []
    zones: list[Zone] = []
    section = ""
    for number, text in read_lines(path, "#", any_encoding=True):
        start = _SECTION.match(text)
        if start:
            section = start[1].upper()
            text = text[start.end() :]
            if section == "ZONE":
                zones.append(Zone(number))
        if section == "VARIABLES":
            words = re.findall(r'"([^"]*)"|([^\s,="]+)', text)
            names += [quoted or plain for quoted, plain in words]
        elif section == "ZONE":
            _add_line(path, zones[-1], number, text, bool(start))
    if not names or not zones:
        missing = "ZONE" if names else "VARIABLES"
        problem = f"expected VARIABLES and a ZONE, found no {missing}"
        raise InputError(path, "", problem)
    return [name.strip() for name in names], zones


def _add_line(
    path: Path,
    zone: Zone,
    number: int,
    text: str,
    is_first: bool,
) -> None:
    """Add a line of numbers, or of keys, to a zone."""
    if _NUMBERS.match(text):
        zone.numbers.append((number, text))
        return
    keys = {key.upper(): value for key, value in _KEY.findall(text)}
    if not is_first and (zone.numbers or not keys):
        raise InputError(path, f"line {number}", f"expected numbers, found {text[:40]!r}")
    zone.keys.update(keys)


def _zone_numbers(path: Path, zone: Zone, width: int) -> NDArray[np.float64]:
    """Return the numbers of a zone, (points, variables)."""
    line = f"line {zone.line}"
    keys = zone.keys
    packing = keys.get("DATAPACKING", keys.get("F", "POINT")).upper()
    zone_type = keys.get("ZONETYPE", "")
    if packing not in ("POINT", "BLOCK") or "FE" in zone_type.upper():
        kind = f"{packing} {zone_type}".strip()[:40]
        problem = f"a zone of points as POINT or BLOCK is needed, this is {kind!r}"
        raise InputError(path, line, problem)
    try:
        flat = _parse_numbers([text for _, text in zone.numbers], width)
    except ValueError:
        raise _no_number(path, zone) from None
    if not flat.size or flat.size % width:
        problem = f"expected {width} numbers a point, found {flat.size} numbers in the zone"
        raise InputError(path, line, problem)
    shape = [int(keys[key][:9]) for key in "IJK" if keys.get(key, "").isdecimal()]
    if shape and math.prod(shape) != flat.size // width:
        size = " x ".join(map(str, shape))
        problem = f"the zone says {size} points, its numbers are {flat.size // width}"
        raise InputError(path, line, problem)
    return flat.reshape(-1, width) if packing == "POINT" else flat.reshape(width, -1).T


def _no_number(path: Path, zone: Zone) -> InputError:
    """Return the error of the first word in a zone that is no number."""
    for number, text in zone.numbers:
        for word in text.replace(",", " ").split():
            if not is_number(word) and word.casefold() != "nan":
                return InputError(path, f"line {number}", f"expected a number, found {word[:40]!r}")
    return InputError(path, f"line {zone.line}", "expected a number, found 'nothing else'")


def _parse_numbers(lines: list[str], width: int) -> NDArray[np.float64]:
    """Return all numbers, as they follow each other: rows of one length by pandas' reader."""
    if {len(line.split()) for line in lines} != {width} or any("," in line for line in lines):
        return np.array(" ".join(lines).replace(",", " ").split(), dtype=float)
    table = pd.read_csv(
        StringIO("\n".join(lines)),
        sep=r"\s+",
        header=None,
        dtype=float,
        keep_default_na=False,
        na_values=["nan", "NaN", "NAN"],
    )
    return table.to_numpy().ravel()


def _with_vectors(headings: list[Heading]) -> list[Heading]:
    """Return the headings; Vx, Vy, Vz without a unit as displacements, in the unit of positions."""
    if any(heading.quantity in ("dx", "dy", "dz") for heading in headings):
        return headings
    units = {h.quantity: h.unit for h in headings if h.quantity in ("x", "y", "z")}
    converted = []
    for heading in headings:
        name = heading.name.strip().casefold()
        if name in ("vx", "vy", "vz") and not heading.unit:
            heading = Heading(heading.name, units.get(name[1], ""), f"d{name[1]}")
        converted.append(heading)
    return converted


def _single_columns(
    path: Path, headings: Sequence[Heading], options: FrameOptions
) -> dict[str, int]:
    """Return the column of each quantity and flag."""
    named = dict(options.columns or {})
    if options.flag_column is not None:
        named["invalid"] = options.flag_column
    if options.valid_column is not None:
        named["valid"] = options.valid_column
    columns = {}
    names = ", ".join(heading.name for heading in headings)[:300]
    for key, candidates in columns_by_quantity(headings, named).items():
        if key in ("frame", "id"):
            continue
        if len(candidates) != 1:
            state = "may be one of several" if candidates else f"{named[key]!r} is missing"
            problem = f"the variable of {key} {state}; name one with columns. The file has: {names}"
            raise InputError(path, "VARIABLES", problem)
        columns[key] = candidates[0]
    if not {"x", "y", "x deformed"} & {*columns}:
        raise InputError(path, "VARIABLES", f"no places are among them; the file has: {names}")
    return columns


register_format(Format("tecplot", "frame", "text of Tecplot, as DaVis exports", read, recognises))
