"""The project file of a bubble fit, read and converted to mm, N, MPa."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..models.bubble import default_increments
from .bubble_data import KnownSolution, PointFiles, locate_data, merge_increments
from .fit import FitProject, common_settings, parse
from .schema import LENGTH_UNITS, PRESSURE_UNITS, ProjectFile


@dataclass(frozen=True, eq=False, kw_only=True)
class BubbleProject(FitProject):
    """What a bubble fit is asked to do. Lengths mm, pressures and moduli MPa, angles none.

    `pressures` are reported and matched, `increments` are the load steps and contain them.
    """

    radius: float
    elements: int
    symmetry: Literal["full", "quarter"]
    generator: Literal["blocks", "gmsh"]
    pressures: tuple[float, ...]
    increments: tuple[float, ...]
    data: KnownSolution | PointFiles
    match_by: Literal["surfaces", "points"]
    match_degree: int
    objective: Literal["e", "mm"]
    displacement_offset: bool
    pressure_offset: bool


def read_project(
    path: Path, data_folder: Path | None = None, need_data: bool = True
) -> BubbleProject:
    """Read a project file (TOML).

    Parameters
    ----------
    path : the file.
    data_folder : where measured files lie; replaces `data.points.folder`.
    need_data : whether measured files must be there (a forward analysis does without).

    Raises
    ------
    InputError : one line naming the file and the dotted key: TOML syntax, missing or unknown
        keys, wrong units, values out of order, missing data.
    """
    path = Path(path)
    file = parse(path, {"bubble": ProjectFile})
    settings = bubble_settings(path, file, data_folder, need_data)
    common = common_settings(path, file)
    return BubbleProject(**common, **settings, objective=file.fit.objective)


def bubble_settings(
    path: Path, file: ProjectFile, data_folder: Path | None, need_data: bool
) -> dict[str, Any]:
    """The fields of `BubbleProject` that the bubble's own sections give."""
    bubble = file.bubble
    length = LENGTH_UNITS[file.units.length]
    pressure = PRESSURE_UNITS[file.units.pressure]
    pressures = _pressures(path, bubble.pressures, pressure)
    increments = default_increments(pressures)
    if bubble.increments is not None:
        increments = merge_increments(
            path, "bubble.increments", bubble.increments, pressure, pressures
        )
    if bubble.thickness >= bubble.radius:
        problem = f"expected less than the radius {bubble.radius:g}, got {bubble.thickness:g}"
        raise InputError(path, "bubble.thickness", f"{problem} {file.units.length}")
    return {
        "radius": bubble.radius * length,
        "thickness": bubble.thickness * length,
        "elements": bubble.elements,
        "symmetry": bubble.symmetry,
        "generator": bubble.generator,
        "pressures": pressures,
        "increments": increments,
        "data": locate_data(path, file, pressures, increments, data_folder, need_data),
        "match_by": file.match.by,
        "match_degree": file.match.degree,
        **file.fit.nuisance.model_dump(),
    }


def _pressures(path: Path, given: list[float], scale: float) -> tuple[float, ...]:
    for i in range(1, len(given)):
        if given[i] <= given[i - 1]:
            problem = f"pressures must increase, got {given[i]:g} after {given[i - 1]:g}"
            raise InputError(path, f"bubble.pressures[{i}]", problem)
    return tuple(p * scale for p in given)
