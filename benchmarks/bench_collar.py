"""What the flat faces of the collar and the supports are worth on CalculiX, in load.

Usage: bench_collar.py [SIZE]. The cylinder of 150 mm at 140 kPa with the card of Table 4.2, bent by
20 mm by collars and on supports of few faces and of many; SIZE: mm of an element (60 unless given,
where a run takes some 12 s of CPU time). "By its faces": the collar begins 0.5 mm above the
inflated cylinder by its faces, as the decks have it. "By its ring": by the ring that the faces are
chords of, so that they meet the cylinder earlier.
"""

from __future__ import annotations

import sys

import numpy as np
from bench_bend import LAW, THICKNESS
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.solvers import rigid
from bubblefit.solvers.calculix.solver import CalculixSolver
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIZE, DEFLECTIONS = 60.0, (10.0, 20.0)
#: Faces around a support and around the quarter of a collar, along its fillet; how it is placed.
ROUND = (96, 96, 32, "faces")
BODIES = (ROUND, (48, 24, 6, "faces"), (24, 12, 4, "faces"), (24, 12, 4, "ring"))


def main() -> None:
    size = float(sys.argv[1]) if len(sys.argv) > 1 else SIZE
    model = inflated_cylinder(150.0, 0.14, THICKNESS, size, deflections=DEFLECTIONS)
    radius = 0.5 * model.collar.inner_diameter

    def way_of_ring(faces: Array, points: Array) -> float:
        near = points[(points[:, 1] > 0) & (points[:, 2] <= 0.5 * model.collar.length)]
        return float((np.sqrt(radius**2 - near[:, 0] ** 2) - near[:, 1]).min())

    ours, best = rigid.way_down, np.empty(0)
    print("| support | collar | fillet | placed by | 10 mm, N | 20 mm, N | off round, % |")
    print("|---|---|---|---|---|---|---|")
    for support, collar, fillet, placed in BODIES:
        rigid.SUPPORT_COUNTS = (support, rigid.SUPPORT_COUNTS[1])
        rigid.COLLAR_COUNTS = (collar, rigid.COLLAR_COUNTS[1])
        rigid.FILLET_COUNT = fillet
        rigid.way_down = ours if placed == "faces" else way_of_ring
        load = CalculixSolver().run(model, LAW).load[1:]
        best = best if len(best) else load
        off = " ".join(f"{value:+.2f}" for value in 100 * (load / best - 1))
        loads = " | ".join(f"{value:.2f}" for value in load)
        print(f"| {support} | {collar} | {fillet} | its {placed} | {loads} | {off} |", flush=True)


if __name__ == "__main__":
    main()
