"""Where a bubble test's data come from: a known solution, or files of measured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...data.fields import QUANTITIES as FIELD
from ...data.frame_files import frame_files
from ...data.frames import FrameOptions
from ...data.registration.register import RegistrationOptions
from ...errors import InputError
from ...sections import LENGTH_UNITS
from ..base import Place
from ..formats import named_format
from .recorded import RecordedFrames, recorded_frames
from .registration_section import registration_options
from .section import BubbleSection, KnownSolutionSection, PointsSection


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """Data to be computed by the forward model.

    beta : MPa, of the form `form`. elements : of the full disk. increments : MPa, containing the
    pressures. solver : who computes them, the one that fits unless named.
    """

    beta: NDArray[np.float64]
    form: str
    elements: int
    increments: tuple[float, ...]
    symmetry: Literal["full", "quarter"]
    solver: str | None = None


@dataclass(frozen=True)
class PointFiles:
    """Measured displacements: files in the order of the pressures, and how they are read.

    recorded : which of their frames are taken, and at which pressures; None where the pressures are
    the project's own, one a frame.
    """

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None = None
    registration: RegistrationOptions | None = None
    recorded: RecordedFrames | None = None


def data_source(
    section: BubbleSection,
    place: Place,
    pressures: Sequence[float],
    increments: Sequence[float],
    measured: PointFiles | None,
) -> KnownSolution | PointFiles:
    """What was measured, or the known solution; pressures and increments are in MPa.

    Raises
    ------
    InputError : a folder of files for computed data, more or fewer files than pressures.
    """
    known, points = section.data.known_solution, section.data.points
    if known is not None:
        return _known(section, known, place, pressures, increments)
    assert points is not None and measured is not None
    found, count = len(measured.files), len(pressures)
    # Where no data are needed, the files may not be there to be counted.
    counted = place.need_data or found
    if (
        measured.recorded is None
        and points.pressure is None
        and counted
        and found not in (count, 1)
    ):
        field = "data.points.files" if points.files is not None else "data.points.indices"
        problem = f"expected one file for each of the {count} pressures, got {found}"
        if points.files is not None:
            problem += "; [bubble.data.points.pressure] says at which pressures they were recorded"
        raise place.error(field, problem)
    return measured


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


def merge_increments(
    place: Place,
    field: str,
    extra: Sequence[float],
    pressures: Sequence[float],
) -> tuple[float, ...]:
    """Load steps (MPa): the pressures (MPa) and the extra ones (in the file's unit) between."""
    steps = list(pressures)
    for i, step in enumerate(extra):
        value = step * place.scales.pressure
        if value > pressures[-1] * (1 + 1e-9):
            problem = f"expected a step up to the last pressure, got {step:g} beyond it"
            raise place.error(f"{field}[{i}]", problem)
        # 22 kPa written twice must not become two steps one rounding error apart.
        if not np.isclose(steps, value, rtol=1e-9, atol=0.0).any():
            steps.append(value)
    return tuple(sorted(steps))


def _known(
    section: BubbleSection,
    known: KnownSolutionSection,
    place: Place,
    pressures: Sequence[float],
    increments: Sequence[float],
) -> KnownSolution:
    field = "data.known_solution"
    if known.increments is not None:
        increments = merge_increments(place, f"{field}.increments", known.increments, pressures)
    return KnownSolution(
        beta=np.array(known.beta) * place.scales.modulus,
        form=known.form,
        elements=known.elements or section.elements,
        increments=tuple(increments),
        symmetry=known.symmetry or section.symmetry,
        solver=known.solver,
    )


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
        names = [pattern.format(index=i) for i in points.indices]
    except (KeyError, IndexError, ValueError, AttributeError):
        problem = (
            f"expected a name with {{index}} in it, such as t_{{index:02d}}.csv; got {pattern!r}"
        )
        raise place.error("data.points.pattern", problem) from None
    if len(set(names)) != len(names):
        problem = "the same file for several pressures; is {index} in the pattern?"
        raise place.error("data.points.pattern", problem)
    return names


def _files(points: PointsSection, place: Place) -> tuple[Path, ...]:
    """The files, patterns in `files` put into the natural order of what they match."""
    names = _file_names(points, place)
    folder = _folder(points, place)
    advice = "give the folder of the measured data with --data DIR"
    needed = place.need_data
    if needed and not folder.is_dir():
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
        if needed and not file.is_file():
            raise place.error("data.points", f"there is no file {file}; {advice}")
    return tuple(files)


def in_section(place: Place, error: InputError) -> InputError:
    """An error about the test's data or settings as one that names the test's section."""
    return place.error(error.field, error.problem)
