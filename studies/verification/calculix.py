"""The same with CalculiX, where there is one that can load a law."""

from __future__ import annotations

from collections.abc import Iterator

from ...solvers.calculix.diagnosis import diagnose
from ...solvers.calculix.solver import CalculixSolver
from .abaqus import SOURCE as ABAQUS
from .abaqus import cases, shapes
from .bars import end_stresses
from .number import Number

#: Test and model of Abaqus' bubble. Shells of 432 quads a disk are 0.3 % off at most.
CASE, ELEMENTS, ALLOWED = (2, "e"), 432, 3e-3


def with_calculix() -> Iterator[Number]:
    """Bars beside Marc's, a bubble beside Abaqus'; nothing where no ccx is usable."""
    usable = next((one for one in diagnose() if one.usable), None)
    if usable is None or usable.stresses is None or usable.path is None:
        return
    yield from end_stresses(usable.stresses, "CalculiX: ")
    rows = dict(cases())[CASE]
    found = shapes(rows, ELEMENTS, CalculixSolver(usable.path))
    for i in (len(rows) // 2, len(rows) - 1):
        what = f"CalculiX: apex, test {CASE[0]} {CASE[1]}, {100 * rows['p_bar'][i]:.0f} kPa"
        theirs = rows[["apex_x_profile", "apex_y_profile"]].mean(axis=1)[i]
        yield Number(what, found["apex"][i], theirs, "mm", ALLOWED, ABAQUS)
