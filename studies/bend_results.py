"""What a study of bending found: how every run ended, its numbers, result.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..projects.bend import BendProject
from ..runs.bend_run import BendRun
from .bend_measures import PLACES, BendMeasures, Point, bend_measures
from .bend_setup import Pair
from .bend_statements import Statement, statements
from .results import STRAINS, beyond_card, versions

#: What the solvers' remark on a run that stopped early says.
EARLY = "stopped early"


@dataclass(frozen=True, eq=False)
class BendOutcome:
    """All pairs with how they ended; measures of those that ended well; the statements."""

    pairs: Sequence[Pair]
    runs: Sequence[BendRun]
    measures: Mapping[int, BendMeasures]
    statements: Sequence[Statement]

    def ended(self, number: int) -> str:
        """ "finished", or how far a run came or why not."""
        pair, run = self.pairs[number], self.runs[number]
        if run.failed:
            return f"failed: {run.failed}"
        whole = pair.case.deflections[-1]
        if run.deflection[-1] >= whole * (1 - 1e-9):
            return "finished"
        why = next((f": {r}" for r in run.remarks if EARLY in r), "")
        return f"stopped at {run.deflection[-1]:g} of {whole:g} mm{why}"

    def notes(self, number: int) -> list[str]:
        """What a reader of a run's numbers should know."""
        run, card = self.runs[number], self.pairs[number].card
        if run.failed:
            return []
        shear = max(abs(run.strain_min[2]), abs(run.strain_max[2]))
        reached = np.array([run.strain_max[0], run.strain_max[1], shear])
        return [*run.remarks, *beyond_card(reached, card)]

    @property
    def worst(self) -> float | None:
        """Largest RMS error over the largest load measured; None where nothing is compared."""
        errors = [m.error.relative for m in self.measures.values() if m.error is not None]
        return max(errors, default=None)


def outcome_of(project: BendProject, pairs: Sequence[Pair], runs: Sequence[BendRun]) -> BendOutcome:
    """Measure every run that ended well, and check the thesis' statements on them."""
    measures = {
        i: bend_measures(pair.model().mesh, run, pair.case.measured)
        for i, (pair, run) in enumerate(zip(pairs, runs, strict=True))
        if not run.failed
    }
    found = {(pairs[i].case.name, pairs[i].name): m for i, m in measures.items()}
    return BendOutcome(pairs, runs, measures, statements(project, found))


def bend_result(
    command: str, project: BendProject, outcome: BendOutcome, wall_s: float
) -> dict[str, Any]:
    """result.json."""
    return {
        "command": command,
        "title": project.title,
        "solver": project.solver,
        "cases": [
            {
                "case": case.name,
                "diameter_mm": case.diameter,
                "pressure_kPa": 1e3 * case.pressure,
                "length_mm": case.length,
                "seam_width_mm": case.seam_width,
                "element_size_mm": case.size,
                "symmetry": case.symmetry,
                "supports": asdict(case.supports),
                "collar": asdict(case.collar),
                "repetitions": len(case.measured),
            }
            for case in project.cases
        ],
        "runs": [_run(outcome, i) for i in range(len(outcome.pairs))],
        "worst_relative_error": outcome.worst,
        "statements": [
            {"thesis": s.thesis, "found": s.found, "verdict": s.verdict} for s in outcome.statements
        ],
        "wall_s": wall_s,
        "versions": versions(),
    }


def _run(outcome: BendOutcome, number: int) -> dict[str, Any]:
    pair, run, found = outcome.pairs[number], outcome.runs[number], outcome.measures.get(number)
    said: dict[str, Any] = {
        "case": pair.case.name,
        "card": pair.name,
        "ended": outcome.ended(number),
        "seconds": run.seconds,
    }
    if found is None:
        return said
    error = found.error
    return {
        **said,
        "reached_mm": found.reached,
        "stiffness_N_per_mm": found.stiffness,
        "buckling": {"is": found.buckling_is, **_point(found.buckling)},
        "knee": _point(found.knee),
        "limit_point": _point(found.limit),
        "wrinkle_onset": _point(found.wrinkles),
        "load_N": {f"{p:g} mm": load for p, load in zip(PLACES, found.loads, strict=True)},
        "inflation_strain": {
            "body": dict(zip(STRAINS, found.body_strain, strict=False)),
            "with_seam_and_ends": dict(zip(STRAINS, found.anywhere_strain, strict=False)),
        },
        "straight_before_buckling": None
        if found.straightness is None
        else {"r_squared": found.straightness[0], "largest_deviation": found.straightness[1]},
        "pressure_rise_kPa": found.pressure_rise,
        "error": None if error is None else asdict(error),
        "iterations": run.iterations,
        "warnings": outcome.notes(number),
    }


def _point(point: Point | None) -> dict[str, float | None]:
    return {"deflection_mm": point[0] if point else None, "load_N": point[1] if point else None}
