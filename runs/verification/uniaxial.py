"""Verification of bars and strips: MSC Marc's bars, those of CalculiX, strips of the thesis.

Of the strips these are gauge strains, end loads, and polynomials through data.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from ...meshes.strip_models import WIDTH, UniaxialModel, bias_strip, straight_strip
from ...readers.curves import fit_load_polynomial, read_load_curves
from ...solvers.bars import BARS, TOLERANCE, strip_stresses
from ...solvers.calculix.solver import CalculixSolver, diagnose
from ...solvers.membrane.solver import MembraneSolver
from . import Number
from .bubbles import ABAQUS_SOURCE, bubble_shapes, published_apex, published_cases, table_4_2_law


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
        yield Number(quantity, apex[row], theirs[row], "mm", 3e-3, ABAQUS_SOURCE)


#: Thickness of the fabric, mm.
THICKNESS = 0.81
SOURCE = "thesis Table 3.1"


class GaugeRow(NamedTuple):
    """A direction in Table 3.1: gauge length at rest and at the end (mm), strain, R^2."""

    first_length: float
    last_length: float
    strain: float
    r_squared: float


TABLE_3_1 = {
    "warp": GaugeRow(20.022, 23.329, 0.165, 0.998),
    "fill": GaugeRow(22.780, 28.721, 0.261, 0.959),
    "bias": GaugeRow(19.767, 30.734, 0.555, 0.987),
}


def strips() -> Iterator[Number]:
    """Compare strains of the gauge, and end loads with the integral of the modulus."""
    for direction, gauge in TABLE_3_1.items():
        model = _strip(direction, gauge)
        history = MembraneSolver(1e-10).run(model, table_4_2_law())
        deformed = model.mesh.points + history.displacement[-1]
        lower, upper = deformed[model.mesh.node_sets["gauge"]]
        strain = float(np.linalg.norm(upper - lower)) / gauge.first_length - 1
        quantity = f"engineering strain of the gauge, {direction} strip"
        # Half a unit of the last digit printed.
        yield Number(quantity, strain, gauge.strain, "", 5e-4, SOURCE, absolute=True)
        if direction != "bias":
            theirs = end_load(direction, float(np.log(gauge.last_length / gauge.first_length)))
            load = float(history.load[-1])
            quantity = f"end load, {direction} strip of Table 4.2"
            yield Number(quantity, load, theirs, "N", 1e-6, "integral of E")


def _strip(direction: str, gauge: GaugeRow) -> UniaxialModel:
    """Return the strip of a direction of Table 3.1."""
    if direction == "bias":
        return bias_strip(gauge.first_length, gauge.last_length, THICKNESS)
    yarn: Literal["warp", "fill"] = "warp" if direction == "warp" else "fill"
    return straight_strip(yarn, gauge.first_length, gauge.last_length, THICKNESS)


def end_load(direction: str, strain: float) -> float:
    """Return the load (N) of a homogeneous strip of Table 4.2's law at a log strain.

    Across, d eps1 = -nu21 d eps2 with nu21 = nu12 E2/E1, and d eps2 = -nu12 d eps1. In the fill
    test E1 is held at its value at zero strain, because the warp gets shorter. A modulus is held
    beyond its strain range.
    """
    law = table_4_2_law()
    modulus, component = (law.E1, 0) if direction == "warp" else (law.E2, 1)
    knots = [0.0, min(strain, law.strain_range[component]), strain]
    points, weights = np.polynomial.legendre.leggauss(4)
    stress = 0.0
    for start, end in pairwise(knots):
        half_length = 0.5 * (end - start)
        stress += half_length * float(weights @ modulus(0.5 * (start + end) + half_length * points))
    across = -law.nu12 * (strain if direction == "warp" else stress / law.E1(0.0))
    return stress * WIDTH * THICKNESS * float(np.exp(across))


def measured_strips(folder: Path) -> Iterator[Number]:
    """Compare R^2 of the fourth-order polynomials through measured points; raises InputError.

    One of the fill points is not among those that were digitised: R^2 is 0.9576 without it.
    """
    for curve in read_load_curves(folder / "valmex7318_load_gauge.csv"):
        ours = fit_load_polynomial(curve.elongation, curve.load).r_squared
        theirs = TABLE_3_1[str(curve.direction)].r_squared
        quantity = f"R^2 of the {curve.direction} polynomial"
        yield Number(quantity, ours, theirs, "", 2e-3, SOURCE, absolute=True)
