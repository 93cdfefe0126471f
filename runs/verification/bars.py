"""Verification of uniaxial bars against MSC Marc, and of CalculiX by bars and a bubble."""

from collections.abc import Iterator, Sequence

from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.calculix.solver import CalculixSolver, diagnose
from ...solvers.membrane.solver import MembraneSolver
from .abaqus import SOURCE, bubble_shapes, published_apex, published_cases
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
