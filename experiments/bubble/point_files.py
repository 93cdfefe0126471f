"""[bubble.data.points]: the files of measured displacements, and how they are read."""

from __future__ import annotations

import os
import re
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...data.fields import QUANTITIES as FIELD
from ...data.frame_files import frame_files
from ...data.frames import FrameOptions
from ...data.registration.register import RegistrationOptions
from ...errors import InputError
from ...reading import is_file
from ...sections import LENGTH_UNITS
from ..base import Place
from ..formats import named_format
from .recorded import RecordedFrames, recorded_frames
from .registration_section import registration_options
from .section import BubbleSection, PointsSection


@dataclass(frozen=True)
class PointFiles:
    """Measured displacements: files in the order of the pressures, and how they are read.

    recorded : which of their frames are taken, and at which pressures; None where the pressures are
    the project's own, one a frame. correlation : how they were measured, in words, by the keys of
    [bubble.data.points.correlation].
    """

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None = None
    registration: RegistrationOptions | None = None
    recorded: RecordedFrames | None = None
    correlation: Mapping[str, str] = field(default_factory=dict)


def measured_files(
    section: BubbleSection, place: Place, pressures: Sequence[float] | None
) -> PointFiles | None:
    """The files of [bubble.data.points] and how they are read; None for a known solution.

    pressures : MPa, None where the project names none.

    Raises
    ------
    InputError : both sources of data or none, files that are not there, pressures of frames that
        cannot be read or do not fit those asked for.
    """
    known, points = section.data.known_solution, section.data.points
    if (known is None) == (points is None):
        problem = "expected exactly one of [bubble.data.known_solution] and [bubble.data.points]"
        raise place.error("data", problem)
    if points is None:
        return None
    measured = _points(points, place)
    if points.pressure is None or (pressures is not None and not place.need_data):
        return measured
    recorded = recorded_frames(
        points.pressure,
        pressures,
        measured.files,
        measured.options,
        measured.format,
        place,
        _folder(points, place),
    )
    return replace(measured, files=recorded.files, recorded=recorded)


def _points(points: PointsSection, place: Place) -> PointFiles:
    columns = points.columns.model_dump(exclude_none=True)
    for name, column in columns.items():
        first = next(other for other in columns if columns[other] == column)
        if first != name:
            problem = f"column {column!r} is named for {first} and for {name}"
            raise place.error(f"data.points.columns.{name}", problem)
    files = _files(points, place)
    unit = points.length_unit or place.scales.length_unit
    options = FrameOptions(
        FIELD,
        columns or None,
        points.flag_column,
        points.comment,
        LENGTH_UNITS[unit],
        points.valid_column,
        points.decimal,
        points.coordinates,
        points.camera_axes,
    )
    return PointFiles(
        files,
        options,
        named_format(place, "data.points.format", "frame", points.format),
        registration_options(points.registration, place, LENGTH_UNITS[unit]),
        correlation=points.correlation.model_dump(exclude_none=True),
    )


def _folder(points: PointsSection, place: Place) -> Path:
    if place.data_folder is not None:
        return Path(place.data_folder)
    return place.path.parent / points.folder


def _file_names(points: PointsSection, place: Place) -> list[str]:
    if (points.files is None) == (points.pattern is None):
        problem = "expected exactly one of 'files' and 'pattern' (with 'indices')"
        raise place.error("data.points", problem)
    if points.files is not None:
        return points.files
    pattern = points.pattern or ""
    if points.indices is None:
        raise place.error("data.points.indices", "this key is missing; 'pattern' needs it")
    try:
        names = [_named(pattern, i) for i in points.indices]
    except ValueError:
        problem = (
            f"expected a name with {{index}} in it, such as t_{{index:02d}}.csv; got {pattern!r}"
        )
        raise place.error("data.points.pattern", problem) from None
    if len(set(names)) != len(names):
        problem = "the same file for several pressures; is {index} in the pattern?"
        raise place.error("data.points.pattern", problem)
    return names


def _named(pattern: str, index: int) -> str:
    """The pattern with `index` for {index}; nothing else is done in braces.

    Raises
    ------
    ValueError : braces that hold something else, a width of more than two digits.
    """
    name = ""
    for text, inside, spec, conversion in string.Formatter().parse(pattern):
        name += text
        if inside is None:
            continue
        if inside != "index" or conversion or not re.fullmatch(r"\d{0,2}d?", spec or ""):
            raise ValueError(inside)
        name += format(index, spec or "")
    return name


def _files(points: PointsSection, place: Place) -> tuple[Path, ...]:
    """The files, patterns in `files` put into the natural order of what they match."""
    names = _file_names(points, place)
    folder = _folder(points, place)
    advice = "give the folder of the measured data with --data DIR"
    needed = place.need_data
    if needed and not os.path.isdir(folder):
        raise place.error("data.points", f"there is no folder {folder}; {advice}")
    if points.files is None:
        files = [folder / name for name in names]
    else:
        try:
            files, _ = frame_files(names, "data.points.files", folder)
        except InputError as error:
            if error.path is None and not needed:
                return ()
            where = f"{error.path} " if error.path is not None else ""
            raise place.error(error.field, f"{where}{error.problem}; {advice}") from None
    for file in files:
        if needed and not is_file(file):
            raise place.error("data.points", f"there is no file {file}; {advice}")
    return tuple(files)
