"""What a sequence of refinements is worth: orders, limits, table and figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..reports import ConvergencePanel
from ..solvers.base import Solver
from ..studies.convergence import convergence, observed_order
from ..studies.refinement import LevelRun, rms_between
from .study_kinds import What
from .study_options import Study

Runs = Mapping[str, Sequence[LevelRun]]

HEADER = (
    "model", "refined", "factor", "elements", "increments", "size", "seconds", "iterations",
    "quantity", "value", "off_finest", "off_finest_percent",
)  # fmt: skip
RMS = "RMS of the load to the next finer level, N"


def noise(solver: Solver) -> float:
    """Relative accuracy of displacements and loads: result files of others have 6 digits."""
    return 1e-5 if solver.external else 1e-7


def ended(runs: Sequence[LevelRun]) -> list[LevelRun]:
    """Levels that have values, coarse to fine."""
    return [run for run in runs if run.values is not None]


def rms_changes(runs: Sequence[LevelRun]) -> list[float]:
    """RMS between the curves of each level that ended well and the next finer one."""
    curves = [run.curve for run in ended(runs) if run.curve is not None]
    return [rms_between(a, b) for a, b in pairwise(curves)]


def result_of(study: Study, what: What, runs: Runs) -> dict[str, Any]:
    """What result.json says."""
    return {
        "command": "study mesh",
        "project": str(study.project.path),
        "card": study.card_path,
        "solver": study.solver.name,
        "refined": what,
        "models": {name: _model(several, noise(study.solver)) for name, several in runs.items()},
    }


def _model(runs: Sequence[LevelRun], accuracy: float) -> dict[str, Any]:
    good = ended(runs)
    found: dict[str, Any] = {
        "levels": [
            {
                "factor": run.level.factor,
                "elements": len(run.level.model.mesh.quads),
                "increments": run.level.increments,
                "size": run.level.size,
                "seconds": run.seconds,
                "iterations": run.iterations,
                "values": None if run.values is None else dict(run.values),
                **({"failed": run.failure} if run.failure else {}),
            }
            for run in runs
        ],
        "quantities": {},
        "warnings": list(good[-1].notes) if good else [],
    }
    if len(good) < 2:
        return found
    sizes = [run.level.size for run in good]
    own = next((run for run in good if run.level.factor == 1), None)
    for name, finest in _values(good[-1]).items():
        # A run that stopped early has no loads from there on.
        having = [run for run in good if name in _values(run)]
        seen = [_values(run)[name] for run in having]
        study = convergence([run.level.size for run in having], seen, accuracy)
        best = finest if study.limit is None else study.limit
        found["quantities"][name] = {
            "finest": finest,
            "order": study.order,
            "order_one_coarser": study.previous,
            "limit": study.limit,
            "remark": study.remark,
            "own_error": None if own not in having else _values(own)[name] / best - 1.0,
            "own_error_against": "finest" if study.limit is None else "limit",
        }
    changes = rms_changes(runs)
    if changes:
        largest = float(np.abs(good[-1].curve[1]).max())  # type: ignore[index]
        clear = min(changes[-2:]) > accuracy * largest
        order = observed_order(sizes[-3:], changes[-2:]) if len(changes) > 1 and clear else None
        found["rms_N"] = {"to_next_finer": changes, "largest_load": largest, "order": order}
    return found


def _values(run: LevelRun) -> Mapping[str, float]:
    return run.values or {}


def rows(runs: Runs, what: What) -> list[list[object]]:
    """convergence.csv: one row a model, level and quantity."""
    table: list[list[object]] = []
    for name, several in runs.items():
        good = ended(several)
        finest = _values(good[-1]) if good else {}
        changes = rms_changes(several)
        for run in several:
            level = run.level
            start: list[object] = [
                name, what, level.factor, len(level.model.mesh.quads), level.increments,
                level.size, run.seconds, run.iterations,
            ]  # fmt: skip
            for quantity, value in _values(run).items():
                if quantity not in finest:
                    table.append([*start, quantity, value, "", ""])
                    continue
                off = value - finest[quantity]
                table.append([*start, quantity, value, off, 100 * off / finest[quantity]])
            if run in good and good.index(run) < len(changes):
                table.append([*start, RMS, changes[good.index(run)], "", ""])
            if run.failure:
                table.append([*start, f"failed: {run.failure}", "", "", ""])
    return table


def panels(runs: Runs) -> list[ConvergencePanel]:
    """What the figure shows: relative changes from each level to the next finer one."""
    drawn = []
    for name, several in runs.items():
        good = ended(several)
        changes: dict[str, list[float]] = {}
        for quantity, last in (_values(good[-1]) if good else {}).items():
            seen = np.array([_values(run).get(quantity, np.nan) for run in good])
            changes[quantity] = (100 * np.abs(np.diff(seen) / last)).tolist()
        rms = rms_changes(several)
        if rms:
            largest = float(np.abs(good[-1].curve[1]).max())  # type: ignore[index]
            changes["RMS along the load curve"] = [100 * r / largest for r in rms]
        drawn.append(
            ConvergencePanel(
                name,
                [run.level.size for run in good],
                changes,
                [len(run.level.model.mesh.quads) * run.level.increments for run in good],
                [run.seconds for run in good],
            )
        )
    return drawn
