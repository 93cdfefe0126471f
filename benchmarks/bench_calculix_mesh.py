"""The bubble on CalculiX' shells beside the membrane, mesh by mesh: the whole field.

Usage: bench_calculix_mesh.py [FINEST]. Quarter bubbles of up to FINEST quads (192 unless given;
768 for the whole table of docs/how-to/calculix.md), radius 100 mm, the seven published pressures,
both solvers on the same quads. Printed: largest difference of any component anywhere, in % of the
apex height, pressure by pressure, and CalculiX' apex at 132 kPa.
"""

from __future__ import annotations

import sys

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law
from threadpoolctl import threadpool_limits

QUADS = {"S8R": (48, 108, 192, 432), "S4": (48, 192, 432, 768)}
SHOWN = 0.132


def main() -> None:
    finest = int(sys.argv[1]) if len(sys.argv) > 1 else 192
    base, known = known_model_and_law()
    laws = {"Table 4.2": known, "linear 800, 400, 20": HypoelasticLaw.linear(800.0, 400.0, 20.0)}
    heads = "".join(f"{1e3 * p:7.0f}" for p in base.pressures)
    print(f"{'law':20s}{'element':8s}{'quads':>6s}{heads} kPa   apex at 132 kPa, mm")
    for name, law in laws.items():
        for element, counts in QUADS.items():
            for quads in (n for n in counts if n <= finest):
                print(
                    f"{name:20s}{element:8s}{quads:6d}{row(base, law, element, quads)}", flush=True
                )


def row(base: BubbleModel, law: HypoelasticLaw, element: str, quads: int) -> str:
    """The differences; without the last pressures where CalculiX stops before them."""
    mesh = disk_mesh(100.0, 4 * quads, "quarter")
    apex = mesh.node_sets["apex"][0]
    with threadpool_limits(1):
        for last in range(len(base.pressures), 0, -1):
            pressures = base.pressures[:last]
            steps = [p for p in base.increments if p <= pressures[-1]]
            model = BubbleModel(mesh, base.thickness, pressures, steps)
            try:
                found = CalculixSolver(element=element).run(model, law).displacement
                break
            except SolverFailure as failure:
                print(f"to {1e3 * pressures[-1]:.0f} kPa: {failure.reason}")
        else:
            return "  -"
        expected = MembraneSolver().run(model, law).displacement
    off = 100 * np.abs(found - expected).max(axis=(1, 2)) / expected[:, apex, 2]
    height = float(np.interp(SHOWN, pressures, found[:, apex, 2]))
    missing = "      -" * (len(base.pressures) - last)
    return "".join(f"{value:7.2f}" for value in off) + missing + f"       {height:.3f}"


if __name__ == "__main__":
    main()
