"""Marc's end stresses of uniaxial models: the law itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.base import Solver
from ...solvers.membrane.solver import MembraneSolver
from .number import Number

SOURCE = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"


def marc_bars(solver: Solver | None = None) -> Iterator[Number]:
    """The four published bars on a solver, the embedded membrane unless given."""
    return end_stresses(strip_stresses(solver or MembraneSolver()))


def end_stresses(stresses: Sequence[float], program: str = "") -> Iterator[Number]:
    """Those of the bars (MPa), in their order, beside Marc's; `program` begins what each is."""
    for bar, stress in zip(BARS, stresses, strict=True):
        what = f"{program}end stress, {bar.model} {bar.direction} bar"
        yield Number(what, stress, bar.stress, "MPa", TOLERANCE, SOURCE)
