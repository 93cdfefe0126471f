"""Recognise the measured files of a folder, and propose the tests of a project for them."""

import re
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
from ..readers.histories import read_pressure_log
from ..readers.machine_tables import Channel, read_times
from ..readers.numerals import NUMBER, parse_number
from ..readers.quantities import DIRECTION_ALIASES
from ..readers.units import LENGTH_UNITS, PRESSURE_UNITS, TIME_UNITS
from ..readers.values_in_files import number_in_name, values_in_file
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
#: Units with which files that name none are looked at; a project asks for theirs.
ASSUMED_UNITS = {STRIPS: "N", LOG: "kPa"}
#: Directions of strips by angles in names; laboratories differ, so that they are to be confirmed.
ANGLES = {"0": "warp", "90": "fill"}
DIRECTIONS_BY_NAME = {**DIRECTION_ALIASES, **ANGLES}
#: Columns by which files of frames may hold their pressure.
PRESSURE_COLUMNS = [Channel(name) for name in "p P pressure Pressure druck Druck".split()]
#: Numbers in names by which files of one test differ, and no angles: of test1_00, Bubble-0003_0,
#: step_2_60.5kPa, warp1 and strip_45deg_2 these are 00, 0003 and 0, 2 and 60.5, 1, and 2.
NUMBERS = re.compile(
    r"(?:(?<![^\W_])|(?=\d+\D*$)|(?=\d{3}))\d+(?:[.,]\d+)?(?!\d|[ _]?(?:deg|grad|°))"
)


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
    sizes = {"width": 1.0, "gauge_length": dict.fromkeys(DIRECTIONS, 1.0), "load_unit": unit}
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
    groups: dict[Path, list[Path]] = {}
    for file in sorted(data.rglob("*")):
        if file.is_file() and file.name[0] != ".":
            pattern = NUMBERS.sub("*", file.stem) + file.suffix
            groups.setdefault(file.with_name(pattern), []).append(file)
    return [_recognised(files, pattern, data) for pattern, files in groups.items()]


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
    first = group.files[0]
    frame = group.content[0]
    points = np.nan_to_num(frame.points[np.isfinite(frame.points[:, :2]).all(axis=1)])
    off_centre = np.abs(points.max(axis=0) + points.min(axis=0)) / 2
    is_named = _can(number_in_name, first, PRESSURE_UNITS)
    is_timed = _can(number_in_name, first, TIME_UNITS)
    columns = [c for c in PRESSURE_COLUMNS if _can(values_in_file, first, c, PRESSURE_UNITS)]
    sizes = ["radius"]
    if not (is_named or logs or columns):
        sizes.append("pressures")
    elif not (is_named or times or is_timed or columns):
        sizes.append("rate")
    if logs and logs[-1].unit and not is_named:
        sizes.append("pressure_unit")
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


def _strips(groups: Sequence[FileGroup]) -> list[Settings]:
    """Return the values of one test of all strips; none where no direction is known."""
    if not groups:
        return []
    files: dict[str, list[str]] = {}
    in_heads: dict[str, float] = {}
    for group in groups:
        in_heads |= _sizes_in_head(group.files[0])
        for direction in _directions_of(group):
            files.setdefault(direction, []).extend(group.names)
    unknown = files.pop("", [])
    sizes = ["width", "gauge_length", *["grip_distance"] * ("bias" in files)]
    sizes += ["load_unit"] * (groups[0].unit is not None)
    values: Settings = {"kind": "strips", "files": files, "unknown": unknown, "sizes": sizes}
    by_angle = any(_direction_word(group.files[0]) in ANGLES for group in groups)
    values |= {"in_heads": in_heads, "by_angle": by_angle}
    return [values] if files else []


def _directions_of(group: FileGroup) -> set[str]:
    """Return the directions of strips by a column, or their file's name, folder or head, or ""."""
    if len(group.content) > 1:
        return {curve.direction for curve in group.content}
    return {DIRECTIONS_BY_NAME.get(_direction_word(group.files[0]), "")}


def _direction_word(file: Path) -> str:
    """Return the first word for a direction in a file's name, folder or head, or ""."""
    text = f"{file.stem} {file.parent.name} {_head(file)}".casefold()
    words = re.findall(r"\d+(?=[ _]?(?:deg|grad|°))|[^\W\d_]+", text)
    return next((word for word in words if word in DIRECTIONS_BY_NAME), "")


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
