"""What moduli lose where the model's quads are coarser than the sheet that was measured.

Usage: bench_facets.py [QUADS ...]. A sheet raised by 4 mm, computed on 3,072 quads without noise,
is compared with models of fewer quads, whose nodes have the measured surface, at the true law: read
between their nodes as flat quads, and as fits read them (`meshes/reading.py`). What the
moduli would make of the difference follows from the derivatives there, by least squares, slack
taken for known.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.mesh import sampling_matrix
from bubblefit.meshes.reading import SmoothReading
from bubblefit.solvers.membrane.solver import MembraneSolver
from uneven_test import RANGE, Uneven, model

PRESSURES = (0.02, 0.05, 0.09, 0.14, 0.19, 0.24)
SHEET = Uneven(slack=0.0, rim=0.0, noise=0.0)
#: MPa at rest and at a strain of 0.06: of G12, E2, E1.
MODULI = np.array([12.0, 12.0, 220.0, 196.0, 300.0, 228.0])
STEP = 0.01


def field(sheet: BubbleModel, moduli: np.ndarray) -> np.ndarray:
    beta = np.zeros(12)
    for block, (rest, end) in enumerate(moduli.reshape(3, 2)):
        beta[4 * block + 2 : 4 * block + 4] = (end - rest) / 0.06, rest
    law = HypoelasticLaw(beta, 0.24, np.array(RANGE), "incompressible")
    return np.asarray(MembraneSolver(1e-9).run(sheet, law).displacement)


def of_height(sheet: BubbleModel, height: float) -> BubbleModel:
    """The surface with its apex at a height, mm: its largest value depends on the mesh."""
    points = np.array(sheet.mesh.points)
    points[:, 2] *= height / points[sheet.mesh.node_sets["apex"][0], 2]
    return replace(sheet, mesh=replace(sheet.mesh, points=points))


def main() -> None:
    fine = model(SHEET, PRESSURES, 3072)
    height = float(fine.mesh.points[fine.mesh.node_sets["apex"][0], 2])
    seen, places = field(fine, MODULI), fine.mesh.points[:, :2]
    chosen = np.flatnonzero(np.hypot(*places.T) < 98)[::2]
    for quads in [int(n) for n in sys.argv[1:]] or [112, 240, 432, 1000]:
        own = of_height(model(SHEET, PRESSURES, quads), height)
        here = field(own, MODULI)
        slopes = [
            (field(own, MODULI * (1 + STEP * one)) - here) / STEP for one in np.eye(len(MODULI))
        ]
        for name, reading in (
            ("flat quads", sampling_matrix(own.mesh, places[chosen])),
            ("smooth", SmoothReading.of(own.mesh).matrix(places[chosen])),
        ):
            sample, inside = reading

            def at(values: np.ndarray, sample=sample) -> np.ndarray:
                return np.concatenate([(sample @ frame).ravel() for frame in values])

            off = at(here) - seen[:, chosen[inside]].ravel()
            found = np.linalg.lstsq(np.stack([at(s) for s in slopes], axis=1), -off)[0]
            e2, e1 = 100 * found[2:4], 100 * found[4:6]
            misfit = np.sqrt(np.mean(off**2))
            words = (
                f"E1 {e1[0]:+6.2f} % at rest, {e1[1]:+6.2f} % at 0.06, E2 {e2[0]:+6.2f} %, "
                f"{e2[1]:+6.2f} %"
            )
            quads_here = f"{len(own.mesh.quads):5d} quads, {name:10s}"
            print(f"{quads_here}: misfit {misfit:.3f} mm RMS; {words}", flush=True)


if __name__ == "__main__":
    main()
