"""Try the Marc of this machine on the bars."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import BubblefitError, SolverFailure
from ..bars import BARS, TOLERANCE, Bar, bar_law, bar_model, difference, stress_of
from ..base import Diagnosis
from .job import find_marc
from .settings import VARIABLE
from .solver import MarcSolver

SECONDS = 600.0


def prove(solver: MarcSolver, timeout: float = SECONDS) -> tuple[float, ...]:
    """Return the end stresses (MPa) of BARS by this Marc, each within TOLERANCE of the published.

    SolverFailure: a bar did not end well, or its stress is wrong.
    """
    stresses = tuple(end_stress(solver, bar, timeout) for bar in BARS)
    for bar, stress in zip(BARS, stresses, strict=True):
        if not abs(stress / bar.stress - 1) < TOLERANCE:
            problem = f"{bar.model} {bar.direction} bar: {stress:.5g} MPa, not {bar.stress}"
            raise SolverFailure(f"this Marc does not carry the law ({problem})", solver.name)
    return stresses


def end_stress(solver: MarcSolver, bar: Bar, timeout: float | None = None) -> float:
    """Return the Cauchy stress (MPa) at the end of one bar."""
    model, law = bar_model(bar), bar_law(bar.model)
    # The table of the modulus ends with the bar: to the reach of a law without a range its points
    # would lie so far apart that the warp bar is 2e-4 off.
    end = float(np.log1p(bar.elongation))
    history = solver.run(model, replace(law, strain_range=np.full(3, end)), timeout=timeout)
    return stress_of(model, history)


NAMED, FOUND = "named", "PATH"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return one entry (`named`: the one to look at), none if it is neither there nor was named."""
    origin = NAMED if named is not None else VARIABLE if os.environ.get(VARIABLE) else FOUND
    expected = origin != FOUND
    path, stresses, off, advice, version = None, None, None, "", ""
    try:
        solver = MarcSolver(named)
        version = solver.settings.version or "?"
        path = find_marc(solver.settings)
        stresses = prove(solver)
        off = difference(stresses)
    except BubblefitError as error:
        if path is None and not expected:
            return []
        advice = str(error).splitlines()[0]
    return [Diagnosis("marc", version, path, origin, expected, None, stresses is not None,
                      stresses, off, advice)]  # fmt: skip
