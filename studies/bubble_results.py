"""What a finished bubble study is worth: result.json, material card, tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..experiments.surfaces import write_surfaces
from ..identification.assessment import moduli_error
from ..projects.bubble import BubbleProject
from ..reports import percent
from ..runs.folder import OutputFolder
from ..runs.start import StartRecord
from ..writing import replacing
from .bubble_setup import BubbleSetup
from .results import BestFit, best_fit, common_result, save_card, summary_lines

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Assessment:
    """The best fit, what is a bubble's own of it, and result.json's content."""

    fit: BestFit
    offset: Array
    pressure_offset: float
    mean_absolute: float
    result: dict[str, Any]


def assess(
    project: BubbleProject, setup: BubbleSetup, records: Sequence[StartRecord], wall_s: float
) -> Assessment:
    """Run the best fit again and gather everything that result.json says.

    Raises
    ------
    SolverFailure : the best fit does not run again (which would be a defect).
    """
    problem = setup.problem
    found = best_fit(problem, records)
    offset, pressure_offset = problem.parameters.offsets(found.best.unknowns)
    result = {
        **common_result("bubble", project, problem, found, wall_s),
        "objective_is": "e of Eq. 4.8" if project.objective == "e" else "sum of RMS errors, mm",
        **bubble_result(project, setup, found, offset, pressure_offset),
    }
    result["warnings"] += surface_warnings(project)
    if setup.surfaces:
        result["surface_r_squared"] = [s.r_squared.tolist() for s in setup.surfaces]
    if setup.known is not None:
        result["moduli_error"] = moduli_error(found.law, setup.known, found.reached)
    return Assessment(found, offset, pressure_offset, result["mean_abs_mm"], result)


def bubble_result(
    project: BubbleProject,
    setup: BubbleSetup,
    found: BestFit,
    offset: Array,
    pressure_offset: float,
) -> dict[str, Any]:
    """What result.json says of the bubble, the first test of the fit, alone or beside strips."""
    displacement = found.best.histories[0].displacement
    return {
        "mean_abs_mm": setup.objective.mean_absolute(displacement, offset),
        "nuisance": nuisance_result(project, offset, pressure_offset),
        "data": data_result(project, setup),
    }


def nuisance_result(
    project: BubbleProject, offset: Array, pressure_offset: float
) -> dict[str, Any]:
    """What the nuisance parameters took, None where they are off."""
    return {
        "displacement_offset_mm": offset.tolist() if project.displacement_offset else None,
        "pressure_offset_kPa": 1e3 * pressure_offset if project.pressure_offset else None,
    }


def data_result(project: BubbleProject, setup: BubbleSetup) -> dict[str, Any]:
    """How much was matched, and what was left out."""
    return {
        "matched_by": project.match_by,
        "places": [len(t.displacement) for t in setup.objective.targets],
        "doubtful_dropped": setup.dropped,
        "outside_dropped": setup.outside,
    }


def surface_warnings(project: BubbleProject) -> list[str]:
    """What low surfaces do to the moduli."""
    if project.match_by != "surfaces" or project.match_degree >= 6:
        return []
    return [
        f"surfaces of degree {project.match_degree} bias the moduli (on the known solution "
        "G12 by 56 %, E2 by 13 % at degree 4, 16 and 1 % at degree 6); matching by points "
        "does not"
    ]


def write_numbers(
    project: BubbleProject, setup: BubbleSetup, found: Assessment, folder: OutputFolder
) -> None:
    """material.toml and surfaces.csv."""
    quality = (
        f"objective {found.fit.best.value:.4g}, mean |dx|+|dy|+|dz| {found.mean_absolute:.4g} mm"
    )
    save_card(project, found.fit, folder, "bubble", quality)
    if setup.surfaces:
        with replacing(folder.path / "surfaces.csv") as path:
            write_surfaces(setup.surfaces, path)


def summary(found: Assessment, folder: Path) -> str:
    """A few lines for the terminal."""
    result = found.result
    details = [f"mean |dx|+|dy|+|dz|: {found.mean_absolute:.3g} mm"]
    if "moduli_error" in result:
        errors = ", ".join(f"{k} {percent(v)}" for k, v in result["moduli_error"].items())
        details.append(f"largest error of the moduli over the strain reached: {errors}")
    used = {k: v for k, v in result["nuisance"].items() if v is not None}
    if used:
        details.append("nuisance: " + ", ".join(f"{k} {np.round(v, 3)}" for k, v in used.items()))
    return summary_lines(result, found.fit, details, folder)
