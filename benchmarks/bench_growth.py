"""How time grows with elements, and banded LU against SuperLU.

Usage: bench_growth.py [LARGEST]. Quarter models with 192 to about 20,000 quads, one cold analysis
of the known solution each, one core; the 200-quad case is measured again beside every size, so
that the ratio does not depend on what else the machine does.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law
from threadpoolctl import threadpool_limits

QUADS = (192, 450, 800, 1800, 3200, 7200, 20_000)
#: Doubles of band storage beyond which the banded LU is not tried (half a gigabyte).
MOST_BAND = 64_000_000
AS_SHIPPED = factorisation.LARGEST_BAND


def main() -> None:
    largest = int(sys.argv[1]) if len(sys.argv) > 1 else QUADS[-1]
    base, law = known_model_and_law()
    print(f"{'quads':>6s}{'unknowns':>10s}{'band, s':>9s}{'SuperLU, s':>12s}"
          f"{'faster / 200 quads':>20s}{'shipped':>9s}{'apex, mm':>10s}")  # fmt: skip
    sizes, ratios = [], []
    with threadpool_limits(1):
        timed(base, law, AS_SHIPPED)  # compiles
        for wanted in (n for n in QUADS if n <= largest):
            mesh = disk_mesh(100.0, 4 * wanted, "quarter")
            model = BubbleModel(mesh, base.thickness, base.pressures, base.increments)
            reference = min(timed(base, law, AS_SHIPPED)[0] for _ in range(5))
            unknowns = mesh.points.size - len(model.fixed)
            repeats = 3 if wanted < 1000 else 1
            found = {
                limit: min(timed(model, law, limit) for _ in range(repeats))
                for limit in (MOST_BAND, 0)
            }
            (band, apex, kind), (sparse, _, _) = found[MOST_BAND], found[0]
            shipped = timed(model, law, AS_SHIPPED)[2] if wanted < 4000 else "SuperLU"
            best = min(band, sparse) / reference
            sizes.append(len(mesh.quads))
            ratios.append(best)
            text = f"{band:9.3f}" if kind == "band" else f"{'-':>9s}"
            print(f"{len(mesh.quads):6d}{unknowns:10d}{text}{sparse:12.3f}"
                  f"{best:20.1f}{shipped:>9s}{apex:10.3f}", flush=True)  # fmt: skip
    usable = np.isfinite(ratios)
    exponent = np.polyfit(np.log(np.array(sizes)[usable]), np.log(np.array(ratios)[usable]), 1)[0]
    print(f"time grows with quads to the power {exponent:.2f}")


def timed(model: BubbleModel, law: HypoelasticLaw, limit: int) -> tuple[float, float, str]:
    """Seconds of one cold analysis, highest apex, and which factorisation it used.

    A new model's geometry and sparsity are made before the clock starts, as a fit makes them
    once.
    """
    factorisation.LARGEST_BAND = limit
    try:
        solver = MembraneSolver()
        prepared = solver._membrane(model, law)
        kind = type(prepared.tangent).__name__
        begun = time.perf_counter()
        history = solver.run(model, law)
        wall = time.perf_counter() - begun
    except SolverFailure as failure:
        print(failure)
        return float("nan"), float("nan"), "failed"
    finally:
        factorisation.LARGEST_BAND = AS_SHIPPED
    apex = history.displacement[-1, model.mesh.node_sets["apex"][0], 2]
    return wall, float(apex), "band" if kind == "BandedTangent" else "SuperLU"


if __name__ == "__main__":
    main()
