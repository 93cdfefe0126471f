"""Bars of MSC Marc."""

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
        By default those of the embedded membrane.
    program : str
        Begins the name of each quantity.
    """
    if not stresses:
        stresses = strip_stresses(MembraneSolver())
    source = "MSC Marc; Jekel et al., Composite Structures 161 (2017)"
    for bar, stress in zip(BARS, stresses, strict=True):
        quantity = f"{program}end stress, {bar.model} {bar.direction} bar"
        yield Number(quantity, stress, bar.stress, "MPa", TOLERANCE, source)
