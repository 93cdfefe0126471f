"""What a finished bubble study is worth: result.json, material card, tables."""

from __future__ import annotations

import importlib.metadata
import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..errors import SolverFailure
from ..experiments.surfaces import write_surfaces
from ..identification.assessment import Certainty, certainty, moduli_error
from ..identification.problem import Evaluation
from ..materials.card import MaterialCard, write_card
from ..materials.law import HypoelasticLaw
from ..runs.folder import RESULT, OutputFolder
from ..runs.start import StartRecord
from ..writing import replacing
from .bubble_setup import BubbleSetup
from .project import BubbleProject

Array = NDArray[np.float64]

UNSTABLE = "the equilibrium at the last pressure is unstable: no test could be held there"
PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")


@dataclass(frozen=True, eq=False)
class Assessment:
    """The best fit, run once more from the flat state, and result.json's content."""

    best: Evaluation
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None
    offset: Array
    pressure_offset: float
    mean_absolute: float
    result: dict[str, Any]


def assess(
    project: BubbleProject,
    setup: BubbleSetup,
    records: Sequence[StartRecord],
    ranked: Sequence[StartRecord],
    wall_s: float,
) -> Assessment:
    """Run the best fit again and gather everything that result.json says.

    Raises
    ------
    SolverFailure : the best fit does not run again (which would be a defect).
    """
    problem = setup.problem
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # The derivatives behind what the data could not determine are the surrogate's, if there is one.
    leading = problem.surrogate or problem
    best = problem.evaluate(unknowns, leading is problem, warm=False)
    if best is None:
        raise SolverFailure("the best fit does not run again", problem.solver.name)
    history = best.histories[0]
    reached = np.array([history.strain_max[0], history.strain_max[1], 0.0])
    reached[2] = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    reached = np.maximum(reached, 1e-6)
    law = problem.law.with_beta(problem.parameters.beta(unknowns))
    slopes = best if leading is problem else leading.evaluate(unknowns, True, warm=False)
    sure = certainty(leading, slopes, law, reached) if slopes is not None else None
    offset, pressure_offset = problem.parameters.offsets(unknowns)
    mean = setup.objective.mean_absolute(history.displacement, offset)
    analyses = sum(r.analyses for r in records)
    scale = project.modulus_scale
    result: dict[str, Any] = {
        "command": "bubble",
        "title": project.title,
        "solver": project.solver,
        "method": project.method,
        "objective": ranked[0].objective,
        "objective_is": "e of Eq. 4.8" if project.objective == "e" else "sum of RMS errors, mm",
        "mean_abs_mm": mean,
        "beta": {"unit": project.modulus_unit, "values": (law.beta / scale).tolist()},
        "nu12": law.nu12,
        "nuisance": {
            "displacement_offset_mm": offset.tolist() if project.displacement_offset else None,
            "pressure_offset_kPa": 1e3 * pressure_offset if project.pressure_offset else None,
        },
        "strain_reached": dict(zip(("warp", "fill", "shear"), reached.tolist(), strict=True)),
        "seed": project.seed,
        "starts": [
            {
                "start": r.number,
                "seed": list(r.seed),
                "objective": r.objective,
                "status": r.status,
                "analyses": r.analyses,
                "external_runs": r.external_runs,
            }
            for r in records
        ],
        "analyses": analyses,
        "external_runs": sum(r.external_runs for r in records),
        "data": {
            "matched_by": project.match_by,
            "places": [len(t.displacement) for t in setup.objective.targets],
            "doubtful_dropped": setup.dropped,
            "outside_dropped": setup.outside,
        },
        "warnings": _warnings(project, best, sure, reached),
        "wall_s": wall_s,
        "versions": _versions(),
    }
    if setup.surfaces:
        result["surface_r_squared"] = [s.r_squared.tolist() for s in setup.surfaces]
    if setup.known is not None:
        result["moduli_error"] = moduli_error(law, setup.known, reached)
    if sure is not None:
        result["uncertainty"] = {
            "noise_mm": sure.noise["bubble"],
            "largest_relative_sigma": {n: float(s.max()) for n, s in sure.sigma.items()},
            "median_relative_sigma": {n: float(np.median(s)) for n, s in sure.sigma.items()},
        }
    return Assessment(
        best, law, ranked, records, reached, sure, offset, pressure_offset, mean, result
    )


def _warnings(
    project: BubbleProject, best: Evaluation, sure: Certainty | None, reached: Array
) -> list[str]:
    words = list(sure.undetermined) if sure is not None else []
    if not best.stable:
        words.append(UNSTABLE)
    for name, strain, end in zip(
        ("warp", "fill", "shear"), reached, project.strain_range, strict=True
    ):
        if strain > end:
            words.append(
                f"{name} strain reached {strain:.3f}, beyond material.strain_range {end:g}: the "
                "modulus was held at its end value there; widen the range"
            )
    if project.match_by == "surfaces" and project.match_degree < 6:
        words.append(
            f"surfaces of degree {project.match_degree} bias the moduli (on the known solution "
            "G12 by 56 %, E2 by 13 % at degree 4, 16 and 1 % at degree 6); matching by points "
            "does not"
        )
    return words


def _versions() -> dict[str, str]:
    found = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **found}


def write_numbers(
    project: BubbleProject, setup: BubbleSetup, found: Assessment, folder: OutputFolder
) -> None:
    """material.toml and surfaces.csv."""
    limits = np.minimum(found.reached, project.strain_range)
    card = MaterialCard(
        replace(found.law, strain_range=limits),
        project.thickness,
        project.title,
        f"bubblefit {__version__} bubble, {project.path.name}, objective {found.best.value:.4g}, "
        f"mean |dx|+|dy|+|dz| {found.mean_absolute:.4g} mm",
    )
    write_card(card, folder.path / "material.toml", project.modulus_unit)
    if setup.surfaces:
        with replacing(folder.path / "surfaces.csv") as path:
            write_surfaces(setup.surfaces, path)


def write_result(found: Assessment, folder: OutputFolder) -> None:
    """result.json, after everything else: where it is, the output is complete."""
    folder.write(RESULT, json.dumps(found.result, indent=1, allow_nan=False) + "\n")


def summary(found: Assessment, folder: Path) -> str:
    """A few lines for the terminal."""
    result = found.result
    count = len(found.records)
    runs = result["external_runs"]
    external = f" ({runs} of {result['solver']})" if runs else ""
    middle = float(np.median([r.objective for r in found.ranked if r.objective is not None]))
    lines = [
        f"best {result['objective_is']}: {found.best.value:.3g} (median {middle:.3g} of "
        f"{len(found.ranked)} starts, {count} asked), {result['analyses']} analyses{external}, "
        f"{result['wall_s']:.0f} s",
        f"mean |dx|+|dy|+|dz|: {found.mean_absolute:.3g} mm",
    ]
    if "moduli_error" in result:
        errors = ", ".join(f"{k} {100 * v:.2g} %" for k, v in result["moduli_error"].items())
        lines.append(f"largest error of the moduli over the strain reached: {errors}")
    used = {k: v for k, v in result["nuisance"].items() if v is not None}
    if used:
        lines.append("nuisance: " + ", ".join(f"{k} {np.round(v, 3)}" for k, v in used.items()))
    lines += [f"note: {w}" for w in result["warnings"]]
    lines.append(f"written to {folder} (open report.html)")
    return "\n".join(lines)
