"""A study of refinement as numbers, as a table and as panels of a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..notes import rows
from .convergence import convergence, observed_order
from .refinement import LevelRun, Refinement, ended, rms_between

if TYPE_CHECKING:
    import pandas as pd

    from ..reports import ConvergencePanel

RMS = "RMS of the load to the next finer level, N"


def numbers(study: Refinement) -> dict[str, Any]:
    """What result.json says."""
    return {
        "command": "study mesh",
        "project": str(study.project),
        "card": study.card,
        "solver": study.solver,
        "refined": study.what,
        "models": {name: _part(runs, study.noise) for name, runs in study.runs.items()},
        "notes": rows(study.notes),
    }


def table(study: Refinement) -> pd.DataFrame:
    """convergence.csv: one row a part, level and quantity."""
    import pandas as pd

    rows: list[dict[str, object]] = []
    for name, runs in study.runs.items():
        good = ended(runs)
        finest = _values(good[-1]) if good else {}
        changes = rms_changes(runs)
        for run in runs:
            level = run.level
            start = {
                "model": name,
                "refined": study.what,
                "factor": level.factor,
                "elements": level.elements,
                "increments": level.part.increments,
                "size": level.size,
                "seconds": run.seconds,
                "iterations": run.iterations,
            }
            for quantity, value in _values(run).items():
                off = value - finest.get(quantity, np.nan)
                percent = 100 * off / finest.get(quantity, np.nan)
                rows.append({**start, "quantity": quantity, "value": value, "off_finest": off,
                             "off_finest_percent": percent})  # fmt: skip
            if run in good and good.index(run) < len(changes):
                rows.append({**start, "quantity": RMS, "value": changes[good.index(run)]})
            if run.failure:
                rows.append({**start, "quantity": f"failed: {run.failure}"})
    return pd.DataFrame(rows)


def panels(study: Refinement) -> list[ConvergencePanel]:
    """What the figure shows: relative changes from each level to the next finer one."""
    from ..reports import ConvergencePanel

    drawn = []
    for name, runs in study.runs.items():
        good = ended(runs)
        changes: dict[str, list[float]] = {}
        for quantity, last in (_values(good[-1]) if good else {}).items():
            seen = np.array([_values(run).get(quantity, np.nan) for run in good])
            changes[quantity] = (100 * np.abs(np.diff(seen) / last)).tolist()
        rms = rms_changes(runs)
        if rms:
            largest = _largest(good)
            changes["RMS along the load curve"] = [100 * r / largest for r in rms]
        drawn.append(
            ConvergencePanel(
                name,
                [run.level.size for run in good],
                changes,
                [run.level.elements * run.level.part.increments for run in good],
                [run.seconds for run in good],
            )
        )
    return drawn


def rms_changes(runs: Sequence[LevelRun]) -> list[float]:
    """RMS between the curves of each level that ended well and the next finer one."""
    curves = [run.curve for run in ended(runs) if run.curve is not None]
    return [rms_between(a, b) for a, b in pairwise(curves)]


def _part(runs: Sequence[LevelRun], noise: float) -> dict[str, Any]:
    good = ended(runs)
    said: dict[str, Any] = {
        "levels": [_level(run) for run in runs],
        "quantities": {},
    }
    if len(good) < 2:
        return said
    said["quantities"] = {
        name: _quantity(name, finest, good, noise) for name, finest in _values(good[-1]).items()
    }
    changes = rms_changes(runs)
    if changes:
        sizes, largest = [run.level.size for run in good], _largest(good)
        clear = min(changes[-2:]) > noise * largest
        order = observed_order(sizes[-3:], changes[-2:]) if len(changes) > 1 and clear else None
        said["rms_N"] = {"to_next_finer": changes, "largest_load": largest, "order": order}
    return said


def _level(run: LevelRun) -> dict[str, Any]:
    said = {
        "factor": run.level.factor,
        "elements": run.level.elements,
        "increments": run.level.part.increments,
        "size": run.level.size,
        "seconds": run.seconds,
        "iterations": run.iterations,
        "values": None if run.values is None else dict(run.values),
    }
    return {**said, "failed": run.failure} if run.failure else said


def _quantity(name: str, finest: float, good: Sequence[LevelRun], noise: float) -> dict[str, Any]:
    # A run that stopped early has no loads from there on.
    having = [run for run in good if name in _values(run)]
    seen = [_values(run)[name] for run in having]
    observed = convergence([run.level.size for run in having], seen, noise)
    best = finest if observed.limit is None else observed.limit
    own = next((run for run in having if run.level.factor == 1), None)
    return {
        "finest": finest,
        "order": observed.order,
        "order_one_coarser": observed.previous,
        "limit": observed.limit,
        "remark": observed.remark,
        "own_error": None if own is None else _values(own)[name] / best - 1.0,
        "own_error_against": "finest" if observed.limit is None else "limit",
    }


def _values(run: LevelRun) -> Mapping[str, float]:
    return run.values or {}


def _largest(good: Sequence[LevelRun]) -> float:
    """Largest load of the finest level's curve."""
    curve = good[-1].curve
    assert curve is not None
    return float(np.abs(curve[1]).max())
