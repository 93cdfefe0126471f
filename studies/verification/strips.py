"""Table 3.1's strips: gauge, load curve, and the closed form of a homogeneous strip."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...data.curves import read_load_curves
from ...data.load_polynomials import fit_load_polynomial
from ...models.uniaxial import WIDTH, UniaxialModel, bias_strip, straight_strip
from ...solvers.membrane.solver import MembraneSolver
from .marc_bubble import known_law
from .number import Number

THICKNESS = 0.81
#: Table 3.1: gauge length at rest and at the end, mm; engineering strain; R^2 of the polynomial.
TABLE_3_1 = {
    "warp": (20.022, 23.329, 0.165, 0.998),
    "fill": (22.780, 28.721, 0.261, 0.959),
    "bias": (19.767, 30.734, 0.555, 0.987),
}
#: Half a unit of the last digit printed.
PRINTED = 5e-4
#: One of the fill points is not among those that were digitised: R^2 0.9576 without it.
DIGITISED = 2e-3
FILE = "valmex7318_load_gauge.csv"


def strips() -> Iterator[Number]:
    """Strain of the gauge on the computed strips, and end loads beside the modulus' integral."""
    for direction, (first, last, strain, _) in TABLE_3_1.items():
        model = strip(direction)
        history = MembraneSolver(1e-10).run(model, known_law())
        lower, upper = (model.mesh.points + history.displacement[-1])[model.mesh.node_sets["gauge"]]
        ours = float(np.linalg.norm(upper - lower)) / first - 1
        what = f"engineering strain of the gauge, {direction} strip"
        yield Number(what, ours, strain, "", PRINTED, "thesis Table 3.1", absolute=True)
        if direction != "bias":
            theirs = end_load(direction, float(np.log(last / first)))
            what = f"end load, {direction} strip of Table 4.2"
            yield Number(what, float(history.load[-1]), theirs, "N", 1e-6, "integral of E")


def measured_strips(folder: Path) -> Iterator[Number]:
    """R^2 of the fourth-order polynomials through the measured points in `folder`.

    Raises
    ------
    InputError : the file is not there, or cannot be read.
    """
    for curve in read_load_curves(folder / FILE):
        ours = fit_load_polynomial(curve.elongation, curve.load).r_squared
        theirs = TABLE_3_1[str(curve.direction)][3]
        what = f"R^2 of the {curve.direction} polynomial"
        yield Number(what, ours, theirs, "", DIGITISED, "thesis Table 3.1", absolute=True)


def strip(direction: str) -> UniaxialModel:
    """A strip of Table 3.1, 25 mm wide."""
    first, last, *_ = TABLE_3_1[direction]
    if direction == "bias":
        return bias_strip(first, last, THICKNESS)
    return straight_strip("warp" if direction == "warp" else "fill", first, last, THICKNESS)


def end_load(direction: str, strain: float) -> float:
    """Load (N) of a homogeneous strip of Table 4.2's law at a log strain.

    Across, d eps1 = -nu21 d eps2 with nu21 = nu12 E2/E1, and d eps2 = -nu12 d eps1. In the fill
    test E1 is held at its value at zero strain, because the warp gets shorter. A modulus is held
    beyond its strain range.
    """
    law = known_law()
    modulus, end = (law.E1, 0) if direction == "warp" else (law.E2, 1)
    knots = [0.0, min(strain, float(law.strain_range[end])), strain]
    stress = 0.0
    for a, b in pairwise(knots):
        x, weight = np.polynomial.legendre.leggauss(4)
        stress += 0.5 * (b - a) * float(weight @ modulus(0.5 * (a + b) + 0.5 * (b - a) * x))
    across = -law.nu12 * (strain if direction == "warp" else stress / float(law.E1(0.0)))
    return stress * WIDTH * THICKNESS * float(np.exp(across))
