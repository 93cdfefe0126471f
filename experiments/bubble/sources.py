"""Where a bubble test's data come from: a known solution, or files of measured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...data.fields import QUANTITIES as FIELD
from ...data.frames import FrameOptions
from ...data.registration.register import RegistrationOptions
from ...errors import InputError
from ...sections import LENGTH_UNITS
from ..base import Place
from ..formats import named_format
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
    """Measured displacements: files in the order of the pressures, and how they are read."""

    files: tuple[Path, ...]
    options: FrameOptions
    format: str | None = None
    registration: RegistrationOptions | None = None


def data_source(
    section: BubbleSection,
    place: Place,
    pressures: Sequence[float],
    increments: Sequence[float],
) -> KnownSolution | PointFiles:
    """The one sub-table of [bubble.data], converted; pressures and increments are in MPa.

    Raises
    ------
    InputError : both or none, a folder of files for computed data, files that are not there.
    """
    known, points = section.data.known_solution, section.data.points
    if (known is None) == (points is None):
        problem = "expected exactly one of [bubble.data.known_solution] and [bubble.data.points]"
        raise place.error("data", problem)
    if known is not None:
        return _known(section, known, place, pressures, increments)
    assert points is not None
    return _points(points, place, len(pressures))


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


def _points(points: PointsSection, place: Place, count: int) -> PointFiles:
    names = _file_names(points, place)
    columns = points.columns.model_dump(exclude_none=True)
    for name, column in columns.items():
        first = next(other for other in columns if columns[other] == column)
        if first != name:
            problem = f"column {column!r} is named for {first} and for {name}"
            raise place.error(f"data.points.columns.{name}", problem)
    if len(names) != count and len(names) != 1:
        field = "data.points.files" if points.files is not None else "data.points.indices"
        problem = f"expected one file for each of the {count} pressures, got {len(names)}"
        raise place.error(field, problem)
    folder = place.path.parent / points.folder
    if place.data_folder is not None:
        folder = Path(place.data_folder)
    files = tuple(folder / name for name in names)
    if place.need_data:
        _check_there(place, folder, files)
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


def _check_there(place: Place, folder: Path, files: Sequence[Path]) -> None:
    advice = "give the folder of the measured data with --data DIR"
    if not folder.is_dir():
        raise place.error("data.points", f"there is no folder {folder}; {advice}")
    for file in files:
        if not file.is_file():
            raise place.error("data.points", f"there is no file {file}; {advice}")


def in_section(place: Place, error: InputError) -> InputError:
    """An error about the test's data or settings as one that names the test's section."""
    return place.error(error.field, error.problem)
