"""The files of [bubble.data.points]: measured displacements, and the pressures of their frames."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...files import is_file, no_file_words
from ...readers import pressure_log
from ...readers.fields import QUANTITIES as FIELD
from ...readers.frames import FrameOptions, frame_files, read_frames
from ...readers.histories import Inflations, Which, has_several
from ...readers.machine_tables import Channel, read_times
from ...readers.pressure_log import check_pattern, number_in_name, values_in_file
from ...readers.sections import LENGTH_UNITS
from ...readers.tables import PRESSURE_UNITS, TIME_UNITS
from ..kinds import Array, Place, named_format
from .registration import RegistrationOptions
from .section import BubbleSection, LogSection, PointsSection, PressureSection, registration_options

#: Key of the section that says the pressures, below that of the test; source without one.
AT, LISTED = "data.points.pressure", "the list 'pressures'"


def pressures_by_log(
    section: LogSection, files: Sequence[Path], options: FrameOptions, format: str | None,
    place: Place, folder: Path,
) -> tuple[pressure_log.ClockOffset, list[str], list[str]]:  # fmt: skip
    """Return the pressures of all frames by a log, their names, and doubts about their numbers.
    folder : of the data, where the log may be too. Raises InputError."""
    at = f"{AT}.log"
    file = _beside(section.file, place, folder, f"{at}.file")
    kind = named_format(place, f"{at}.format", "machine table", section.format)
    pressure, time = section.pressure.channel, section.time.channel
    options_of_log = kind, section.comment, section.decimal
    log = pressure_log.read_pressure_log(file, pressure, time, *options_of_log)
    heights, names, own = [], [], []
    for one in files:
        # One file at a time: all frames of a test need not be in memory at once.
        frames = read_frames([one], options, format)
        risen = [pressure_log.apex_height(frame) for frame in frames]
        own += [frame.number for frame in frames]
        heights += risen
        names += _frame_names(one, len(risen))
    height = np.array(heights)
    with place.naming(at):
        times, said = _frame_times(section, files, own, place, folder)
        seen = times, height, *log
        if section.offset is None:
            return pressure_log.find_offset(*seen), names, said
        return pressure_log.given_offset(section.offset, *seen), names, said


def _frame_names(file: Path, count: int) -> list[str]:
    """Return the names of the frames of a file."""
    several = [f"{file.name}, frame {i + 1}" for i in range(count)]
    return several if count > 1 else [file.name] * count


def _frame_times(
    section: LogSection, files: Sequence[Path], own: Sequence[float | None], place: Place,
    folder: Path,
) -> tuple[Array, list[str]]:  # fmt: skip
    """Return times (frames,) in s by the camera's clock, and doubts about the numbers they are of.
    own : numbers of the frames in their files."""
    by_name, count = bool(section.time_in_name), len(own)
    if by_name == (section.times is not None) and (by_name or section.rate is None):
        problem = "expected one of 'rate', 'times' and 'time_in_name' for the times of the frames"
        raise InputError(None, "", problem)
    if section.times_column is not None and section.times is None:
        raise InputError(None, "times_column", "means nothing without 'times'")
    if section.times is not None:
        if section.rate is not None:
            raise InputError(None, "rate", "means nothing beside 'times'")
        path = _beside(section.times, place, folder, f"{AT}.log.times")
        times = read_times(path, section.times_column, section.comment, section.decimal)
        if len(times) != count:
            problem = f"expected one time for each of the {count} frames, got {len(times)}"
            raise InputError(path, "", problem)
        return times, []
    if not by_name:
        assert section.rate is not None
        if section.time_in_name is not None:
            return np.arange(count) / section.rate, []
        picture, said = pressure_log.picture_numbers(files, own, section.offset is not None)
        return picture / section.rate, said
    if len(files) != count:
        problem = "a file holds several frames; give 'rate' or 'times'"
        raise InputError(None, "time_in_name", problem)
    pattern = section.time_in_name if isinstance(section.time_in_name, str) else None
    if section.rate is not None and pattern is None:
        problem = "with 'rate', expected a pattern whose group is the number of the picture"
        raise InputError(None, "time_in_name", problem)
    numbers = [number_in_name(f, TIME_UNITS, pattern, None, "time_in_name") for f in files]
    return np.array(numbers) / (section.rate or 1.0), []


def _beside(name: str, place: Place, folder: Path, field: str) -> Path:
    """Return a file beside the frames, in the folder of the data, or beside the project."""
    for home in (folder, place.path.parent):
        if is_file(home / name):
            return home / name
    problem = f"{no_file_words(folder / name)}; --data DIR names another folder"
    raise place.error(field, problem)


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """The frames that a test takes, by rising pressure.
    files : of the frames taken; all files where one holds several. frames : numbers among all
    frames of the files, None where each file holds one. pressure, asked : (n,) MPa. source : of the
    pressures, in words. count : of all frames. left_out : number of frames not used, by why. doubt
    : (n,) MPa, by the uncertain offset of the clocks. logs : a log, a table of times. numbers :
    doubts about the frames' numbers, of which their times are. inflations : all, where several."""

    files: tuple[Path, ...]
    frames: tuple[int, ...] | None
    names: tuple[str, ...]
    pressure: Array
    asked: Array | None
    source: str
    count: int
    left_out: Mapping[str, int]
    doubt: Array | None = None
    clock: pressure_log.ClockOffset | None = None
    logs: tuple[Path, ...] = ()
    numbers: tuple[str, ...] = ()
    inflations: Inflations | None = None


def recorded_frames(
    section: PressureSection | None, asked: Sequence[float] | None, files: Sequence[Path],
    options: FrameOptions, format: str | None, place: Place, folder: Path, inflation: Which,
) -> RecordedFrames:  # fmt: skip
    """Choose the frames of a test by the pressures that were recorded; raises InputError.
    section : None where `asked` are the pressures of the files. asked : MPa, the test's
    `pressures`; None takes all frames, or `frames` of them."""
    clock, names, said = None, [file.name for file in files], list[str]()
    if section is not None:
        _check(section, asked, place, inflation)
    if section is None:
        section, pressures, source = PressureSection(), np.array(asked), LISTED
        asked, names = None, names or [f"frame {i + 1}" for i in range(len(pressures))]
    elif section.log is not None:
        clock, names, said = pressures_by_log(section.log, files, options, format, place, folder)
        pressures, source = clock.pressure, f"the log {section.log.file}"
    elif section.column is not None:
        channel = Channel(section.column, section.unit, section.scale, section.offset)
        each = [values_in_file(file, channel, PRESSURE_UNITS) for file in files]
        counted = zip(files, map(len, each), strict=True)
        names = [name for file, count in counted for name in _frame_names(file, count)]
        pressures = np.concatenate(each)
        source = f"{section.column!r} in each file"
    else:
        pattern = section.from_name if isinstance(section.from_name, str) else None
        unit = section.unit or place.scales.pressure_unit
        own = [number_in_name(f, PRESSURE_UNITS, pattern, unit, "from_name") for f in files]
        pressures, source = np.array(own), "the files' names"
    several, inflations = has_several(pressures), None
    timed = several or inflation != 1 or clock is not None or source == LISTED
    try:
        how = section.frames, section.tolerance, inflation if timed else None
        chosen, left_out = pressure_log.choose_frames(pressures, asked, *how)
    except InputError as error:
        of_test = error.field.startswith(("pressures", "inflation"))
        field = error.field if of_test else f"{AT}.{error.field}"
        raise place.error(field.rstrip("."), error.problem) from None
    taken, logs = list(chosen), []
    if section.log is not None:
        named = {"file": section.log.file, "times": section.log.times}
        logs = [_beside(f, place, folder, f"{AT}.log.{k}") for k, f in named.items() if f]
    if several and all(map(is_file, files)):
        read = [] if clock else [read_frames([one], options, format) for one in files]
        risen = np.array([pressure_log.apex_height(frame) for one in read for frame in one])
        inflations = Inflations(pressures, clock.heights if clock else risen, inflation)
    single = len(names) == len(files)
    return RecordedFrames(
        files=tuple(files[i] for i in taken) if single else tuple(files),
        frames=None if single else chosen, names=tuple(names[i] for i in taken),
        pressure=pressures[taken], asked=None if asked is None else np.array(asked), source=source,
        count=len(names), left_out=left_out,
        doubt=None if clock is None else clock.doubt[taken], clock=clock, logs=tuple(logs),
        numbers=tuple(said), inflations=inflations,
    )  # fmt: skip


def _check(
    section: PressureSection, asked: Sequence[float] | None, place: Place, inflation: Which
) -> None:
    if asked is not None and inflation == "all":
        raise place.error("pressures", "means nothing where inflation = 'all' takes all frames")
    given = [bool(section.from_name), section.column is not None, section.log is not None]
    if sum(given) != 1:
        raise place.error(AT, "expected exactly one of 'from_name', 'column' and 'log'")
    in_log = "say the unit of a log in [...log] pressure = { unit }"
    no_column = section.column is None and (section.scale is not None or section.offset)
    for wrong, key, problem in (
        (section.frames and asked, "frames", "means nothing where 'pressures' are asked for"),
        (section.tolerance and asked is None, "tolerance", "means nothing without 'pressures'"),
        (no_column, "scale", "'scale' and 'offset' here are of a 'column'"),
        (section.log and section.unit, "unit", in_log),
    ):
        if wrong:
            raise place.error(f"{AT}.{key}", problem)
    times = section.log is not None and section.log.time_in_name
    for key, pattern in {"from_name": section.from_name, "log.time_in_name": times}.items():
        bad = check_pattern(pattern) if isinstance(pattern, str) else None
        if bad is not None:
            raise place.error(f"{AT}.{key}", bad)


@dataclass(frozen=True)
class PointFiles:
    """Measured displacements: files by pressure, how they are read, frames chosen among them.
    correlation : words by the keys of [bubble.data.points.correlation]."""

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None = None
    registration: RegistrationOptions | None = None
    recorded: RecordedFrames | None = None
    correlation: Mapping[str, str] = field(default_factory=dict)


def measured_files(
    section: BubbleSection, place: Place, pressures: Sequence[float] | None
) -> PointFiles | None:
    """Return the files of [bubble.data.points]; None for a known solution; raises InputError.
    pressures : MPa, None where the project names none."""
    known, points = section.data.known_solution, section.data.points
    if (known is None) == (points is None):
        problem = "expected exactly one of [bubble.data.known_solution] and [bubble.data.points]"
        raise place.error("data", problem)
    if points is None:
        return None
    columns = points.columns.model_dump(exclude_none=True)
    for name, column in columns.items():
        first = next(other for other in columns if columns[other] == column)
        if first != name:
            problem = f"column {column!r} is named for {first} and for {name}"
            raise place.error(f"data.points.columns.{name}", problem)
    folder = place.folder(points.folder)
    reference = None if points.reference is None else folder / points.reference
    if reference is not None:
        place.has(reference, "data.points.reference")
    files = tuple(file for file in _files(points, place, folder) if file != reference)
    scale = LENGTH_UNITS[points.length_unit or place.scales.length_unit]
    options = FrameOptions(
        FIELD, columns or None, points.flag_column, points.comment, scale, points.valid_column,
        points.decimal, points.coordinates, points.camera_axes, reference=reference,
    )  # fmt: skip
    kind = named_format(place, "data.points.format", "frame", points.format)
    registration = registration_options(points.registration, place, scale)
    correlation = points.correlation.model_dump(exclude_none=True)
    measured = PointFiles(files, options, kind, registration, correlation=correlation)
    listed = list(pressures or ()) if points.pressure is None else []
    several = bool(listed) and (section.inflation != 1 or listed != sorted(listed))
    fits = {len(listed)} if several else {len(listed), 1}
    # Where no data are needed, the files may not be there to be counted.
    if listed and len(files) not in fits and (files or place.need_data):
        problem = f"expected one file for each of the {len(listed)} pressures, got {len(files)}"
        key = "indices" if points.files is None else "files"
        if points.files is not None:
            problem += "; [bubble.data.points.pressure] says at which pressures they were recorded"
        raise place.error("pressures" if several else f"data.points.{key}", problem)
    forward = pressures is not None and not place.need_data
    if not several and (points.pressure is None or forward):
        return measured
    how = measured.files, measured.options, measured.format, place, folder
    recorded = recorded_frames(points.pressure, pressures, *how, section.inflation)
    return replace(measured, files=recorded.files, recorded=recorded)


#: A name of files with {index} in it, which may have a width; other braces are doubled.
PATTERN = r"([^{}]|\{\{|\}\}|\{index(:\d{0,2}d?)?\})*"


def _numbered(points: PointsSection, place: Place) -> list[str]:
    """Return the names that `pattern` gives with `indices`."""
    pattern = points.pattern or ""
    if points.indices is None:
        raise place.error("data.points.indices", "this key is missing; 'pattern' needs it")
    if not re.fullmatch(PATTERN, pattern):
        example = "expected a name with {index} in it, such as t_{index:02d}.csv"
        raise place.error("data.points.pattern", f"{example}; got {pattern!r}")
    names = [pattern.format(index=i) for i in points.indices]
    if len(set(names)) != len(names):
        problem = "the same file for several pressures; is {index} in the pattern?"
        raise place.error("data.points.pattern", problem)
    return names


def _files(points: PointsSection, place: Place, folder: Path) -> Sequence[Path]:
    """Return the files, patterns in `files` put into the natural order of their matches."""
    advice = "--data DIR names another folder"
    if (points.files is None) == (points.pattern is None):
        problem = "expected exactly one of 'files' and 'pattern' (with 'indices')"
        raise place.error("data.points", problem)
    if points.files is None:
        files = [folder / name for name in _numbered(points, place)]
    if place.need_data and not os.path.isdir(folder):
        raise place.error("data.points", f"there is no folder {folder}; {advice}")
    if points.files is not None:
        try:
            files, _ = frame_files(points.files, "data.points.files", folder)
        except InputError as error:
            if error.path is None and not place.need_data:
                return ()
            where = f"{error.path} " if error.path is not None else ""
            raise place.error(error.field, f"{where}{error.problem}; {advice}") from None
    for file in files:
        place.has(file, "data.points")
    return files
