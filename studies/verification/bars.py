"""Marc's end stresses of uniaxial models: the law itself."""

from __future__ import annotations

from collections.abc import Iterator

from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.base import Solver
from ...solvers.membrane.solver import MembraneSolver
from .number import Number

SOURCE = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"


def marc_bars(solver: Solver | None = None, with_what: str = "") -> Iterator[Number]:
    """The four published bars on a solver, the embedded membrane unless given."""
    stresses = strip_stresses(solver or MembraneSolver())
    for bar, stress in zip(BARS, stresses, strict=True):
        what = f"end stress, {bar.model} {bar.direction} bar{with_what}"
        yield Number(what, stress, bar.stress, "MPa", TOLERANCE, SOURCE)
