"""The pressures at which frames were recorded, and which of the frames a test takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...data.channels import Channel
from ...data.clock_offset import ClockOffset, find_offset, given_offset
from ...data.column_names import PRESSURE_UNITS, TIME_UNITS
from ...data.file_values import value_in_file
from ...data.frame_choice import choose_frames
from ...data.frames import FrameOptions, read_frames
from ...data.machine_loads import read_times
from ...data.name_numbers import check_pattern, number_in_name
from ...data.pressure_log import LogOptions, apex_heights, read_pressure_log
from ...errors import InputError
from ..base import Place
from ..channels import channel_of
from ..formats import named_format
from .pressure_section import LogSection, PressureSection

Array = NDArray[np.float64]
AT = "data.points.pressure"


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """The frames that a test takes, by rising pressure.

    Parameters
    ----------
    files : of the frames taken; all files where one holds several frames. frames : their numbers
        among all frames of the files, None where each file holds one.
    names : what each is called. pressure : (n,) MPa, as recorded. asked : (n,) MPa, None where no
        pressures were asked for.
    source : where the pressures stand, in words. count : of all frames. left_out : how many were
        not looked at, by why.
    logs : files beside those of the frames that were read: a log, a table of times.
    doubt : (n,) MPa, by what the clocks' offset leaves open; None without a log. clock : of a log.
    """

    files: tuple[Path, ...]
    frames: tuple[int, ...] | None
    names: tuple[str, ...]
    pressure: Array
    asked: Array | None
    source: str
    count: int
    left_out: Mapping[str, int]
    doubt: Array | None = None
    clock: ClockOffset | None = None
    logs: tuple[Path, ...] = ()


def recorded_frames(
    section: PressureSection,
    asked: Sequence[float] | None,
    files: Sequence[Path],
    options: FrameOptions,
    format: str | None,
    place: Place,
    folder: Path,
) -> RecordedFrames:
    """The frames of a test by what was recorded.

    Parameters
    ----------
    asked : MPa, the test's own `pressures`; None takes all frames, or `frames` of them.
    folder : of the data, where a log may be too.

    Raises
    ------
    InputError : naming file and key: no or two places of the pressures, pressures that cannot be
        read, frames that are not there.
    """
    _check(section, asked, place)
    clock, names = None, [file.name for file in files]
    if section.log is not None:
        clock, names = _by_log(section.log, files, options, format, place, folder)
        pressures, source = clock.pressure, f"the log {section.log.file}"
    elif section.column is not None:
        channel = Channel(section.column, section.unit, section.scale, section.offset)
        pressures = np.array([value_in_file(file, channel, PRESSURE_UNITS) for file in files])
        source = f"{section.column!r} in each file"
    else:
        pattern = section.from_name if isinstance(section.from_name, str) else None
        unit = section.unit or place.scales.pressure_unit
        pressures = np.array(
            [number_in_name(f, PRESSURE_UNITS, pattern, unit, "from_name") for f in files]
        )
        source = "the files' names"
    limit = None if section.tolerance is None else section.tolerance * place.scales.pressure
    try:
        chosen = choose_frames(pressures, asked, section.frames, limit, clock is not None)
    except InputError as error:
        field = error.field if error.field.startswith("pressures") else f"{AT}.{error.field}"
        raise place.error(field.rstrip("."), error.problem) from None
    taken = list(chosen.frames)
    single = len(names) == len(files)
    return RecordedFrames(
        files=tuple(files[i] for i in taken) if single else tuple(files),
        frames=None if single else chosen.frames,
        names=tuple(names[i] for i in taken),
        pressure=pressures[taken],
        asked=None if asked is None else np.array(asked),
        source=source,
        count=len(names),
        left_out=chosen.left_out,
        doubt=None if clock is None else clock.doubt[taken],
        clock=clock,
        logs=_logs(section.log, place, folder),
    )


def _logs(section: LogSection | None, place: Place, folder: Path) -> tuple[Path, ...]:
    if section is None:
        return ()
    named = {"file": section.file, "times": section.times}
    return tuple(
        _beside(name, place, folder, f"{AT}.log.{key}") for key, name in named.items() if name
    )


def _check(section: PressureSection, asked: Sequence[float] | None, place: Place) -> None:
    given = [bool(section.from_name), section.column is not None, section.log is not None]
    if sum(given) != 1:
        raise place.error(AT, "expected exactly one of 'from_name', 'column' and 'log'")
    if section.frames is not None and asked is not None:
        raise place.error(f"{AT}.frames", "means nothing where 'pressures' are asked for")
    if section.tolerance is not None and asked is None:
        raise place.error(f"{AT}.tolerance", "means nothing without 'pressures'")
    if section.column is None and (section.scale is not None or section.offset):
        raise place.error(f"{AT}.scale", "'scale' and 'offset' here are of a 'column'")
    if section.log is not None and section.unit is not None:
        raise place.error(f"{AT}.unit", "say the unit of a log in [...log] pressure = { unit }")
    patterns = {f"{AT}.from_name": section.from_name}
    if section.log is not None:
        patterns[f"{AT}.log.time_in_name"] = section.log.time_in_name
    for key, pattern in patterns.items():
        problem = check_pattern(pattern) if isinstance(pattern, str) else None
        if problem is not None:
            raise place.error(key, problem)


def _by_log(
    section: LogSection,
    files: Sequence[Path],
    options: FrameOptions,
    format: str | None,
    place: Place,
    folder: Path,
) -> tuple[ClockOffset, list[str]]:
    """The pressures of all frames by a log, and what the frames are called."""
    at = f"{AT}.log"
    file = _beside(section.file, place, folder, f"{at}.file")
    log = read_pressure_log(
        file,
        LogOptions(
            channel_of(section.pressure),
            channel_of(section.time),
            named_format(place, f"{at}.format", "machine table", section.format),
            section.comment,
            section.decimal,
        ),
    )
    heights, names = [], []
    for one in files:
        # One file at a time: all frames of a test need not be in memory at once.
        risen = apex_heights(read_frames([one], options, format))
        heights += risen.tolist()
        several = len(risen) > 1
        names += [f"{one.name}, frame {i + 1}" if several else one.name for i in range(len(risen))]
    height = np.array(heights)
    try:
        times = _frame_times(section, files, len(height), place, folder)
        if section.offset is not None:
            given = section.offset
            return given_offset(given, times, height, log.time, log.pressure), names
        return find_offset(times, height, log.time, log.pressure), names
    except InputError as error:
        if error.path is not None:
            raise
        raise place.error(f"{at}.{error.field}".rstrip("."), error.problem) from None


def _frame_times(
    section: LogSection, files: Sequence[Path], count: int, place: Place, folder: Path
) -> Array:
    """Times (frames,) in s by the camera's clock."""
    by_name = bool(section.time_in_name)
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
        return times
    if not by_name:
        assert section.rate is not None
        return np.arange(count) / section.rate
    if len(files) != count:
        raise InputError(
            None, "time_in_name", "a file holds several frames; give 'rate' or 'times'"
        )
    pattern = section.time_in_name if isinstance(section.time_in_name, str) else None
    if section.rate is not None and pattern is None:
        problem = "with 'rate', expected a pattern whose group is the number of the picture"
        raise InputError(None, "time_in_name", problem)
    numbers = np.array(
        [number_in_name(f, TIME_UNITS, pattern, None, "time_in_name") for f in files]
    )
    return numbers / (section.rate or 1.0)


def _beside(name: str, place: Place, folder: Path, field: str) -> Path:
    """A file beside the frames, in the folder of the data, or beside the project."""
    for home in (folder, place.path.parent):
        if (home / name).is_file():
            return home / name
    raise place.error(field, f"there is no file {folder / name}; --data DIR names another folder")
