"""Verification of uniaxial bars against MSC Marc."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.membrane.solver import MembraneSolver
from .number import Number


def marc_bars(stresses: Sequence[float] | None = None, program: str = "") -> Iterator[Number]:
    """Compare end stresses of the four bars, in order, with Marc's.

    Parameters
    ----------
    stresses : sequence of 4 floats, MPa
        End stresses to compare; by default those of the embedded membrane solver.
    program : str
        Words with which the name of each quantity begins.
    """
    if not stresses:
        stresses = strip_stresses(MembraneSolver())
    source = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"
    for bar, stress in zip(BARS, stresses, strict=True):
        quantity = f"{program}end stress, {bar.model} {bar.direction} bar"
        yield Number(quantity, stress, bar.stress, "MPa", TOLERANCE, source)
