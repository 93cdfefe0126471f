"""The three strips on CalculiX beside the membrane: agreement of the load curves, and cost.

Usage: bench_calculix_strips.py [FINEST]. The thesis' meshes in 100 increments, and the bias strip
in 20 increments on its mesh refined up to FINEST times (2 unless given), against the membrane on
the same mesh and on the one refined three times. Card of Table 3.2, moduli held beyond the strains
of the tests.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import UniaxialModel, bias_strip, straight_strip
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from threadpoolctl import threadpool_limits

# Thesis Table 3.2, GPa, and Table 3.1, mm.
TABLE_3_2 = [
    -7.96599e-3, 7.49311e-1, -1.50931e-1, 2.05148e-2,
    -1.13743e1, 1.07160e1, -6.17621e-1, 1.41287e-1,
    -4.78030e2, 2.11227e2, -2.02600e1, 8.15340e-1,
]  # fmt: skip
LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), strain_range=[0.153, 0.232, 0.7])
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
THICKNESS, FINE = 0.81, 3


def bias(increments: int, refined: int) -> UniaxialModel:
    counts = {"across": 10 * refined, "along": 30 * refined}
    return bias_strip(*BIAS, THICKNESS, increments=increments, **counts)


def main() -> None:
    finest = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    print("differences in % of the end load, largest on the curve: from the membrane on the same")
    print(f"mesh, and on {300 * FINE**2} quads")
    print("strip element   quads incr.     same     fine    end, N  iter.  CalculiX"
          "   membrane  ratio")  # fmt: skip
    with threadpool_limits(1):
        MembraneSolver().run(bias(2, 1), LAW)  # compiles
        for element in ("S8R", "S4"):
            row("warp", element, straight_strip("warp", *WARP, THICKNESS))
            row("fill", element, straight_strip("fill", *FILL, THICKNESS))
            row("bias", element, bias(100, 1))
        fine = MembraneSolver().run(bias(20, FINE), LAW).load
        for element in ("S8R", "S4"):
            for refined in range(1, finest + 1):
                row("bias", element, bias(20, refined), fine)


def row(name: str, element: str, model: UniaxialModel, fine: np.ndarray | None = None) -> None:
    begun = time.perf_counter()
    inside = MembraneSolver().run(model, LAW)
    membrane = time.perf_counter() - begun
    begun = time.perf_counter()
    outside = CalculixSolver(element=element).run(model, LAW)
    calculix = time.perf_counter() - begun

    def off(load: np.ndarray) -> str:
        return f"{100 * np.abs(outside.load - load).max() / load[-1]:9.2g}"

    print(f"{name:6s}{element:9s}{len(model.mesh.quads):6d}{len(model.elongations):6d}"
          f"{off(inside.load)}{'' if fine is None else off(fine):>9s}{outside.load[-1]:10.2f}"
          f"{outside.iterations:7d}{calculix:8.1f} s{1e3 * membrane:8.0f} ms"
          f"{calculix / membrane:7.0f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
