"""Selection of the frames (images) of a bubble test by the pressures recorded with them.

[bubble.data.points.pressure] says where the pressure of a frame stands: in the name of its file, in
a column of the file, or in the log of a sensor that has a clock of its own, which may be doubted.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...readers.clock_offset import ClockOffset, find_offset, given_offset
from ...readers.fields import check_count, without_frame_at_rest
from ...readers.frames import (
    Frame,
    FrameOptions,
    frame_file_name,
    frames_in_memory,
    read_frames,
)
from ...readers.histories import apex_height, read_pressure_log, rest_limit_of
from ...readers.inflations import InflationChoice, Inflations, choose_frames, has_several
from ...readers.machine_tables import Channel, read_times
from ...readers.units import PRESSURE_UNITS, TIME_UNITS
from ...readers.values_in_files import (
    check_pattern,
    numbers_in_names,
    picture_numbers,
    values_in_file,
)
from ...solvers.base import Array
from ...storage.reading import is_file, missing_file_reason
from ..sections import Place, named_format
from .section import LogSection, PressureSection

#: Key of the section that says the pressures, below that of the test.
SECTION = "data.points.pressure"


@dataclass(frozen=True)
class FrameFiles:
    """Files of frames (or frames in memory), and how they are read.

    Attributes
    ----------
    files : tuple of Path
    options : FrameOptions
        How the files are read.
    format : str or None
        Name of their format, None to recognise it.
    place : Place
        Place of the test's section, which messages name.
    folder : Path
        Folder of the data, where a log may be, too.
    arrays : tuple of Frame or None
        Frames in memory, in place of files.
    """

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None
    place: Place
    folder: Path
    arrays: tuple[Frame, ...] | None = None

    def read(self) -> Iterator[tuple[str, Sequence[Frame]]]:
        """Yield the name and the frames of one file after another.

        So the frames of all files need not be in memory at once. A frame that is in memory has the
        name that its file gets once it is written.
        """
        for number, frame in enumerate(self.arrays or ()):
            yield frame_file_name(number), frames_in_memory([frame], self.options)
        for file in self.files:
            yield file.name, read_frames([file], self.options, self.format)


@dataclass(frozen=True, eq=False)
class Recording:
    """The pressures that were recorded at all frames of a test.

    Attributes
    ----------
    pressure : (frames,) array, MPa
    names : list of str
        Names of the frames.
    source : str
        Where the pressures are from, in words.
    clock : ClockOffset or None
        Offset between the clocks of log and camera, where the pressures are from a log.
    logs : tuple of Path
        The log and the table of times that were read, if any.
    number_doubts : list of str
        Doubts about the numbers of the frames from which their times are computed.
    rest_limit : float, MPa
        Pressure up to which a frame is at rest, by the noise of the log.
    log_doubts : list of str
        Doubts about the log.
    """

    pressure: Array
    names: Sequence[str]
    source: str
    clock: ClockOffset | None = None
    logs: tuple[Path, ...] = ()
    number_doubts: Sequence[str] = ()
    rest_limit: float = 0.0
    log_doubts: Sequence[str] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedFrames(Recording):
    """The n frames that a test uses, chosen by their recorded pressures.

    Attributes
    ----------
    pressure, names
        Those of the chosen frames.
    files : tuple of Path
        Files of the chosen frames; all files where a file holds several frames.
    frames : tuple of int or None
        Numbers of the chosen frames among those of all files; None where each file holds one.
    requested : (n,) array, MPa, or None
        The pressures for which they were chosen, where a project asks for some.
    count : int
        Number of frames that were recorded, used or not.
    left_out : mapping of str to int
        Number of frames that are not used, by reason.
    pressure_uncertainty : (n,) array, MPa, or None
        Uncertainty of the pressures due to that of the offset between the clocks.
    inflations : Inflations or None
        All inflations of the recording, where there are several.
    """

    files: tuple[Path, ...]
    frames: tuple[int, ...] | None
    requested: Array | None
    count: int
    left_out: Mapping[str, int]
    pressure_uncertainty: Array | None
    inflations: Inflations | None


def recorded_frames(
    section: PressureSection | None,
    requested: Sequence[float] | None,
    files: FrameFiles,
    inflation: InflationChoice,
) -> RecordedFrames:
    """Choose the frames of a test by the pressures that were recorded with them.

    Parameters
    ----------
    section : PressureSection or None
        Where the pressures stand; None where `requested` are the pressures of the files.
    requested : sequence of float, MPa, or None
        The test's `pressures`; None takes all frames, or as many as the section says.
    files : FrameFiles
    inflation : int or "all"
        Number (from 1) of the inflation whose frames are taken, or those of all.

    Raises
    ------
    InputError
        The pressures cannot be found, or there are no such frames.
    """
    is_listed = section is None
    if section is None:
        recording = _listed_pressures(requested or (), files)
        requested = None
        section = PressureSection()
    else:
        _check(section, requested, files.place, inflation)
        recording = _recorded_pressures(section, files)
    has_inflations = has_several(recording.pressure)
    is_timed = has_inflations or inflation != 1 or recording.clock is not None or is_listed
    chosen, left_out = _choose(
        recording, requested, section, inflation if is_timed else None, files.place
    )
    inflations = None
    if has_inflations and all(map(is_file, files.files)):
        inflations = Inflations(recording.pressure, _heights(recording, files), inflation)
    return _chosen_frames(
        recording,
        files,
        chosen,
        requested=None if requested is None else np.array(requested),
        left_out=left_out,
        inflations=inflations,
    )


def _chosen_frames(
    recording: Recording,
    files: FrameFiles,
    chosen: tuple[int, ...],
    requested: Array | None,
    left_out: Mapping[str, int],
    inflations: Inflations | None,
) -> RecordedFrames:
    """Return the frames of a recording that were chosen, by their numbers from 0."""
    rows = list(chosen)
    clock = recording.clock
    is_frame_per_file = len(recording.names) == len(files.files)
    fields = {
        **vars(recording),
        "names": tuple(recording.names[row] for row in rows),
        "pressure": recording.pressure[rows],
    }
    return RecordedFrames(
        **fields,
        files=tuple(files.files[row] for row in rows) if is_frame_per_file else files.files,
        frames=None if is_frame_per_file else chosen,
        count=len(recording.names),
        pressure_uncertainty=None if clock is None else clock.pressure_uncertainty[rows],
        requested=requested,
        left_out=left_out,
        inflations=inflations,
    )


def _choose(
    recording: Recording,
    requested: Sequence[float] | None,
    section: PressureSection,
    inflation: InflationChoice | None,
    place: Place,
) -> tuple[tuple[int, ...], dict[str, int]]:
    """Return the numbers of the chosen frames, and the count of the others by reason.

    InputError names the key of the test's section.
    """
    try:
        return choose_frames(
            recording.pressure,
            requested,
            section.frames,
            section.tolerance,
            inflation,
            recording.rest_limit,
        )
    except InputError as error:
        is_of_test = error.field.startswith(("pressures", "inflation"))
        field = error.field if is_of_test else f"{SECTION}.{error.field}"
        raise place.error(field.rstrip("."), error.problem) from None


def _heights(recording: Recording, files: FrameFiles) -> Array:
    """Return the heights (frames,) mm of the apex in all frames."""
    if recording.clock is not None:
        return recording.clock.heights
    heights: list[float] = []
    for _, frames in files.read():
        if len(files.files) == 1:
            frames = without_frame_at_rest(frames, len(recording.names))
            with files.place.errors_name("data.points"):
                check_count(frames, len(recording.names))
        heights += map(apex_height, frames)
    return np.array(heights)


# Pressures --------------------------------------------------------------------------------------


def _recorded_pressures(section: PressureSection, files: FrameFiles) -> Recording:
    """Read the pressures of all frames from where the section says that they stand."""
    if section.log is not None:
        return _pressures_by_log(section.log, files)
    if section.column is not None:
        return _pressures_in_files(section, section.column, files)
    pattern = section.from_name if isinstance(section.from_name, str) else None
    unit = section.unit or files.place.scales.pressure_unit
    pressures = numbers_in_names(files.files, PRESSURE_UNITS, pattern, unit, "from_name")
    names = [file.name for file in files.files]
    return Recording(pressures, names, "the files' names")


def _listed_pressures(pressures: Sequence[float], files: FrameFiles) -> Recording:
    """Return the pressures listed in a project, one for each file, or frame of one or in memory."""
    names = [file.name for file in files.files]
    if len(names) == 1:
        names = _frame_names(names[0], len(pressures))
    frame_names = names or [f"frame {number}" for number in range(1, len(pressures) + 1)]
    return Recording(np.array(pressures), frame_names, "the list 'pressures'")


def _pressures_in_files(section: PressureSection, column: str, files: FrameFiles) -> Recording:
    """Read the pressures from a column (or value) of the files of the frames."""
    channel = Channel(column, section.unit, section.scale, section.offset)
    pressures = []
    names = []
    for file in files.files:
        values = values_in_file(file, channel, PRESSURE_UNITS)
        pressures.append(values)
        names += _frame_names(file.name, len(values))
    return Recording(np.concatenate(pressures), names, f"{column!r} in each file")


def _pressures_by_log(section: LogSection, files: FrameFiles) -> Recording:
    """Interpolate the pressures of the frames from a log, after aligning its clock to theirs."""
    key = f"{SECTION}.log"
    place = files.place
    log_file = _find_beside(section.file, place, files.folder, f"{key}.file")
    log_times, pressures = read_pressure_log(
        log_file,
        section.pressure.channel,
        section.time.channel,
        named_format(place, f"{key}.format", "machine table", section.format),
        section.comment,
        section.decimal,
    )
    heights: list[float] = []
    names: list[str] = []
    file_numbers: list[float | None] = []
    for file_name, frames in files.read():
        heights += map(apex_height, frames)
        file_numbers += [frame.number for frame in frames]
        names += _frame_names(file_name, len(frames))
    with place.errors_name(key):
        times, doubts = frame_times(section, files.files, file_numbers, place, files.folder)
        recorded = times, np.array(heights), log_times, pressures
        if section.offset is None:
            clock = find_offset(*recorded)
        else:
            clock = given_offset(section.offset, *recorded)
    logs = [log_file]
    if section.times:
        logs.append(_find_beside(section.times, place, files.folder, f"{key}.times"))
    return Recording(
        clock.pressure,
        names,
        f"the log {section.file}",
        clock,
        tuple(logs),
        doubts,
        rest_limit_of(pressures),
        doubts_of_log(clock, log_times),
    )


def _frame_names(file_name: str, count: int) -> list[str]:
    """Return the names of the frames of a file."""
    if count == 1:
        return [file_name]
    return [f"{file_name}, frame {number}" for number in range(1, count + 1)]


# Times ------------------------------------------------------------------------------------------


def frame_times(
    section: LogSection,
    files: Sequence[Path],
    file_numbers: Sequence[float | None],
    place: Place,
    folder: Path,
) -> tuple[Array, list[str]]:
    """Return the times of all frames by the camera's clock.

    Parameters
    ----------
    section : LogSection
        Gives the times by the rate of pictures, by a table of times, or by the names of the files.
    files : sequence of Path
    file_numbers : (frames,) sequence of float or None
        The number of each frame that its file states, if any.
    place : Place
    folder : Path
        Folder of the data.

    Returns
    -------
    times : (frames,) array, s
    doubts : list of str
        Doubts about the numbers of the frames from which times are computed.
    """
    count = len(file_numbers)
    _check_times(section)
    if section.times is not None:
        path = _find_beside(section.times, place, folder, f"{SECTION}.log.times")
        times = read_times(path, section.times_column, section.comment, section.decimal)
        if len(times) != count:
            problem = f"expected one time for each of the {count} frames, got {len(times)}"
            raise InputError(path, "", problem)
        return times, []
    if section.time_in_name:
        return _times_in_names(section, files, count), []
    assert section.rate is not None
    if section.time_in_name is not None:
        return np.arange(count) / section.rate, []
    numbers, doubts = picture_numbers(files, file_numbers, section.offset is not None)
    return numbers / section.rate, doubts


def _check_times(section: LogSection) -> None:
    """Refuse a section that gives the times of the frames in no way, or in several."""
    has_times = section.times is not None
    has_rate = section.rate is not None
    if bool(section.time_in_name) + has_times != 1 and (section.time_in_name or not has_rate):
        problem = "expected one of 'rate', 'times' and 'time_in_name' for the times of the frames"
        raise InputError(None, "", problem)
    if section.times_column is not None and not has_times:
        raise InputError(None, "times_column", "means nothing without 'times'")
    if has_times and has_rate:
        raise InputError(None, "rate", "means nothing beside 'times'")


def _times_in_names(section: LogSection, files: Sequence[Path], count: int) -> Array:
    """Return the times (frames,), s, that stand in the names of the files.

    With a rate the names have numbers of pictures, which are divided by it.
    """
    if len(files) != count:
        problem = "a file holds several frames; give 'rate' or 'times'"
        raise InputError(None, "time_in_name", problem)
    pattern = section.time_in_name if isinstance(section.time_in_name, str) else None
    if section.rate is not None and pattern is None:
        problem = "with 'rate', expected a pattern whose group is the number of the picture"
        raise InputError(None, "time_in_name", problem)
    numbers = numbers_in_names(files, TIME_UNITS, pattern, None, "time_in_name")
    return numbers / (section.rate or 1.0)


def _find_beside(
    name: str,
    place: Place,
    folder: Path,
    field: str,
) -> Path:
    """Return the path of a file that lies in the folder of the data or beside the project."""
    for home in (folder, place.path.parent):
        if is_file(home / name):
            return home / name
    problem = f"{missing_file_reason(folder / name)}; --data DIR names another folder"
    raise place.error(field, problem)


# Checks -----------------------------------------------------------------------------------------


def _check(
    section: PressureSection,
    requested: Sequence[float] | None,
    place: Place,
    inflation: InflationChoice,
) -> None:
    """Refuse a section with keys that contradict each other or mean nothing."""
    if requested is not None and inflation == "all":
        raise place.error("pressures", "means nothing where inflation = 'all' takes all frames")
    sources = bool(section.from_name) + (section.column is not None) + (section.log is not None)
    if sources != 1:
        raise place.error(SECTION, "expected exactly one of 'from_name', 'column' and 'log'")
    if place.measured is not None and section.log is None:
        key = "from_name" if section.from_name else "column"
        problem = "is of files, and arrays are given; give their pressures"
        raise place.error(f"{SECTION}.{key}", problem)
    for is_wrong, key, problem in _rules(section, requested):
        if is_wrong:
            raise place.error(f"{SECTION}.{key}", problem)
    _check_pattern("from_name", section.from_name, place)
    if section.log is not None:
        _check_pattern("log.time_in_name", section.log.time_in_name, place)


def _rules(
    section: PressureSection, requested: Sequence[float] | None
) -> Iterator[tuple[Any, str, str]]:
    """Yield whether a key is wrong, the key, and what is wrong with it."""
    problem = "means nothing where 'pressures' are asked for"
    yield section.frames and requested, "frames", problem
    problem = "means nothing without 'pressures'"
    yield section.tolerance and requested is None, "tolerance", problem
    is_scaled = section.scale is not None or section.offset
    problem = "'scale' and 'offset' here are of a 'column'"
    yield section.column is None and is_scaled, "scale", problem
    problem = "say the unit of a log in [...log] pressure = { unit }"
    yield section.log and section.unit, "unit", problem


def _check_pattern(key: str, pattern: str | bool | None, place: Place) -> None:
    """Refuse a pattern that is no regular expression with a group."""
    fault = check_pattern(pattern) if isinstance(pattern, str) else None
    if fault is not None:
        raise place.error(f"{SECTION}.{key}", fault)


@dataclass(frozen=True)
class LogLimits:
    """Limits by which a log has a hole, or its pressure is not that of the sheet."""

    hole: float = 100.0  # median intervals of the log: a longer one is a hole, if it is ...
    shortest_hole: float = 60.0  # ... longer than this, s: some logs record changes only
    fall: float = 0.2  # share of the highest pressure by which the log falls, while ...
    sinking: float = 0.01  # ... the apex sinks by less than this share of its greatest height


LOG_LIMITS = LogLimits()


def doubts_of_log(clock: ClockOffset, log_times: Array) -> list[str]:
    """Return doubts about a log: holes, and pressures that the sheet does not follow.

    Parameters
    ----------
    clock : ClockOffset
        Times and heights of the frames, and the pressures that they have by the log.
    log_times : (k,) array, s
        Times of the readings of the log, by its own clock.
    """
    return [*_holes(clock, log_times), *_falls_of_a_still_sheet(clock)]


def _holes(clock: ClockOffset, log_times: Array) -> Iterator[str]:
    """Doubt a log that says nothing of a long time in which frames were taken.

    Parameters
    ----------
    log_times : (n,) array, s
        Times of the readings of the log.
    """
    intervals = np.diff(log_times)
    usual = float(np.median(intervals))
    k = int(np.argmax(intervals))
    start, end = log_times[k : k + 2]
    frame_times = clock.times + clock.offset
    is_among_frames = start < frame_times.max() and end > frame_times.min()
    longest = float(intervals[k])
    if longest > max(LOG_LIMITS.hole * usual, LOG_LIMITS.shortest_hole) and is_among_frames:
        yield (
            f"the log has a hole of {longest:.4g} s at {start:.4g} s, where readings are otherwise "
            f"{usual:.2g} s apart: was its clock set, or was it stopped? Pressures of frames there "
            "are interpolated"
        )


def _falls_of_a_still_sheet(clock: ClockOffset) -> Iterator[str]:
    """Doubt a log whose pressure falls while the apex stays where it is."""
    order = np.argsort(clock.times, kind="stable")
    is_known = np.isfinite(clock.pressure[order]) & np.isfinite(clock.heights[order])
    order = order[is_known]
    pressure = clock.pressure[order]
    height = clock.heights[order]
    if not len(order):
        return
    peak = np.maximum.accumulate(pressure)
    rows_of_peak = np.maximum.accumulate(np.where(pressure == peak, np.arange(len(order)), 0))
    has_fallen = peak - pressure > LOG_LIMITS.fall * pressure.max()
    is_still = height > height[rows_of_peak] - LOG_LIMITS.sinking * height.max()
    doubtful = np.flatnonzero(has_fallen & is_still)
    if len(doubtful):
        k = doubtful[0]
        yield (
            f"the log falls from {1e3 * peak[k]:.4g} to {1e3 * pressure[k]:.4g} kPa while the apex "
            f"stays at {height[k]:.4g} mm, in {len(doubtful)} of {len(order)} frames: a leak "
            "between the sheet and the gauge, or the log of another test; leave such frames out"
        )
