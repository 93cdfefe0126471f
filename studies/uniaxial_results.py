"""What a finished uniaxial study is worth: three RMS errors beside the specimen scatter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..experiments.tables import write_table
from ..projects.uniaxial import UniaxialProject
from ..runs.folder import OutputFolder
from ..runs.start import StartRecord
from ..solvers.base import History
from ..writing import replacing
from .results import BestFit, best_fit, common_result, save_card, summary_lines
from .uniaxial_setup import UniaxialSetup

OBJECTIVES = {
    "N": "e_uniaxial of Eq. 3.7, N",
    "relative": "sum of RMS errors over the largest load",
}


@dataclass(frozen=True, eq=False)
class UniaxialAssessment:
    """The best fit and result.json's content."""

    fit: BestFit
    result: dict[str, Any]


def assess_uniaxial(
    project: UniaxialProject, setup: UniaxialSetup, records: Sequence[StartRecord], wall_s: float
) -> UniaxialAssessment:
    """Run the best fit again and gather everything that result.json says.

    Raises
    ------
    SolverFailure : the best fit does not run again (which would be a defect).
    """
    found = best_fit(setup.problem, records)
    result = {
        **common_result("uniaxial", project, setup.problem, found, wall_s),
        "objective_is": OBJECTIVES[project.objective],
        **strip_results(project, setup, found.best.histories),
    }
    result["warnings"] += strip_warnings(project, setup)
    return UniaxialAssessment(found, result)


def strip_results(
    project: UniaxialProject, setup: UniaxialSetup, histories: Sequence[History]
) -> dict[str, Any]:
    """The tests one by one: e_warp, e_fill, e_bias and the scatter they stand beside."""
    tests, total = {}, 0.0
    for strip, objective, history in zip(setup.strips, setup.objectives, histories, strict=True):
        rms = objective.rms(history)
        total += rms
        tests[strip.direction] = {
            "rms_N": rms,
            "scatter_N": strip.scatter,
            "weight": project.weights[strip.direction],
            "matched": len(objective.load),
            "gauge_length_mm": strip.gauge_length,
            "final_length_mm": strip.final_length,
            "end_load_N": float(history.load[-1]),
        }
    return {"tests": tests, "e_uniaxial_N": total, "matched_by": project.match_by}


def strip_warnings(project: UniaxialProject, setup: UniaxialSetup) -> list[str]:
    """What the data leave open before any fit."""
    words = []
    directions = {s.direction for s in setup.strips}
    for direction, modulus in (("warp", "E1"), ("fill", "E2"), ("bias", "G12")):
        if direction not in directions:
            words.append(f"no {direction} test is matched: {modulus} rests on the other tests")
    for strip in setup.strips:
        beyond = sum(len(c.load) for c in strip.curves) - len(strip.points[0])
        if beyond and project.match_by == "points":
            words.append(
                f"{strip.direction}: {beyond} points beyond the final length (or before zero) "
                "were left out"
            )
    return words


def write_uniaxial_numbers(
    project: UniaxialProject, setup: UniaxialSetup, found: UniaxialAssessment, folder: OutputFolder
) -> None:
    """material.toml and loads.csv."""
    errors = ", ".join(f"{d} {t['rms_N']:.4g}" for d, t in found.result["tests"].items())
    save_card(project, found.fit, folder, "uniaxial", f"RMS errors in N: {errors}")
    write_loads(setup, found.fit.best.histories, folder.path / "loads.csv")


def write_loads(setup: UniaxialSetup, histories: Sequence[History], path: Path) -> None:
    """Load curves of the model, and the polynomials where there are any."""
    header = ["direction", "elongation_mm", "engineering_strain", "model_N", "polynomial_N"]
    rows: list[list[object]] = []
    for strip, model, history in zip(setup.strips, setup.models, histories, strict=True):
        u = np.array(model.elongations)
        known = None if strip.polynomial is None else strip.polynomial(u)
        for i, load in enumerate(history.load):
            target = "" if known is None else float(known[i])
            strain = float(u[i] / strip.gauge_length)
            rows.append([strip.direction, float(u[i]), strain, float(load), target])
    with replacing(path) as temporary:
        write_table(temporary, header, rows)


def rms_lines(result: dict[str, Any]) -> list[str]:
    """e_warp, e_fill, e_bias for the terminal."""
    parts = []
    for direction, test in result["tests"].items():
        scatter = test["scatter_N"]
        beside = "" if scatter is None else f" (specimens scatter by {scatter:.3g})"
        parts.append(f"{direction} {test['rms_N']:.3g}{beside}")
    return ["RMS error, N: " + ", ".join(parts) + f"; sum {result['e_uniaxial_N']:.4g}"]


def uniaxial_summary(found: UniaxialAssessment, folder: Path) -> str:
    """A few lines for the terminal."""
    return summary_lines(found.result, found.fit, rms_lines(found.result), folder)
