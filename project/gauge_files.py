"""Recognise tables of bubbles without cameras: heights of gauges, profiles, the apex.

What headings do not tell is assumed, with a remark that the written project shows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..readers.machine_tables import MachineTable, TableOptions, read_machine_table
from ..readers.quantities import FILL, WARP, columns_of
from ..readers.tables import NUMBER, parse_number
from ..readers.units import LENGTH_UNITS, PRESSURE_UNITS, split_unit
from ..readers.values_in_files import number_in_name

#: Words of the two directions in names of gauges and of columns of the apex.
DIRECTION_WORDS = {"warp": {*WARP, "md"}, "fill": {*FILL, "td", "cd", "xd"}}
#: Words of curvatures and of strains.
QUANTITY_WORDS = {
    "curvature": {"curvature", "curv", "kappa", "krümmung"},
    "strain": {"strain", "dehnung", "eps", "epsilon"},
}
#: Largest curvature of a table without units that is in 1/mm: bubbles have radii above 10 mm.
LARGEST_CURVATURE = 0.1
#: Letters of a file among which its pressure is looked for.
HEAD = 1000
#: Words of a name; StrainMD has two.
WORD = re.compile(r"[A-ZÄÖÜ]{2,}(?![a-zäöü])|[A-ZÄÖÜ]?[a-zäöü]+|[A-ZÄÖÜ]")
#: A pressure above the numbers of a file: "# p_bar = 0.53", "Pressure (kPa): 52".
PRESSURE = re.compile(
    rf"(?i)\b(?:p|pressure|druck)[\s_(\[]*(mbar|bar|MPa|kPa|hPa|Pa|psi)[\s)\]]*[=:;,]\s*({NUMBER})"
)


@dataclass
class GaugedBubble:
    """A table of a bubble without a camera, as the keys of its section.

    Attributes
    ----------
    section : {"heights", "profiles", "apex"}
        Its section below [bubble.data].
    keys : dict
        Keys of the section that the file tells, or that are assumed.
    remarks : dict of str
        What is assumed, by key.
    is_central : bool
        Whether it holds heights at the centre alone.
    has_pressure : bool
        Whether there is a column of pressure.
    """

    section: str
    keys: dict[str, Any] = field(default_factory=dict)
    remarks: dict[str, str] = field(default_factory=dict)
    is_central: bool = False
    has_pressure: bool = True

    def add_unit(self, key: str, table: MachineTable, columns: Sequence[str], unit: str) -> None:
        """Assume the unit of columns if one of them names none."""
        if not all(table.units[column] for column in columns):
            self.keys[key] = unit
            self.remarks[key] = "assumed, as a heading names no unit"


def read_heights(file: Path) -> GaugedBubble:
    """Recognise a table of pressure and height at one place or several; raise InputError."""
    table = read_machine_table(file, TableOptions(quantities=("pressure",)))
    pressure = table.column("pressure")
    heights = [table.names[i] for i in columns_of(table.names, "height", {})]
    heights = [name for name in heights if name != pressure and not _has_other_unit(table, name)]
    places = [_place_in(name) for name in table.names]
    if any(places):
        named = zip(table.names, places, strict=True)
        heights = [name for name, xy in named if xy or name in heights]
    if not heights:
        raise InputError(file, f"line {table.header}", "no column of heights")
    gauges = GaugedBubble("heights", is_central=len(heights) == 1 and not any(places))
    if not gauges.is_central:
        gauges.keys["places"] = [_place_in(name) or [0.0, 0.0] for name in heights]
        if sum(_place_in(name) is None for name in heights) > 1:  # more than the apex
            gauges.remarks["places"] = "[x along the warp, y along the fill] of each gauge, mm"
        gauges.keys["columns"] = {"height": heights}
    gauges.add_unit("pressure_unit", table, [pressure], "kPa")
    gauges.add_unit("length_unit", table, heights, "mm")
    return gauges


def _has_other_unit(table: MachineTable, name: str) -> bool:
    """Return whether a column has a unit that is none of lengths."""
    return table.units[name] not in ("", *LENGTH_UNITS)


def _place_in(name: str) -> list[float] | None:
    """Return the coordinates (mm) that a column's name tells; None where it tells none."""
    plain, _ = split_unit(name)
    numbers = [parse_number(n) for n in re.findall(NUMBER, plain)]
    words = {word.casefold() for word in WORD.findall(plain)}
    if len(numbers) == 2:
        return numbers
    for axis, direction_words in enumerate(DIRECTION_WORDS.values()):
        if len(numbers) == 1 and words & direction_words:
            return [0.0, numbers[0]] if axis else [numbers[0], 0.0]
    return None


def read_profiles(file: Path) -> GaugedBubble:
    """Recognise heights along lines, at one pressure or several; raise InputError."""
    table = read_machine_table(file, TableOptions(quantities=("coordinate", "height")))
    coordinate, height = table.column("coordinate"), table.column("height")
    pressures = columns_of(table.names, "pressure", {})
    is_numbered = bool(re.search(r"\d", split_unit(coordinate)[0]))  # a gauge, at x 50
    if is_numbered or columns_of(table.names, "load", {}) or coordinate == height:
        raise InputError(file, f"line {table.header}", "no heights along a line")
    profiles = GaugedBubble("profiles", has_pressure=bool(pressures))
    profiles.add_unit("pressure_unit", table, [table.names[i] for i in pressures], "kPa")
    profiles.add_unit("length_unit", table, [coordinate, height], "mm")
    return profiles


def read_apex(file: Path) -> GaugedBubble:
    """Recognise curvature or strain of the apex by pressure; raise InputError."""
    table = read_machine_table(file, TableOptions(quantities=("pressure",)))
    columns: dict[str, str] = {}
    for name in table.names:
        words = [word.casefold() for word in WORD.findall(split_unit(name)[0])]
        for quantity, quantity_words in QUANTITY_WORDS.items():
            for direction, direction_words in DIRECTION_WORDS.items():
                if quantity_words & {*words} and direction_words & {*words}:
                    columns.setdefault(f"{quantity}_{direction}", name)
    if not columns:
        raise InputError(file, f"line {table.header}", "no curvature or strain along warp or fill")
    apex = GaugedBubble("apex", {"columns": columns})
    apex.add_unit("pressure_unit", table, [table.column("pressure")], "kPa")
    curvatures = [name for key, name in columns.items() if key.startswith("curvature")]
    if curvatures:
        apex.keys["curvature_is"] = "curvature"
        apex.remarks["curvature_is"] = '1/R; "half" of it, or the "radius"?'
        largest = max(np.nanmax(np.abs(table.table.numbers(name))) for name in curvatures)
        unit = "1/mm" if largest < LARGEST_CURVATURE else "1/m"
        apex.add_unit("curvature_unit", table, curvatures, unit)
    strains = [name for name in columns.values() if name not in curvatures]
    apex.add_unit("strain_unit", table, strains, "mm/mm")
    return apex


def pressure_of(file: Path) -> float | None:
    """Return the pressure (kPa) in the name or the first lines of a file; None without one."""
    try:
        return 1e3 * number_in_name(file, PRESSURE_UNITS)
    except InputError:
        statement = PRESSURE.search(file.read_bytes()[:HEAD].decode("utf-8", errors="replace"))
    if statement is None:
        return None
    units = {unit.casefold(): size for unit, size in PRESSURE_UNITS.items()}
    return 1e3 * units[statement[1].casefold()] * parse_number(statement[2])
