"""The pressures at which frames were recorded, and which of the frames a test takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...data.channels import Channel
from ...data.clock_offset import ClockOffset
from ...data.column_names import PRESSURE_UNITS
from ...data.file_values import value_in_file
from ...data.frame_choice import choose_frames
from ...data.frames import FrameOptions
from ...data.name_numbers import check_pattern, number_in_name
from ...errors import InputError
from ..base import Place
from .frame_clock import AT, log_files, pressures_by_log
from .pressure_section import PressureSection

Array = NDArray[np.float64]


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
        clock, names = pressures_by_log(section.log, files, options, format, place, folder)
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
        logs=log_files(section.log, place, folder),
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
