"""Recognise the measured files of a folder, and propose the tests of a project for them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.biaxial.tables import read_biaxial_table
from ..readers.bending import read_bending_curves
from ..readers.curves import DIRECTIONS, read_load_curves
from ..readers.frames import FrameOptions, read_frames
from ..readers.machine_tables import Channel, read_times
from ..readers.numbers_in_names import number_in_name
from ..readers.numerals import NUMBER, parse_number
from ..readers.pressure_log import read_pressure_log
from ..readers.quantities import DIRECTION_ALIASES
from ..readers.units import LENGTH_UNITS, PRESSURE_UNITS, TIME_UNITS
from ..readers.values_in_files import values_in_file
from .written import Settings

#: What files may hold.
FRAMES = "places and displacements of an image correlation"
BIAXIAL = "loads and strains of a biaxial test"
STRIPS = "load curves of strips"
LOG = "a pressure log"
BENDING = "loads and deflections of a bent cylinder"
TIMES = "times of the pictures"
#: Words by which heads of exports name the sizes of a specimen.
SIZES = {
    "width": r"width|breite",
    "gauge_length": r"gau?ge[ _]length|messl[äa]nge",
    "grip_distance": r"grip[ _](?:distance|separation)|einspannl[äa]nge",
    "thickness": r"thickness|dicke",
}
#: Letters of a file among which its head is looked for.
HEAD = 4000
#: Units that are assumed, with a remark, where files name none.
ASSUMED_UNITS = {STRIPS: "N", LOG: "kPa"}
#: Directions of strips by the angle to the warp, where the names of all strips hold angles.
ANGLES = {"0": "warp", "90": "fill", "45": "bias"}
#: Names by which files of frames may hold their pressure.
PRESSURE_NAMES = ("p", "P", "pressure", "Pressure", "druck", "Druck")


@dataclass(frozen=True, eq=False)
class FileGroup:
    """Files of one folder whose names differ in numbers only.

    Attributes
    ----------
    files : tuple of Path
        In the order of these numbers.
    role : str
        What they hold, in words; "" where no reader takes the first of them.
    content : object
        What the reader returns for the first file, or its InputError.
    unit : str or None
        Unit of loads or pressures that is assumed, as the files name none.
    names : list of str
        A pattern where it matches these files alone, else their names, in the folder of the data.
    """

    files: tuple[Path, ...]
    role: str
    content: Any
    unit: str | None
    names: Sequence[str]

    @property
    def line(self) -> str:
        """Return the files and what they are taken for, in words."""
        role = self.role or f"not used: {self.content.problem[:200]}"
        return f"{', '.join(self.names)} ({len(self.files)}): {role}"


def _frames(file: Path) -> Any:
    """Read the frames of a file, with or without heights at rest."""
    try:
        return read_frames([file])
    except InputError:
        return read_frames([file], FrameOptions(("x", "y", "dx", "dy", "dz")))


def _load_curves(file: Path, unit: Any) -> Any:
    """Read the load curves of a file; sizes of the strips do not matter here."""
    sizes: Any = {"width": 1.0, "gauge_length": dict.fromkeys(DIRECTIONS, 1.0), "load_unit": unit}
    try:
        return read_load_curves(file, **sizes)
    except InputError:  # no column says the direction
        return read_load_curves(file, direction="warp", **sizes)


#: What files may hold: the first reader that takes a file says what it is.
READERS: Mapping[str, Callable[[Path, str | None], Any]] = {
    FRAMES: lambda file, _: _frames(file),
    BIAXIAL: lambda file, _: read_biaxial_table(file, width=1.0),
    STRIPS: _load_curves,
    LOG: lambda file, unit: read_pressure_log(file, Channel(unit=unit)),
    BENDING: lambda file, _: read_bending_curves(file),
    TIMES: lambda file, _: read_times(file),
}


def recognised_groups(data: Path) -> list[FileGroup]:
    """Return the files of a folder and its subfolders in groups, with what each holds."""
    files = [file for file in data.rglob("*") if file.is_file() and file.name[0] != "."]
    # test1_00.csv, test1_01.csv ... are of a test; step_1_20kPa.csv, step_2_60kPa.csv ... too.
    series = [(file.parent, re.sub(r"\d+(?=\D*$)", "#", file.name)) for file in files]
    counts = Counter(series)
    groups: dict[tuple[Path, str], list[Path]] = {}
    for file, (folder, name) in zip(files, series, strict=True):
        if counts[folder, name] < 3:
            name = re.sub(r"\d+", "#", name)
        groups.setdefault((folder, name), []).append(file)
    return [_recognised(sorted(groups[key], key=_numbers), data) for key in sorted(groups)]


def _numbers(file: Path) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", file.name)]


def _recognised(files: Sequence[Path], data: Path) -> FileGroup:
    """Return a group of files with the first role whose reader takes the first of them."""
    texts = zip(*(re.split(r"(\d+)", file.name) for file in files), strict=True)
    pattern = "".join(text if {text, *others} == {text} else "*" for text, *others in texts)
    names = [file.relative_to(data).as_posix() for file in files]
    if len(list(files[0].parent.glob(pattern))) == len(files) > 1:
        names = [(files[0].parent / pattern).relative_to(data).as_posix()]
    problem = InputError(files[0], "", "no reader takes it")
    for role, read in READERS.items():
        for unit in dict.fromkeys([None, ASSUMED_UNITS.get(role)]):
            try:
                return FileGroup(tuple(files), role, read(files[0], unit), unit, names)
            except InputError as error:
                problem = error if role == STRIPS else problem
    return FileGroup(tuple(files), "", problem, None, names)


def proposed_tests(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the tests for which there are files, as values of the templates of their kinds.

    "sizes" of a test are those that its files do not tell, "in_heads" those that they do.
    """
    of_role = {role: [group for group in groups if group.role == role] for role in READERS}
    tests = [
        _bubble(group, of_role[LOG][: number + 1], of_role[TIMES][: number + 1])
        for number, group in enumerate(of_role[FRAMES])
    ]
    tests += _strips(of_role[STRIPS])
    bent = {"kind": "cylinder", "sizes": ["diameter", "pressure"]}
    tests += [{"kind": "biaxial", "files": group.names, "sizes": []} for group in of_role[BIAXIAL]]
    return [*tests, *({**bent, "files": group.names} for group in of_role[BENDING])]


def _bubble(group: FileGroup, logs: Sequence[FileGroup], times: Sequence[FileGroup]) -> Settings:
    """Return the values of a bubble; of several logs, and tables of times, the last is its."""
    frame = group.content[0]
    points = frame.points[np.isfinite(frame.points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    values: Settings = {
        "kind": "bubble",
        "files": group.names,
        "columns": {} if "z" in frame.source.columns else frame.source.columns,
        "in_camera_axes": bool((np.abs(high + low) > 0.1 * np.ptp(points)).any()),
        "count_of_files": len(group.files),
        "sizes": ["radius"],
        "source": "list",
    }
    if _all_named(group, PRESSURE_UNITS):
        values["source"] = "names"
    elif logs:
        values |= {"source": "log", "log": logs[-1].names[0], "unit": logs[-1].unit}
        values["times"] = times[-1].names[0] if times else None
        values["time_in_name"] = _all_named(group, TIME_UNITS)
        values["sizes"] += [] if times or values["time_in_name"] else ["rate"]
    elif columns := [name for name in PRESSURE_NAMES if _holds_pressure(group.files[0], name)]:
        values |= {"source": "column", "column": columns[0]}
    else:
        values["sizes"] += ["pressures"]
    return values


def _all_named(group: FileGroup, units: Mapping[str, float]) -> bool:
    """Return whether the name of each file holds one number with a unit."""
    try:
        return all(number_in_name(file, units) >= 0 for file in group.files)
    except InputError:
        return False


def _holds_pressure(file: Path, name: str) -> bool:
    try:
        return len(values_in_file(file, Channel(name), PRESSURE_UNITS)) > 0
    except InputError:
        return False


def _strips(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the values of one test of all strips; none where no direction is known."""
    by_angle = any("90" in re.findall(r"\d+", name) for group in groups for name in group.names)
    files: dict[str, list[str]] = {}
    in_heads: dict[str, float] = {}
    for group in groups:
        in_heads = {**_sizes_in_head(group.files[0]), **in_heads}
        for direction in _directions_of(group, by_angle):
            files.setdefault(direction, []).extend(group.names)
    unknown = files.pop("", [])
    sizes = ["width", "gauge_length", *["grip_distance"] * ("bias" in files)]
    values = {"kind": "strips", "files": files, "unknown": unknown, "sizes": sizes}
    return [{**values, "in_heads": in_heads, "unit": groups[0].unit}] if files else []


def _directions_of(group: FileGroup, by_angle: bool) -> list[str]:
    """Return the directions of strips by the file's column, its name, folder or head; [""] if none.

    by_angle : whether numbers in names are angles to the warp
    """
    if len(group.content) > 1:
        return list(dict.fromkeys(curve.direction for curve in group.content))
    file = group.files[0]
    names = f"{file.stem} {file.parent.name}".casefold()
    words = re.findall(r"[^\W\d_]+", f"{names} {_head(file).casefold()}")
    directions = [DIRECTION_ALIASES[word] for word in words if word in DIRECTION_ALIASES]
    angles = re.findall(r"\d+", names) if by_angle else ()
    return [*directions, *(ANGLES[angle] for angle in angles if angle in ANGLES), ""][:1]


def _sizes_in_head(file: Path) -> dict[str, float]:
    """Return the sizes (mm) of a specimen, by the keys of `SIZES`, that the head names."""
    sizes = {}
    for size, words in SIZES.items():
        statement = rf"(?i)(?:{words})[^\n]{{0,30}}?[\s;:=,\"]({NUMBER})[\s;,\"]*(mm|cm|in)\b"
        if (match := re.search(statement, _head(file))) is not None:
            sizes[size] = parse_number(match[1]) * LENGTH_UNITS[match[2]]
    return sizes


def _head(file: Path) -> str:
    return file.read_bytes()[:HEAD].decode("utf-8", errors="replace")
