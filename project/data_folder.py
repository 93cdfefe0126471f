"""Recognise the measured files of a folder, and propose the tests of a project for them.

What headings of bubbles without cameras (heights of gauges, profiles, the apex) do not tell is
assumed, with a remark that the written project shows.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.biaxial.paths import read_biaxial_table
from ..readers.bending import read_bending_curves
from ..readers.curves import (
    DIRECTION_OF_ANGLE,
    DIRECTIONS,
    cut_of,
    direction_named,
    in_order,
    read_load_curves,
)
from ..readers.frames import FrameOptions, read_frames
from ..readers.histories import read_pressure_log
from ..readers.machine_tables import (
    Channel,
    MachineTable,
    TableOptions,
    read_machine_table,
    read_times,
)
from ..readers.quantities import DIRECTION_ALIASES, FILL, WARP, columns_of
from ..readers.tables import NUMBER, UTF_16_MARKS, decimal_mark, parse_number
from ..readers.units import LENGTH_UNITS, PRESSURE_UNITS, TIME_UNITS, split_unit
from ..readers.values_in_files import doubtful_name, number_in_name, values_in_file
from .sections import Settings

#: What files may hold.
FRAMES = "places and displacements of an image correlation"

BIAXIAL = "loads and strains of a biaxial test"

STRIPS = "load curves of strips"

LOG = "a pressure log"

HEIGHTS = "pressures and heights of gauges"

PROFILES = "heights along lines of an inflated sheet"

APEX = "curvature or strain of the apex"

BENDING = "loads and deflections of a bent cylinder"

TIMES = "times of the pictures"

#: Words by which heads of exports name the sizes of a specimen, not those of grips or a coating.
SIZES = {
    "width": (
        r"(?<!grip[ _])(?<!jaw[ _])(?<!clamp[ _])width(?! of (?:the )?(?:grip|jaw|clamp))"
        r"|(?<!backen)breite|largeur(?! des? m)"
    ),
    "gauge_length": r"gau?ge[ _]length|messl[äa]nge|longueur de (?:r[ée]f[ée]rence|mesure)",
    "grip_distance": r"grip[ _](?:distance|separation)|einspannl[äa]nge|entre m(?:ors|[âa]choires)",
    "thickness": r"(?<!coating[ _])thickness|(?<!schichtungs)(?<!schicht)dicke|[ée]paisseur(?! d)",
}

#: Units with which files that name none are looked at; a project asks for theirs.
ASSUMED_UNITS = {STRIPS: "N", LOG: "kPa"}

#: A direction in a name or a head, in small letters: an angle with its unit, or a word.
DIRECTION = re.compile(
    r"\d+(?:[.,]\d+)?(?=[ _]?(?:deg|grad|°)"
    r"(?![a-z]*\.?[ _]?(?:c(?:elsius)?|f(?:ahrenheit)?)(?![^\W_])))|[^\W\d_]+"
)

#: A temperature, whose unit may be "deg" alone.
TEMPERATURE = re.compile(r"temp(?:[eé]rature?)?(?![^\W\d_])[^\n\d]{0,30}\d[\d.,]*")

#: A line of a head that says the direction, in small letters.
LINE_OF_DIRECTION = re.compile(
    r"(?m)^[^\n:;=,\t]*(?:direction|richtung|\bsens\b|orientation)[^\n:;=,\t]*[:;=,\t](.*)"
)

#: Angles of strips, degrees, are multiples of it.
ANGLE_STEP = 7.5

#: Columns by which files of frames may hold their pressure.
PRESSURE_COLUMNS = [Channel(name) for name in "p P pressure Pressure druck Druck".split()]

#: Numbers in names by which files of one test differ, and no angles: of test1_00, Bubble-0003_0,
#: step_2_60.5kPa, warp1 and strip_45deg_2 these are 00, 0003 and 0, 2 and 60.5, 1, and 2.
NUMBERS = re.compile(
    r"(?:(?<![^\W_])|(?=\d+\D*$)|(?=\d{3}))\d+(?:[.,]\d+)?(?!\d|[ _]?(?:deg|grad|°))"
)


ANY_NUMBER = re.compile(r"\d+(?:[.,]\d+)?")


@dataclass(frozen=True, eq=False)
class FileGroup:
    """Files of one folder whose names differ in numbers only.

    Attributes
    ----------
    files : sequence of Path
    role : str
        What they hold, in words; "" where no reader takes the first of them.
    content : object
        What the reader returns for the first file, or its InputError.
    unit : str or None
        Unit of loads or pressures that is assumed, as the files name none.
    names : list of str
        A pattern where it matches these files alone, else their names, in the folder of the data.
    """

    files: Sequence[Path]
    role: str
    content: Any
    unit: str | None
    names: Sequence[str]

    @property
    def file_names(self) -> list[str]:
        """Return the name of each file, in the folder of the data."""
        folder = Path(self.names[0]).parent
        return [(folder / file.name).as_posix() for file in self.files]

    @property
    def line(self) -> str:
        """Return the files and what they are taken for, in words."""
        role = self.role or f"not used: {self.content.problem[:200]}"
        return f"{', '.join(self.names)} ({len(self.files)}): {role}"


#: Words of the two directions in names of gauges and of columns of the apex.
DIRECTION_WORDS = {"warp": {*WARP, "md"}, "fill": {*FILL, "td", "cd", "xd"}}

#: Words of curvatures and of strains.
QUANTITY_WORDS = {
    "curvature": {"curvature", "curv", "kappa", "krümmung", "krümmungsradius"},
    "strain": {"strain", "dehnung", "eps", "epsilon"},
}

#: Words of curvatures that are radii.
RADIUS_WORDS = {"radius", "krümmungsradius"}

#: Largest curvature of a table without units that is in 1/mm: bubbles have radii above 10 mm.
LARGEST_CURVATURE = 0.1

#: Words of a name; StrainMD has two.
WORD = re.compile(r"[A-ZÄÖÜ]{2,}(?![a-zäöü])|[A-ZÄÖÜ]?[a-zäöü]+|[A-ZÄÖÜ]")

#: Two coordinates; of "Laser 1 at 50" and "z1 50" the first number is that of the gauge.
COORDINATES = re.compile(rf"(?<![\w.,]){NUMBER}[\s/;|]+{NUMBER}")

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

    def settle_decimal(self, table: MachineTable, columns: Sequence[str]) -> str:
        """Make the decimal mark of columns a key if it has to be assumed, and return it.

        Commas are assumed to be decimal ones where all of them may mark thousands as well.
        """
        texts = table.table
        cells = [
            (line, name, cell)
            for name in columns
            for line, cell in zip(texts.lines.tolist(), texts.text(name), strict=True)
        ]
        try:
            return decimal_mark(texts.path, cells)
        except InputError:
            self.remarks["decimal"] = 'assumed; or "." if commas mark thousands'
            return self.keys.setdefault("decimal", ",")


def _machine_table(file: Path, *quantities: str) -> MachineTable:
    """Read a table; commas that may mark thousands as well are taken for decimal ones."""
    try:
        return read_machine_table(file, TableOptions(quantities=quantities))
    except InputError:
        return read_machine_table(file, TableOptions(quantities=quantities, decimal=","))


def read_heights(file: Path) -> GaugedBubble:
    """Recognise a table of pressure and height at one place or several; raise InputError."""
    table = _machine_table(file, "pressure")
    pressure = table.column("pressure")
    heights = _columns_of_heights(table, pressure)
    if not heights:
        raise InputError(file, f"line {table.header}", "no column of heights")
    has_places = any(map(_place_in, table.names))
    gauges = GaugedBubble("heights", is_central=len(heights) == 1 and not has_places)
    if not gauges.is_central:
        gauges.keys["places"] = [_place_in(name) or [0.0, 0.0] for name in heights]
        if sum(_place_in(name) is None for name in heights) > 1:  # more than the apex
            gauges.remarks["places"] = "[x along the warp, y along the fill] of each gauge, mm"
        gauges.keys["columns"] = {"height": heights}
    gauges.add_unit("pressure_unit", table, [pressure], "kPa")
    gauges.add_unit("length_unit", table, heights, "mm")
    gauges.settle_decimal(table, [pressure, *heights])
    return gauges


def _columns_of_heights(table: MachineTable, pressure: str) -> list[str]:
    """Return the columns whose name says height or, at any place, a position."""
    is_height = {table.names[i] for i in columns_of(table.names, "height", {})}
    return [
        name
        for name in table.names
        if _place_in(name)
        or (name in is_height and name != pressure and not _has_other_unit(table, name))
    ]


def _has_other_unit(table: MachineTable, name: str) -> bool:
    """Return whether a column has a unit that is none of lengths."""
    return table.units[name] not in ("", *LENGTH_UNITS)


def _place_in(name: str) -> list[float] | None:
    """Return the coordinates (mm) that a column's name tells; None where it tells none."""
    plain, _ = split_unit(name)
    numbers = [parse_number(n) for n in re.findall(NUMBER, plain)]
    words = {word.casefold() for word in WORD.findall(plain)}
    axes = [axis for axis, known in enumerate(DIRECTION_WORDS.values()) if words & known]
    if len(axes) == 1 and numbers:  # a number before is that of the gauge
        return [0.0, numbers[-1]] if axes[0] else [numbers[-1], 0.0]
    is_pair = len(axes) == 2 or COORDINATES.search(plain)
    return numbers if len(numbers) == 2 and is_pair else None


def read_profiles(file: Path) -> GaugedBubble:
    """Recognise heights along lines, at one pressure or several; raise InputError."""
    table = _machine_table(file, "coordinate", "height")
    coordinate, height = table.column("coordinate"), table.column("height")
    pressures = columns_of(table.names, "pressure", {})
    is_numbered = bool(re.search(r"\d", split_unit(coordinate)[0]))  # a gauge, at x 50
    if is_numbered or columns_of(table.names, "load", {}) or coordinate == height:
        raise InputError(file, f"line {table.header}", "no heights along a line")
    profiles = GaugedBubble("profiles", has_pressure=bool(pressures))
    profiles.add_unit("pressure_unit", table, [table.names[i] for i in pressures], "kPa")
    profiles.add_unit("length_unit", table, [coordinate, height], "mm")
    profiles.settle_decimal(table, [coordinate, height, *(table.names[i] for i in pressures)])
    return profiles


def read_apex(file: Path) -> GaugedBubble:
    """Recognise curvature or strain of the apex by pressure; raise InputError."""
    table = _machine_table(file, "pressure")
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
    pressure = table.column("pressure")
    decimal = apex.settle_decimal(table, [pressure, *columns.values()])
    table = replace(table, table=replace(table.table, decimal=decimal))
    apex.add_unit("pressure_unit", table, [pressure], "kPa")
    curvatures = [name for key, name in columns.items() if key.startswith("curvature")]
    if curvatures:
        _add_curvatures(apex, table, curvatures)
    strains = [name for name in columns.values() if name not in curvatures]
    apex.add_unit("strain_unit", table, strains, "mm/mm")
    return apex


def _add_curvatures(apex: GaugedBubble, table: MachineTable, columns: Sequence[str]) -> None:
    """Add what columns of curvatures hold, and their unit; those in a length are radii."""
    words = {word.casefold() for name in columns for word in WORD.findall(name)}
    largest = max(np.nanmax(np.abs(table.table.numbers(name))) for name in columns)
    if RADIUS_WORDS & words or any(table.units[name] in LENGTH_UNITS for name in columns):
        apex.keys["curvature_is"] = "radius"
        unit = "mm" if largest > 1 / LARGEST_CURVATURE else "m"
    else:
        apex.keys["curvature_is"] = "curvature"
        apex.remarks["curvature_is"] = '1/R; "half" of it, or the "radius"?'
        unit = "1/mm" if largest < LARGEST_CURVATURE else "1/m"
    apex.add_unit("curvature_unit", table, columns, unit)


def pressure_in_name(file: Path) -> float | None:
    """Return the pressure (kPa) in the name of a file; None without one."""
    try:
        return 1e3 * number_in_name(file, PRESSURE_UNITS)
    except InputError:
        return None


def pressure_of(file: Path) -> float | None:
    """Return the pressure (kPa) in the name or the first lines of a file; None without one."""
    pressure = pressure_in_name(file)
    statement = PRESSURE.search(_head(file)[:1000])
    if pressure is not None or statement is None:
        return pressure
    units = {unit.casefold(): size for unit, size in PRESSURE_UNITS.items()}
    return 1e3 * units[statement[1].casefold()] * parse_number(statement[2])


def _frames(file: Path) -> Any:
    """Read the frames of a file, with or without heights at rest."""
    try:
        return read_frames([file])
    except InputError:
        return read_frames([file], FrameOptions(("x", "y", "dx", "dy", "dz")))


def _load_curves(file: Path, unit: Any) -> Any:
    """Read the load curves of a file; sizes of the strips do not matter here."""
    sizes = {"width": 1.0, "gauge_length": dict.fromkeys(DIRECTIONS, 1.0), "load_unit": unit}
    try:
        return read_load_curves(file, **sizes)
    except InputError:  # no column says the direction
        return read_load_curves(file, direction="warp", **sizes)


#: What files may hold: the first reader that takes a file says what it is.
READERS: Mapping[str, Callable[[Path, str | None], Any]] = {
    FRAMES: lambda file, _: _frames(file),
    APEX: lambda file, _: read_apex(file),
    BIAXIAL: lambda file, _: read_biaxial_table(file, width=1.0),
    STRIPS: _load_curves,
    PROFILES: lambda file, _: read_profiles(file),
    HEIGHTS: lambda file, _: read_heights(file),
    LOG: lambda file, unit: read_pressure_log(file, Channel(unit=unit)),
    BENDING: lambda file, _: read_bending_curves(file),
    TIMES: lambda file, _: read_times(file),
}


def recognised_groups(data: Path) -> list[FileGroup]:
    """Return the files of a folder and its subfolders in groups, with what each holds."""
    groups: dict[Path, list[Path]] = {}
    for file in sorted(data.rglob("*")):
        if file.is_file() and file.name[0] != ".":
            pattern = NUMBERS.sub("*", file.stem) + file.suffix
            groups.setdefault(file.with_name(pattern), []).append(file)
    return _with_joint_frames(
        [_recognised(files, pattern, data) for pattern, files in groups.items()], data
    )


def _with_joint_frames(groups: Sequence[FileGroup], data: Path) -> list[FileGroup]:
    """Return groups with frames that stand alone by their counters, as Bild1_50kPa, in one.

    They are of one test as their pressures differ.
    """
    alone: dict[Path, list[FileGroup]] = {}
    for group in groups:
        file = group.files[0]
        if group.role == FRAMES and len(group.files) == 1 and pressure_in_name(file) is not None:
            pattern = file.with_name(ANY_NUMBER.sub("*", file.stem) + file.suffix)
            alone.setdefault(pattern, []).append(group)
    joint_groups = [*groups]
    for pattern, members in alone.items():
        files = [group.files[0] for group in members]
        if len({*map(pressure_in_name, files)}) == len(files) > 1:
            joint_groups[joint_groups.index(members[0])] = _recognised(files, pattern, data)
            joint_groups = [group for group in joint_groups if group not in members]
    return joint_groups


def _recognised(files: Sequence[Path], pattern: Path, data: Path) -> FileGroup:
    """Return a group of files with the first role whose reader takes the first of them."""
    is_pattern = len(list(pattern.parent.glob(pattern.name))) == len(files) > 1
    names = [path.relative_to(data).as_posix() for path in ([pattern] if is_pattern else files)]
    problem = InputError(files[0], "", "no reader takes it")
    for role, read in READERS.items():
        for unit in dict.fromkeys([None, ASSUMED_UNITS.get(role)]):
            try:
                return FileGroup(files, role, read(files[0], unit), unit, names)
            except InputError as error:
                problem = error if role == STRIPS else problem
    return FileGroup(files, "", problem, None, names)


#: Name of a file in the folder of the data, and the unit that is assumed as it names none.
FileWithUnit = tuple[str, str | None]


def proposed_tests(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the tests for which there are files, as values of the templates of their kinds.

    "sizes" of a test are those that its files do not tell, "in_heads" those that they do.
    """
    of_role = {role: [group for group in groups if group.role == role] for role in READERS}
    tests = []
    logs, times = _files_with_units(of_role[LOG]), _files_with_units(of_role[TIMES])
    for number, group in enumerate(of_role[FRAMES]):
        # The log of the same number, or the last one where there are fewer.
        tests.append(_bubble(group, logs[: number + 1][-1:], times[: number + 1][-1:]))
    tests += _gauge_bubbles([g for role in (HEIGHTS, PROFILES, APEX) for g in of_role[role]])
    tests += _strips(of_role[STRIPS])
    bent = {"kind": "cylinder", "sizes": ["diameter", "pressure"]}
    tests += [{"kind": "biaxial", "files": group.names, "sizes": []} for group in of_role[BIAXIAL]]
    return [*tests, *({**bent, "files": group.names} for group in of_role[BENDING])]


def _files_with_units(groups: Sequence[FileGroup]) -> list[FileWithUnit]:
    """Return the files of all groups, by name in the folder of the data, with the assumed units."""
    return [(name, group.unit) for group in groups for name in group.file_names]


def _bubble(
    group: FileGroup, logs: Sequence[FileWithUnit], times: Sequence[FileWithUnit]
) -> Settings:
    """Return the values of a bubble, with at most one log and one table of times."""
    first = group.files[0]
    frame = group.content[0]
    points = np.nan_to_num(frame.points[np.isfinite(frame.points[:, :2]).all(axis=1)])
    off_centre = np.abs(points.max(axis=0) + points.min(axis=0)) / 2
    is_named = _can(number_in_name, first, PRESSURE_UNITS)
    is_timed = _can(number_in_name, first, TIME_UNITS)
    columns = [c for c in PRESSURE_COLUMNS if _can(values_in_file, first, c, PRESSURE_UNITS)]
    is_in_frames = bool(is_named or columns)
    if is_in_frames:
        logs = []
    sizes = ["radius"]
    if not (is_in_frames or logs):
        sizes.append("pressures")
    elif logs and not (times or is_timed):
        sizes.append("rate")
    sizes += ["pressure_unit" for _, unit in logs if unit]
    return {
        "kind": "bubble",
        "files": group.names,
        "count_of_files": len(group.files),
        "columns": {} if "z" in frame.source.columns else frame.source.columns,
        "in_camera_axes": bool((off_centre > 0.05 * np.ptp(points)).any()),
        "is_named": is_named,
        "column": columns[0].column if columns else None,
        "logs": logs,
        "times": times,
        "is_timed": is_timed,
        "sizes": sizes,
    }


def _can(read: Callable[..., Any], *arguments: Any) -> bool:
    """Return whether a reader takes its arguments."""
    try:
        read(*arguments)
    except InputError:
        return False
    return True


def _gauge_bubbles(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the values of bubbles without cameras; tables that differ in files are one test's."""
    tests: list[Settings] = []
    for group in groups:
        table: GaugedBubble = group.content
        test = next((t for t in tests if table in t["tables"].get(table.section, [table])), None)
        if test is None:
            test = {"kind": "bubble", "template": "gauges", "sizes": ["radius"], "tables": {}}
            tests.append(test)
        test["tables"].setdefault(table.section, []).append(table)
        test.setdefault("files", {}).setdefault(table.section, []).extend(group.names)
        if not table.has_pressure:
            pressures = _pressures_of_files(group.files)
            # Those of all lines are the same.
            is_told = test.pop("pressures", pressures) == pressures is not None
            test |= {"pressures": pressures} if is_told else {"sizes": ["radius", "pressures"]}
            test["count_of_files"] = len(group.files)
        test["is_central"] = table.is_central and test.get("is_central", True)
    return tests


def _pressures_of_files(files: Sequence[Path]) -> list[float] | None:
    """Return the pressures (kPa) that files name; None where one names none, or is not clear."""
    pressures = [pressure for file in files if (pressure := pressure_of(file)) is not None]
    is_clear = len(pressures) == len(files) and doubtful_name(files, PRESSURE_UNITS) is None
    return pressures if is_clear else None


def _strips(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the values of one test of all strips; none where no direction is known."""
    files: dict[str, list[str]] = {}
    sizes_in_heads: dict[str, set[float]] = {}
    by_angle = False
    for group in groups:
        for file in group.files:
            for size, value in _sizes_in_head(file).items():
                sizes_in_heads.setdefault(size, set()).add(value)
        files_by_direction, is_by_angle = _files_by_direction(group)
        for direction, names in files_by_direction.items():
            files.setdefault(direction, []).extend(names)
            by_angle |= is_by_angle and direction not in ("", "bias")
    unknown = files.pop("", [])
    if not files:
        return []
    # A size that differs between strips stays open: one number would be wrong for some of them.
    in_heads = {size: min(values) for size, values in sizes_in_heads.items() if len(values) == 1}
    values: Settings = {"kind": "strips", "unknown": unknown, "in_heads": in_heads}
    values |= {"by_angle": by_angle, **strips_by_direction(files)}
    sizes = ["width", "gauge_length", *["grip_distance"] * ("bias" in values["cuts"])]
    values["sizes"] = [*sizes, *["load_unit"] * (groups[0].unit is not None)]
    return [values]


def strips_by_direction(files: Mapping[str, Sequence[str]]) -> Settings:
    """Return the values of strips that name their files: by direction, or by angle if need be.

    Parameters
    ----------
    files : mapping of str to sequence of str
        Names by direction: "warp", "fill", "bias", or an angle such as "15 degrees".
    """
    directions = in_order(files)
    cuts = list(dict.fromkeys(map(cut_of, directions)))
    angles = {}
    if not {*directions} <= {*DIRECTIONS}:
        angles = {f"{angle_of(d):g}": files[d] for d in sorted(directions, key=angle_of)}
    return {"files": {d: files[d] for d in directions}, "cuts": cuts, "angles": angles}


def angle_of(direction: str) -> float:
    """Return the degrees from the warp of "warp", "fill", "bias", or of "15 degrees"."""
    angles = {name: angle for angle, name in DIRECTION_OF_ANGLE.items()}
    return angles[direction] if direction in angles else float(direction.partition(" ")[0])


def _files_by_direction(group: FileGroup) -> tuple[dict[str, list[str]], bool]:
    """Return the names of a group's files by the direction of the strips, "" if none is known.

    The second value says whether it is known from angles.
    """
    in_columns = {curve.direction: [*group.names] for curve in group.content}
    if len(in_columns) > 1:
        return in_columns, False
    words = [word for word in map(_direction_word, group.files) if word]
    directions = _directions_by_words(group.files) if words else _directions_by_numbers(group.files)
    by_direction: dict[str, list[str]] = {}
    for name, direction in zip(group.file_names, directions, strict=True):
        by_direction.setdefault(direction, []).append(name)
    if len(by_direction) == 1:
        by_direction = {directions[0]: [*group.names]}
    return by_direction, not words or not all(map(str.isalpha, words))


def _directions_by_words(files: Sequence[Path]) -> list[str]:
    """Return the direction of each file that a word or an angle with its unit says, or ""."""
    directions = []
    for word in map(_direction_word, files):
        name = word if word.isalpha() else f"{word} deg"
        directions.append(direction_named(name) if word else "")
    return directions


def _directions_by_numbers(files: Sequence[Path]) -> list[str]:
    """Return the direction of each file by the angle in its name, or ""."""
    angles = _angles_in_names(files)
    return ["" if angle is None else direction_named(angle) for angle in angles]


def _angles_in_names(files: Sequence[Path]) -> Sequence[float | None]:
    """Return the angles of strip_0_1, strip_15_1 ...: numbers of names that all can be angles."""
    rows = [[float(number) for number in re.findall(r"\d+", file.stem)] for file in files]
    for numbers in zip(*rows, strict=False):
        angles = {*numbers}
        if len(angles) > 1 and max(angles) <= 90 and not any(a % ANGLE_STEP for a in angles):
            return numbers
    return [None] * len(files)


def _direction_word(file: Path) -> str:
    """Return the first word or angle for a direction, or "".

    A line of the head that says the direction counts before the file's name, its folder and the
    other lines.
    """
    head = _head(file).casefold()
    text = f"{file.stem} {file.parent.name}".casefold()
    text = "\n".join([*LINE_OF_DIRECTION.findall(head), text, head])
    for word in DIRECTION.findall(TEMPERATURE.sub("", text)):
        is_angle = word[0].isdigit() and parse_number(word) <= 90
        if is_angle or word in DIRECTION_ALIASES:
            return word.replace(",", ".")
    return ""


def _sizes_in_head(file: Path) -> dict[str, float]:
    """Return the sizes (mm) of a specimen, by the keys of `SIZES`, that the head names."""
    sizes = {}
    for size, words in SIZES.items():
        statement = rf"(?i)(?:{words})[^\n]{{0,30}}?[\s;:=,\"]({NUMBER})[\s;,\"]*(mm|cm|in)\b"
        statement += r"(?!\s*(?:/|per|pro|par))"  # no speed
        if (match := re.search(statement, _head(file))) is not None:
            sizes[size] = parse_number(match[1]) * LENGTH_UNITS[match[2]]
    return sizes


def _head(file: Path) -> str:
    """Return the beginning of a file as text, whatever its encoding."""
    with file.open("rb") as stream:
        content = stream.read(4000)
    encoding = "utf-16" if content.startswith(UTF_16_MARKS) else "utf-8"
    try:  # the last letter may be cut
        return codecs.getincrementaldecoder(encoding)().decode(content)
    except UnicodeDecodeError:
        return content.decode("latin-1")
