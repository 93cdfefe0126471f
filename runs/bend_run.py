"""One cylinder inflated and bent with one card, as it is kept: what the figures and tables need."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..errors import SolverFailure
from ..materials.card import MaterialCard
from ..models.cylinder import CylinderModel
from ..solvers.base import History, Solver

Array = NDArray[np.float64]


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, eq=False)
class BendRun:
    """How a run ended. Frame 0 is the inflated cylinder; frames are those reached.

    Parameters
    ----------
    deflection, load, pressure, volume : (frames,) mm, N, MPa, mm^3, of the whole cylinder.
    inflated, bent : (nodes, 3) mm of displacement at the first and the last frame.
    strain_min, strain_max : (3,) extremes of (eps1, eps2, gamma12).
    wrinkled : (frames,) share of the surface, empty where the solver does not say.
    seconds : wall clock. iterations : the solver's work. remarks : the solver's.
    failed : why there is nothing of all this, "" otherwise.
    """

    seconds: float
    failed: str = ""
    deflection: Array = field(default_factory=_none)
    load: Array = field(default_factory=_none)
    pressure: Array = field(default_factory=_none)
    volume: Array = field(default_factory=_none)
    inflated: Array = field(default_factory=_none)
    bent: Array = field(default_factory=_none)
    strain_min: Array = field(default_factory=_none)
    strain_max: Array = field(default_factory=_none)
    wrinkled: Array = field(default_factory=_none)
    iterations: int = 0
    remarks: tuple[str, ...] = ()


def run_bend(solver: Solver, model: CylinderModel, card: MaterialCard) -> BendRun:
    """Inflate and bend; a run that does not end well is kept as such."""
    begun = time.perf_counter()
    try:
        history = solver.run(model, card.law)
    except SolverFailure as failure:
        where = f"; scratch kept in {failure.scratch}" if failure.scratch is not None else ""
        return BendRun(time.perf_counter() - begun, failure.reason + where)
    return kept(model, history, time.perf_counter() - begun)


def kept(model: CylinderModel, history: History, seconds: float) -> BendRun:
    """What is kept of a history of inflation and bending."""
    assert history.cavity_pressure is not None and history.cavity_volume is not None
    return BendRun(
        seconds,
        "",
        np.array([0.0, *model.deflections])[: len(history.load)],
        np.asarray(history.load, dtype=float),
        np.asarray(history.cavity_pressure, dtype=float),
        np.asarray(history.cavity_volume, dtype=float),
        history.displacement[0],
        history.displacement[-1],
        history.strain_min,
        history.strain_max,
        _none() if history.wrinkled is None else np.asarray(history.wrinkled, dtype=float),
        history.iterations,
        tuple(history.remarks),
    )


def fingerprint(model: CylinderModel, card: MaterialCard, solver: str) -> str:
    """SHA-256 over everything that a run's result depends on.

    solver : its name, and what of its options matters.
    """
    law, mesh = card.law, model.mesh
    words: list[Any] = [__version__, solver]
    words += [law.nu12, law.thickness_change, repr(model.collar), repr(model.supports)]
    words += [repr(model.gas), model.inflation, model.deflections, model.increments]
    words += [sorted(mesh.node_sets)]
    digest = hashlib.sha256(json.dumps(words).encode())
    arrays = [law.beta, law.limits, model.thickness, mesh.points, mesh.quads, mesh.warp]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
