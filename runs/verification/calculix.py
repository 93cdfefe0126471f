"""Verification of CalculiX as a solver: uniaxial bars and a bubble."""

from __future__ import annotations

from collections.abc import Iterator

from ...solvers.calculix.solver import CalculixSolver, diagnose
from .abaqus import SOURCE, bubble_shapes, published_apex, published_cases
from .bars import marc_bars
from .number import Number


def with_calculix() -> Iterator[Number]:
    """Compare CalculiX' bars with Marc's, a bubble with Abaqus'; nothing without a usable ccx.

    Shells of 432 quads a disk are 0.3 % off at most.
    """
    usable = next((program for program in diagnose() if program.usable), None)
    if usable is None or usable.stresses is None or usable.path is None:
        return
    yield from marc_bars(usable.stresses, "CalculiX: ")
    rows = dict(published_cases())[2, "e"]
    apex = bubble_shapes(rows, 432, CalculixSolver(usable.path))["apex"]
    theirs = published_apex(rows)
    for row in (len(rows) // 2, len(rows) - 1):
        quantity = f"CalculiX: apex, test 2 e, {100 * rows['p_bar'][row]:.0f} kPa"
        yield Number(quantity, apex[row], theirs[row], "mm", 3e-3, SOURCE)
