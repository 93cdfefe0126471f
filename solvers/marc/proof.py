"""Does this Marc carry the law? The four bars whose end stresses Marc itself has published."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import SolverFailure
from ...models.uniaxial import UniaxialModel, straight_strip
from ..base import History
from ..calculix.proof import BARS, INCREMENTS, TOLERANCE, Bar, bar_law
from .solver import MarcSolver

#: mm, of the one element of half a bar; its thickness is 1 mm.
SIZE = 10.0
SECONDS = 600.0


def prove(solver: MarcSolver, timeout: float = SECONDS) -> tuple[float, ...]:
    """End stresses (MPa) of BARS by this Marc, each within TOLERANCE of the published one.

    Raises
    ------
    SolverFailure : a bar did not end well, or its stress is wrong.
    """
    stresses = tuple(end_stress(solver, bar, timeout) for bar in BARS)
    for bar, stress in zip(BARS, stresses, strict=True):
        if not abs(stress / bar.stress - 1) < TOLERANCE:
            problem = f"{bar.model} {bar.direction} bar: {stress:.5g} MPa, not {bar.stress}"
            raise SolverFailure(f"this Marc does not carry the law ({problem})", solver.name)
    return stresses


def end_stress(solver: MarcSolver, bar: Bar, timeout: float | None = None) -> float:
    """Cauchy stress (MPa) at the end of one bar."""
    model, law = bar_model(bar), bar_law(bar.model)
    # The table of the modulus ends with the bar, so that its points lie close.
    end = float(np.log1p(bar.elongation))
    history = solver.run(model, replace(law, strain_range=np.full(3, end)), timeout=timeout)
    return stress_of(model, history)


def bar_model(bar: Bar) -> UniaxialModel:
    """One element, pulled along the warp or the fill, free to contract."""
    length = SIZE * (1 + bar.elongation)
    return straight_strip(
        "warp" if bar.direction == "warp" else "fill",
        SIZE,
        length,
        1.0,
        2 * SIZE,
        INCREMENTS,
        across=1,
        along=1,
    )


def stress_of(model: UniaxialModel, history: History) -> float:
    """Load at the end over the section there; the thickness is constant."""
    x = model.mesh.points[:, 0] + history.displacement[-1][:, 0]
    return float(history.load[-1] / (model.load_factor * np.ptp(x) * model.thickness))
