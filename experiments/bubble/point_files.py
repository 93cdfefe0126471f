"""The measured displacements of [bubble.data.points], in files or in memory."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...readers.fields import QUANTITIES, DisplacementField, fields_of_frames, read_fields
from ...readers.frames import Frame, FrameOptions, frame_files, frames_in_memory
from ...readers.sections import LENGTH_UNITS
from ..sections import Place, named_format
from .recorded_frames import FrameFiles, RecordedFrames, recorded_frames
from .registration import RegistrationOptions
from .section import BubbleSection, PointsSection, registration_options

#: A name of files with {index} in it, which may have a width; other braces are doubled.
INDEX_PATTERN = r"([^{}]|\{\{|\}\}|\{index(:\d{0,2}d?)?\})*"


@dataclass(frozen=True)
class PointFiles:
    """The measured displacements of a test: files in the order of pressures, or arrays.

    Attributes
    ----------
    files : tuple of Path
        The files; empty where the data are in memory.
    options : FrameOptions
        How the files are read.
    format : str or None
        Name of their format, None to recognise it.
    registration : RegistrationOptions or None
        How the fields are registered; None where they are in the test's coordinates.
    recorded : RecordedFrames or None
        The frames that were chosen by recorded pressures; None where all are used as listed.
    correlation : mapping
        What is said of the image correlation, by the keys of [bubble.data.points.correlation].
    frames : tuple of Frame or None
        Frames in memory, in place of files.
    """

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None = None
    registration: RegistrationOptions | None = None
    recorded: RecordedFrames | None = None
    correlation: Mapping[str, str] = field(default_factory=dict)
    frames: tuple[Frame, ...] | None = None

    def read_fields(self, pressures: Sequence[float]) -> tuple[DisplacementField, ...]:
        """Return the measured fields at the pressures (MPa); raise InputError for faulty files."""
        numbers = None
        count = None
        if self.recorded is not None and self.recorded.frames is not None:
            numbers = self.recorded.frames
            count = self.recorded.count
        if self.frames is None:
            return read_fields(self.files, pressures, self.options, self.format, numbers, count)
        frames = frames_in_memory(self.frames, self.options)
        if numbers is not None:
            frames = tuple(frames[number] for number in numbers)
        return fields_of_frames(frames, pressures)


def measured_files(
    section: BubbleSection, place: Place, pressures: Sequence[float] | None
) -> PointFiles | None:
    """Return the measured data that [bubble.data.points] describes; None for a known solution.

    Parameters
    ----------
    section : BubbleSection
    place : Place
    pressures : sequence of float, MPa, or None
        The listed pressures; None where the project lists none.

    Raises
    ------
    InputError
        Files are missing, or keys contradict each other.
    """
    _check_source(section, place)
    points = section.data.points
    if points is None:
        return None
    folder = place.folder(points.folder)
    scale = LENGTH_UNITS[points.length_unit or place.scales.length_unit]
    options = _frame_options(points, place, folder, scale)
    files: tuple[Path, ...] = ()
    frames: tuple[Frame, ...] | None = None
    if place.measured is None:
        all_files = _files(points, place, folder)
        files = tuple(file for file in all_files if file != options.reference)
    else:
        frames = tuple(place.measured)
    measured = PointFiles(
        files,
        options,
        named_format(place, "data.points.format", "frame", points.format),
        registration_options(points.registration, place, scale),
        correlation=points.correlation.model_dump(exclude_none=True),
        frames=frames,
    )
    source = FrameFiles(
        files,
        options,
        measured.format,
        place,
        folder,
        frames,
    )
    recorded = _recorded(section, points, pressures, source)
    if recorded is None:
        return measured
    return replace(measured, files=recorded.files, recorded=recorded)


def _recorded(
    section: BubbleSection,
    points: PointsSection,
    pressures: Sequence[float] | None,
    source: FrameFiles,
) -> RecordedFrames | None:
    """Return the frames chosen by their pressures; None if all files are taken as listed.

    Frames are chosen where pressures are recorded, or where a list covers several inflations. A
    forward analysis that lists its pressures needs no recorded ones.
    """
    place = source.place
    listed = list(pressures or ()) if points.pressure is None else []
    has_inflations = bool(listed) and (section.inflation != 1 or listed != sorted(listed))
    _check_counts(points, source.files, listed, has_inflations, place)
    is_forward = pressures is not None and not place.need_data
    if not has_inflations and (points.pressure is None or is_forward):
        return None
    return recorded_frames(points.pressure, pressures, source, section.inflation)


def _check_source(section: BubbleSection, place: Place) -> None:
    """Refuse a section whose data have two sources, or none."""
    data = section.data
    sources = [data.known_solution is not None, data.points is not None, data.has_readings]
    if sum(sources) != 1:
        problem = "expected exactly one of [bubble.data.known_solution] and [bubble.data.points]"
        raise place.error("data", f"{problem}, or tables such as [bubble.data.heights]")


def _frame_options(
    points: PointsSection,
    place: Place,
    folder: Path,
    scale: float,
) -> FrameOptions:
    """Return the options with which files are read.

    Parameters
    ----------
    scale : float
        mm per unit of length of files that do not name their unit.
    """
    columns = points.columns.model_dump(exclude_none=True)
    for quantity, column in columns.items():
        first = next(name for name in columns if columns[name] == column)
        if first != quantity:
            problem = f"column {column!r} is named for {first} and for {quantity}"
            raise place.error(f"data.points.columns.{quantity}", problem)
    reference = None
    if points.reference is not None:
        reference = folder / points.reference
        place.has(reference, "data.points.reference")  # an error where data are needed and missing
    return FrameOptions(
        QUANTITIES,
        columns or None,
        points.flag_column,
        points.comment,
        scale,
        points.valid_column,
        points.decimal,
        points.coordinates,
        points.camera_axes,
        reference=reference,
    )


def _check_counts(
    points: PointsSection,
    files: Sequence[Path],
    pressures: Sequence[float],
    has_inflations: bool,
    place: Place,
) -> None:
    """Refuse a number of files that differs from that of pressures; one may hold all frames."""
    # Where no data are needed, the files may not be there to be counted; arrays are counted before.
    if not pressures or place.measured is not None or not (files or place.need_data):
        return
    if len(files) in (1, len(pressures)):
        return
    problem = f"expected one file for each of the {len(pressures)} pressures, got {len(files)}"
    if points.files is not None:
        problem += "; [bubble.data.points.pressure] says at which pressures they were recorded"
    key = "indices" if points.files is None else "files"
    raise place.error("pressures" if has_inflations else f"data.points.{key}", problem)


def _numbered(points: PointsSection, place: Place) -> list[str]:
    """Return the names that `pattern` gives with `indices`."""
    pattern = points.pattern or ""
    if points.indices is None:
        raise place.error("data.points.indices", "this key is missing; 'pattern' needs it")
    if not re.fullmatch(INDEX_PATTERN, pattern):
        example = "expected a name with {index} in it, such as t_{index:02d}.csv"
        raise place.error("data.points.pattern", f"{example}; got {pattern!r}")
    names = [pattern.format(index=i) for i in points.indices]
    if len(set(names)) != len(names):
        problem = "the same file for several pressures; is {index} in the pattern?"
        raise place.error("data.points.pattern", problem)
    return names


def _files(points: PointsSection, place: Place, folder: Path) -> Sequence[Path]:
    """Return the files of `files`, in natural order, or those of `pattern` with its `indices`.

    `files` are names or globs; `pattern` is a template, whose files are in the order of `indices`.
    Without `place.need_data` a missing folder is no error: the project is only looked at.
    """
    advice = "--data DIR names another folder"
    if points.files is None and points.pattern is None and not place.need_data:
        return ()
    if (points.files is None) == (points.pattern is None):
        problem = "expected exactly one of 'files' and 'pattern' (with 'indices')"
        raise place.error("data.points", problem)
    if place.need_data and not os.path.isdir(folder):
        raise place.error("data.points", f"there is no folder {folder}; {advice}")
    files: Sequence[Path]
    if points.files is None:
        files = [folder / name for name in _numbered(points, place)]
    else:
        files = _matching(points.files, place, folder, advice)
    for file in files:
        place.has(file, "data.points")
    return files


def _matching(
    patterns: Sequence[str],
    place: Place,
    folder: Path,
    advice: str,
) -> Sequence[Path]:
    """Return the files that match the patterns; none if none exist and no data are needed."""
    try:
        files, _ = frame_files(patterns, "data.points.files", folder)
    except InputError as error:
        if error.path is None and not place.need_data:
            return ()
        subject = "" if error.path is None else f"{error.path} "
        raise place.error(error.field, f"{subject}{error.problem}; {advice}") from None
    return files
