"""What a finished study of any kind is worth: the best fit once more, and result.json."""

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
from ..identification.assessment import Certainty, certainty
from ..identification.problem import Evaluation, FitProblem
from ..materials.card import MaterialCard, write_card
from ..materials.law import HypoelasticLaw
from ..projects.fit import FitProject
from ..runs.folder import RESULT, OutputFolder
from ..runs.start import StartRecord
from ..solvers.base import History

Array = NDArray[np.float64]

UNSTABLE = "the equilibrium at the last pressure is unstable: no test could be held there"
PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")
STRAINS = ("warp", "fill", "shear")


@dataclass(frozen=True, eq=False)
class BestFit:
    """The best fit, run once more from the unloaded state.

    differentiated : the same point by the solver that differentiates, where it could; reached
    (3,) largest strain (eps1, eps2, gamma12).
    """

    best: Evaluation
    differentiated: Evaluation | None
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None

    @property
    def valid(self) -> Array:
        """(3,) ends of the strains for which the moduli are fitted, not held."""
        return np.minimum(self.reached, self.law.strain_range)


def best_fit(problem: FitProblem, records: Sequence[StartRecord]) -> BestFit:
    """Run the best of the starts again.

    It ran once. Another program that fails now has lost its licence or its machine, most likely,
    and gets a second try.

    Raises
    ------
    SolverFailure : the best fit does not run again (of the embedded solver a defect).
    """
    ranked = ranking(records)
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # The derivatives behind what the data could not determine are the surrogate's, if there is one.
    leading = problem.surrogate or problem
    best = problem.evaluate(unknowns, leading is problem, warm=False)
    if best is None and problem.solver.external:
        best = problem.evaluate(unknowns, leading is problem, warm=False)
    if best is None:
        said = f"the best fit does not run again: {problem.failure}"
        raise SolverFailure(f"{said}; its starts are kept, --resume goes on", problem.solver.name)
    reached = np.maximum(np.max([strains_of(h) for h in best.histories], axis=0), 1e-6)
    law = problem.law.with_beta(problem.parameters.beta(unknowns))
    slopes = best if leading is problem else leading.evaluate(unknowns, True, warm=False)
    valid = np.minimum(reached, law.strain_range)
    sure = certainty(leading, slopes, law, valid) if slopes is not None else None
    return BestFit(best, slopes, law, ranked, records, reached, sure)


def ranking(records: Sequence[StartRecord]) -> list[StartRecord]:
    """The starts that ended with a fit, best first."""
    found = [r for r in records if r.objective is not None]
    return sorted(found, key=lambda r: (r.objective, r.number))


def strains_of(history: History) -> Array:
    """(3,) largest warp, fill and (either way) shear strain of an analysis."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def beyond_card(reached: Array, card: MaterialCard) -> list[str]:
    """Where strains (3,) leave the range that a card is valid for."""
    return [
        f"{name} strain {s:.3f} is beyond the card's valid range {end:.3f}: modulus held there"
        for name, s, end in zip(STRAINS, reached, card.law.strain_range, strict=True)
        if s > end * (1 + 1e-6)
    ]


def common_result(
    command: str, project: FitProject, problem: FitProblem, found: BestFit, wall_s: float
) -> dict[str, Any]:
    """What result.json says of every fit."""
    records, sure = found.records, found.certainty
    result: dict[str, Any] = {
        "command": command,
        "title": project.title,
        "solver": project.solver,
        "method": project.method,
        "objective": found.ranked[0].objective,
        "moduli": project.moduli,
        "beta": {
            "unit": project.modulus_unit,
            "values": (found.law.beta / project.modulus_scale).tolist(),
        },
        "nu12": found.law.nu12,
        "strain_reached": dict(zip(STRAINS, found.reached.tolist(), strict=True)),
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
        "analyses": sum(r.analyses for r in records),
        "external_runs": sum(r.external_runs for r in records),
        "warnings": _warnings(project, problem, found),
        "wall_s": wall_s,
        "versions": versions(),
    }
    if project.breaks is not None:
        result["breaks"] = dict(zip(STRAINS, project.breaks.tolist(), strict=True))
    if sure is not None:
        result["uncertainty"] = {
            "noise": sure.noise,
            "largest_relative_sigma": {n: float(s.max()) for n, s in sure.sigma.items()},
            "median_relative_sigma": {n: float(np.median(s)) for n, s in sure.sigma.items()},
        }
    return result


def _warnings(project: FitProject, problem: FitProblem, found: BestFit) -> list[str]:
    words = list(found.certainty.undetermined) if found.certainty is not None else []
    if not found.best.stable:
        words.append(UNSTABLE)
    several = len(problem.experiments) > 1
    for experiment, history in zip(problem.experiments, found.best.histories, strict=True):
        where = f" in the {experiment.name} test" if several else ""
        for name, strain, end in zip(
            STRAINS, strains_of(history), project.strain_range, strict=True
        ):
            if strain > end * (1 + 1e-6):
                words.append(
                    f"{name} strain reached {strain:.3f}{where}, beyond material.strain_range "
                    f"{end:.4g}: the modulus was held at its end value there; "
                    + ("a wider range would let it vary" if several else "widen the range")
                )
    return words


def versions() -> dict[str, str]:
    """Of what computes, by name."""
    found = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **found}


def save_card(
    project: FitProject, found: BestFit, folder: OutputFolder, command: str, quality: str
) -> None:
    """Write material.toml; it is valid for the strains reached."""
    card = MaterialCard(
        replace(found.law, strain_range=found.valid),
        project.thickness,
        project.title,
        f"bubblefit {__version__} {command}, {project.path.name}, {quality}",
    )
    write_card(card, folder.path / "material.toml", project.modulus_unit)


def write_result(result: dict[str, Any], folder: OutputFolder) -> None:
    """result.json, after everything else: where it is, the output is complete."""
    folder.write(RESULT, json.dumps(result, indent=1, allow_nan=False) + "\n")


def summary_lines(
    result: dict[str, Any], found: BestFit, details: Sequence[str], folder: Path
) -> str:
    """A few lines for the terminal: how good, `details`, what to know, where it is."""
    runs = result["external_runs"]
    external = f" ({runs} of {result['solver']})" if runs else ""
    middle = float(np.median([r.objective for r in found.ranked if r.objective is not None]))
    lines = [
        f"best {result['objective_is']}: {found.best.value:.3g} (median {middle:.3g} of "
        f"{len(found.ranked)} starts, {len(found.records)} asked), {result['analyses']} "
        f"analyses{external}, {result['wall_s']:.0f} s",
        *details,
        *(f"note: {w}" for w in result["warnings"]),
        f"written to {folder} (open report.html)",
    ]
    return "\n".join(lines)
