"""What a finished joint study is worth, and what each data set pins down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..identification.assessment import moduli_error, pinned_by
from ..projects.joint import JointProject
from ..reports import percent
from ..runs.folder import OutputFolder
from ..runs.start import StartRecord
from .bubble_results import bubble_result, surface_warnings
from .joint_setup import JointSetup
from .results import BestFit, best_fit, common_result, save_card, summary_lines
from .uniaxial_results import rms_lines, strip_results, strip_warnings, write_loads

Array = NDArray[np.float64]
OBJECTIVE = "weighted mean relative RMS error"
#: Beyond, a data set says nothing about a modulus (1 sigma, relative).
NOTHING = 1.0


@dataclass(frozen=True, eq=False)
class JointAssessment:
    """The best fit, what each data set pins down, and result.json's content.

    pinned : by data set ("bubble", "uniaxial", "both"), relative 1 sigma of each modulus along
    the strain reached.
    """

    fit: BestFit
    offset: Array
    pinned: dict[str, dict[str, Array]]
    result: dict[str, Any]


def assess_joint(
    project: JointProject, setup: JointSetup, records: Sequence[StartRecord], wall_s: float
) -> JointAssessment:
    """Run the best fit again and gather everything that result.json says.

    Raises
    ------
    SolverFailure : the best fit does not run again (which would be a defect).
    """
    problem = setup.problem
    found = best_fit(problem, records)
    offset, pressure_offset = problem.parameters.offsets(found.best.unknowns)
    norms = problem.blocks.norms(found.best.residual)
    count = len(setup.bubble.objective.sizes)
    result = {
        **common_result("joint", project, problem, found, wall_s),
        "objective_is": OBJECTIVE,
        "mean_relative_error": {
            "bubble": float(norms[:count].sum() / project.bubble_weight),
            "uniaxial": float(norms[count:].sum() / project.uniaxial_weight),
        },
        "weights": {"bubble": project.bubble_weight, "uniaxial": project.uniaxial_weight},
        **bubble_result(project.bubble, setup.bubble, found, offset, pressure_offset),
        **strip_results(project.uniaxial, setup.uniaxial, found.best.histories[1:]),
    }
    pinned = _pinned(setup, found)
    result["pinned"] = {
        source: {
            name: {"median": float(np.median(s)), "largest": float(s.max())}
            for name, s in sigmas.items()
        }
        for source, sigmas in pinned.items()
    }
    result["warnings"] += [
        *surface_warnings(project.bubble),
        *strip_warnings(project.uniaxial, setup.uniaxial),
        *_alone(pinned),
    ]
    if setup.bubble.known is not None:
        result["moduli_error"] = moduli_error(found.law, setup.bubble.known, found.reached)
    return JointAssessment(found, offset, pinned, result)


def _pinned(setup: JointSetup, found: BestFit) -> dict[str, dict[str, Array]]:
    """By data set; empty where the solver that differentiates fails at the best fit."""
    if found.differentiated is None:
        return {}
    leading = setup.problem.surrogate or setup.problem
    strips = range(1, len(setup.problem.experiments))
    sets = {"bubble": [0], "uniaxial": [*strips], "both": [0, *strips]}
    return {
        source: pinned_by(leading, found.differentiated, found.law, found.valid, tests)
        for source, tests in sets.items()
    }


def _alone(pinned: dict[str, dict[str, Array]]) -> list[str]:
    """Moduli of which one of the data sets says nothing anywhere."""
    return [
        f"{source} alone does not determine {name} (1 sigma above {100 * NOTHING:.0f} % everywhere)"
        for source in pinned
        if source != "both"
        for name, sigma in pinned[source].items()
        if sigma.min() > NOTHING
    ]


def write_joint_numbers(
    project: JointProject, setup: JointSetup, found: JointAssessment, folder: OutputFolder
) -> None:
    """material.toml and loads.csv."""
    result = found.result
    quality = (
        f"mean |dx|+|dy|+|dz| {result['mean_abs_mm']:.4g} mm, e_uniaxial "
        f"{result['e_uniaxial_N']:.4g} N"
    )
    save_card(project, found.fit, folder, "joint", quality)
    write_loads(setup.uniaxial, found.fit.best.histories[1:], folder.path / "loads.csv")


def joint_summary(found: JointAssessment, folder: Path) -> str:
    """A few lines for the terminal."""
    result = found.result
    lines = [f"bubble: mean |dx|+|dy|+|dz| {result['mean_abs_mm']:.3g} mm", *rms_lines(result)]
    for source, sigmas in result["pinned"].items():
        parts = ", ".join(
            f"{name} {sigma_words(s['median'])} (at worst {sigma_words(s['largest'])})"
            for name, s in sigmas.items()
        )
        lines.append(f"1 sigma from {source}: {parts}")
    return summary_lines(result, found.fit, lines, folder)


def sigma_words(value: float) -> str:
    """A relative uncertainty as percent, as long as it says anything."""
    return percent(value) if value < 10 * NOTHING else "unknown"
