"""Runs of one model on a sequence of refinements: values, changes, cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from ..meshes.mesh import Mesh
from ..solvers.base import History, Solver

Array = NDArray[np.float64]
Curve = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Level:
    """One refinement of a model.

    factor : how much finer than the project's own. increments : of the load. size : of what is
    refined, edge length (mm) or step (share of the whole load).
    """

    factor: float
    model: Any
    increments: int
    size: float


@dataclass(frozen=True, eq=False)
class LevelRun:
    """What a level gave.

    values : quantities of interest by name, None where the run failed; curve : (x, y) of the
    response, where levels are compared along one; seconds : wall clock; failure : why there are
    no values; notes : what a reader of the values should know.
    """

    level: Level
    seconds: float
    iterations: int = 0
    values: Mapping[str, float] | None = None
    curve: Curve | None = None
    failure: str = ""
    notes: tuple[str, ...] = ()


def edge_length(mesh: Mesh) -> float:
    """Edge (mm) of a square of the mean area of the quads, from their plane reference state."""
    a, b, c, d = (mesh.points[mesh.quads[:, i]] for i in range(4))
    area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    return float(np.sqrt(area.mean()))


def warm_up(solver: Solver, model: Any, law: HypoelasticLaw) -> None:
    """Run an in-process solver once, untimed: it compiles on first use."""
    if not solver.external:
        with suppress(SolverFailure):
            solver.run(model, law)


def run_level(
    solver: Solver,
    level: Level,
    law: HypoelasticLaw,
    quantities: Callable[[Any, History], Mapping[str, float]],
    curve: Callable[[Any, History], Curve] | None = None,
    notes: Callable[[History], Sequence[str]] = lambda history: history.remarks,
) -> LevelRun:
    """Run one level; an analysis that does not end well is a level without values."""
    begun = time.perf_counter()
    try:
        history = solver.run(level.model, law)
    except SolverFailure as failure:
        return LevelRun(level, time.perf_counter() - begun, failure=failure.reason)
    seconds = time.perf_counter() - begun
    values = quantities(level.model, history)
    along = None if curve is None else curve(level.model, history)
    said = tuple(notes(history))
    return LevelRun(level, seconds, history.iterations, values, along, notes=said)


def rms_between(coarse: Curve, fine: Curve) -> float:
    """Root mean square of the difference of two curves (x, y), at the places of the coarse one.

    The fine one is interpolated linearly where it has no point there; both start at the origin.
    Where it stopped early they are compared up to there.
    """
    (x, y), (fx, fy) = coarse, fine
    both = x <= fx[-1] * (1 + 1e-9)
    x, y = x[both], y[both]
    there = np.interp(x, np.append(0.0, fx), np.append(0.0, fy))
    return float(np.sqrt(np.mean((y - there) ** 2)))
