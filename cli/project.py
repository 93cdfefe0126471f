"""The project file of a bubble fit, read and converted to mm, N, MPa."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ..errors import InputError
from ..models.bubble import default_increments
from .project_data import KnownSolution, PointFiles, locate_data, merge_increments
from .project_errors import first_error
from .project_schema import (
    LENGTH_UNITS,
    MODULUS_UNITS,
    PRESSURE_UNITS,
    CalculixSection,
    ProjectFile,
)

Array = NDArray[np.float64]

#: Most analyses of one start, unless the file says otherwise.
DEFAULT_ANALYSES = {"lm": 100, "slsqp": 500, "cobyla": 2000}
#: Smallest modulus allowed anywhere on the strain range (MPa), unless the file says otherwise.
DEFAULT_MARGIN_E, DEFAULT_MARGIN_G = 5.0, 0.5
#: End of the strain range of constant moduli: nothing is held there.
CONSTANT_RANGE = 1.0


@dataclass(frozen=True, eq=False)
class BubbleProject:
    """What a bubble fit is asked to do. Lengths mm, pressures and moduli MPa, angles none.

    `lower`, `upper` : (3 (degree + 1),) bounds in the order of Table 4.2 (G12, E2, E1, highest
    power first). `free` : their places in the full beta (12,). `pressures` are reported and
    matched, `increments` are the load steps and contain them. `strain_range` : ends
    (eps1, eps2, gamma12). `margin_E`, `margin_G` : smallest modulus allowed on that range.
    `solver_options` : by name of a solver, what its constructor is given.
    `modulus_unit`, `modulus_scale` : unit of the file and MPa per unit, for output in kind.

    Raises
    ------
    InputError : settings that contradict each other (also after `dataclasses.replace`).
    """

    path: Path
    title: str
    radius: float
    thickness: float
    elements: int
    symmetry: Literal["full", "quarter"]
    generator: Literal["blocks", "gmsh"]
    pressures: tuple[float, ...]
    increments: tuple[float, ...]
    nu12: float
    thickness_change: Literal["constant", "incompressible"]
    degree: int
    strain_range: tuple[float, float, float]
    lower: Array
    upper: Array
    data: KnownSolution | PointFiles
    match_by: Literal["surfaces", "points"]
    match_degree: int
    starts: int
    seed: int
    method: str
    gradient: Literal["exact", "differences"]
    constraints: Literal["margin", "boolean"]
    margin_E: float
    margin_G: float
    solver: str
    objective: Literal["e", "mm"]
    analyses_given: int | None
    tolerance: float
    displacement_offset: bool
    pressure_offset: bool
    modulus_unit: str
    modulus_scale: float
    solver_options: Mapping[str, Mapping[str, Any]]

    def __post_init__(self) -> None:
        if self.method == "lm" and self.constraints == "boolean":
            problem = "boolean flags have no slope: use 'margin' with method 'lm', or 'slsqp'"
            raise InputError(self.path, "fit.constraints", problem + " or 'cobyla'")

    @property
    def max_analyses(self) -> int:
        """Most analyses of one start; the method's own default unless the file names it."""
        return self.analyses_given or DEFAULT_ANALYSES[self.method]

    @property
    def free(self) -> tuple[int, ...]:
        """Place of each fitted coefficient in the full beta (12,)."""
        return free_coefficients(self.degree)

    def full_beta(self, coefficients: Array) -> Array:
        """Fitted coefficients (3 (degree + 1),) as the full beta (12,), zeros elsewhere."""
        beta = np.zeros(12)
        beta[list(self.free)] = coefficients
        return beta


def free_coefficients(degree: int) -> tuple[int, ...]:
    """Places of the coefficients of degree-`degree` moduli in beta_0 ... beta_11."""
    return tuple(4 * m + k for m in range(3) for k in range(3 - degree, 4))


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
    file = _parse(path)
    bubble, material, fit = file.bubble, file.material, file.fit
    modulus = MODULUS_UNITS[file.units.modulus]
    length = LENGTH_UNITS[file.units.length]
    pressure = PRESSURE_UNITS[file.units.pressure]
    pressures = _pressures(path, bubble.pressures, pressure)
    increments = default_increments(pressures)
    if bubble.increments is not None:
        increments = merge_increments(
            path, "bubble.increments", bubble.increments, pressure, pressures
        )
    lower, upper = _bounds(path, file, modulus)
    if bubble.thickness >= bubble.radius:
        problem = f"expected less than the radius {bubble.radius:g}, got {bubble.thickness:g}"
        raise InputError(path, "bubble.thickness", f"{problem} {file.units.length}")
    return BubbleProject(
        path=path,
        title=file.project.title or path.parent.resolve().name,
        radius=bubble.radius * length,
        thickness=bubble.thickness * length,
        elements=bubble.elements,
        symmetry=bubble.symmetry,
        generator=bubble.generator,
        pressures=pressures,
        increments=increments,
        nu12=material.nu12,
        thickness_change=material.thickness_change,
        degree=material.degree,
        strain_range=_strain_range(path, file),
        lower=lower,
        upper=upper,
        data=locate_data(path, file, pressures, increments, data_folder, need_data),
        match_by=file.match.by,
        match_degree=file.match.degree,
        starts=fit.starts,
        seed=fit.seed,
        method=fit.method,
        gradient=fit.gradient,
        constraints=fit.constraints,
        margin_E=fit.margin.E * modulus if fit.margin else DEFAULT_MARGIN_E,
        margin_G=fit.margin.G12 * modulus if fit.margin else DEFAULT_MARGIN_G,
        solver=fit.solver,
        objective=fit.objective,
        analyses_given=fit.max_analyses,
        tolerance=fit.tolerance,
        displacement_offset=fit.nuisance.displacement_offset,
        pressure_offset=fit.nuisance.pressure_offset,
        modulus_unit=file.units.modulus,
        modulus_scale=modulus,
        solver_options={"calculix": _calculix(path, file.solver.calculix)},
    )


def _calculix(path: Path, section: CalculixSection) -> dict[str, Any]:
    """Options of CalculixSolver; paths in a project file are beside that file."""
    options = section.model_dump()
    for name in ("templates", "scratch"):
        if options[name] is not None:
            options[name] = path.parent / options[name]
    # A bare name is a program on the PATH.
    if options["ccx"] is not None and os.sep in options["ccx"]:
        options["ccx"] = path.parent / os.path.expanduser(options["ccx"])
    return options


def _parse(path: Path) -> ProjectFile:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        problem = "no such file; `bubblefit init DIR` writes an example to start from"
        raise InputError(path, "", problem) from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", "is not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, "TOML syntax", str(error)) from None
    try:
        return ProjectFile.model_validate(content)
    except ValidationError as found:
        raise first_error(path, found) from None


def _pressures(path: Path, given: list[float], scale: float) -> tuple[float, ...]:
    for i in range(1, len(given)):
        if given[i] <= given[i - 1]:
            problem = f"pressures must increase, got {given[i]:g} after {given[i - 1]:g}"
            raise InputError(path, f"bubble.pressures[{i}]", problem)
    return tuple(p * scale for p in given)


def _strain_range(path: Path, file: ProjectFile) -> tuple[float, float, float]:
    ends = file.material.strain_range
    if ends is None:
        if file.material.degree > 0:
            problem = (
                "this key is missing; give the ends [warp, fill, shear], such as [0.13, 0.13, 0.13]"
            )
            raise InputError(path, "material.strain_range", problem)
        ends = [CONSTANT_RANGE] * 3
    return ends[0], ends[1], ends[2]


def _bounds(path: Path, file: ProjectFile, modulus: float) -> tuple[Array, Array]:
    places = free_coefficients(file.material.degree)
    for name in ("lower", "upper"):
        count = len(getattr(file.bounds, name))
        if count != len(places):
            problem = (
                f"expected {len(places)} coefficients (3 moduli of degree {file.material.degree}"
                f" as G12, E2, E1), got {count}"
            )
            raise InputError(path, f"bounds.{name}", problem)
    lower, upper = np.array(file.bounds.lower), np.array(file.bounds.upper)
    for i in np.flatnonzero(lower > upper):
        problem = (
            f"bounds of beta_{places[i]} are crossed: lower {lower[i]:g} is above upper"
            f" {upper[i]:g} {file.units.modulus}"
        )
        raise InputError(path, f"bounds.lower[{i}]", problem)
    return lower * modulus, upper * modulus
