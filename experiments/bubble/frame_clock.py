"""The pressures of frames by a log of them: times of the frames, and the two clocks as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...data.clock_offset import ClockOffset, find_offset, given_offset
from ...data.column_names import TIME_UNITS
from ...data.frames import FrameOptions, read_frames
from ...data.machine_loads import read_times
from ...data.name_numbers import number_in_name
from ...data.pressure_log import LogOptions, apex_heights, read_pressure_log
from ...errors import InputError
from ...reading import is_file
from ..base import Place
from ..channels import channel_of
from ..formats import named_format
from .pressure_section import LogSection

Array = NDArray[np.float64]
#: Key of the section that says the pressures, below that of the test.
AT = "data.points.pressure"


def pressures_by_log(
    section: LogSection,
    files: Sequence[Path],
    options: FrameOptions,
    format: str | None,
    place: Place,
    folder: Path,
) -> tuple[ClockOffset, list[str]]:
    """The pressures of all frames by a log, and what the frames are called.

    folder : of the data, where the log may be too.

    Raises
    ------
    InputError : naming file and key: in the log or the frames, times that cannot be had, clocks
        that cannot be put together.
    """
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


def log_files(section: LogSection | None, place: Place, folder: Path) -> tuple[Path, ...]:
    """The files that pressures come from beside the frames, for the record; none without a log.

    Raises
    ------
    InputError : naming file and key: one that is not there.
    """
    if section is None:
        return ()
    named = {"file": section.file, "times": section.times}
    return tuple(
        _beside(name, place, folder, f"{AT}.log.{key}") for key, name in named.items() if name
    )


def _beside(name: str, place: Place, folder: Path, field: str) -> Path:
    """A file beside the frames, in the folder of the data, or beside the project."""
    for home in (folder, place.path.parent):
        if is_file(home / name):
            return home / name
    raise place.error(field, f"there is no file {folder / name}; --data DIR names another folder")
