"""Measure the time of analyses and how it grows with the mesh."""

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import parameters_of
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import known_model_and_law, seconds, start_on
from threadpoolctl import threadpool_limits

QUADS = (192, 450, 800, 1800, 3200, 7200, 20_000)
#: Doubles of band storage beyond which the banded LU is not tried (half a gigabyte).
MOST_BAND, AS_SHIPPED = 64_000_000, factorisation.LARGEST_BAND


def analysis(repeats=40):
    """Time an analysis of the known solution and its derivatives, the least of REPEATS turns."""
    model, law = known_model_and_law()
    solver = MembraneSolver()
    # Warm starts come from a neighbour, as in a fit that is settling: 0.1 % away, with its slope.
    near = law.with_beta(1.001 * law.beta)
    history, _ = solver.run_with_sensitivity(model, near)
    guess = history.path + history.path_slope @ (law.beta - near.beta)
    variants = {
        "analysis, cold": lambda: solver.run(model, law),
        "analysis, warm": lambda: solver.run(model, law, guess=guess),
        "with 12 derivatives, cold": lambda: solver.run_with_sensitivity(model, law),
        "with 12 derivatives, warm": lambda: solver.run_with_sensitivity(model, law, guess=guess),
        "with all 14, cold": lambda: solver.run_with_sensitivity(model, law, parameters_of(law)),
    }
    with threadpool_limits(1):
        turns = [[seconds(run) for run in variants.values()] for _ in range(repeats)]
    times = dict(zip(variants, np.min(turns, axis=0), strict=True))
    base = times["analysis, cold"]
    print(f"{len(model.mesh.quads)} quads, {len(model.increments)} increments, one core")
    print(f"{'':28s}{'ms':>8s}{'a second':>10s}{'in cold analyses':>18s}")
    for name, t in times.items():
        print(f"{name:28s}{1e3 * t:8.1f}{1 / t:10.0f}{t / base:18.2f}")
    gradient = times["with 12 derivatives, cold"] / base - 1
    print(f"a gradient costs {gradient:.2f} of an analysis (goal: at most 0.5)")


def growth(largest=QUADS[-1]):
    """Time quarter models of up to LARGEST quads, banded LU beside SuperLU, on one core."""
    base, law = known_model_and_law()
    print(f"{'quads':>6s}{'unknowns':>10s}{'band, s':>9s}{'SuperLU, s':>12s}"
          f"{'faster / 200 quads':>20s}{'shipped':>9s}{'apex, mm':>10s}")  # fmt: skip
    found = []
    with threadpool_limits(1):
        timed(base, law, AS_SHIPPED)  # compiles
        for wanted in (n for n in QUADS if n <= largest):
            mesh = disk_mesh(100.0, 4 * wanted, "quarter")
            model = BubbleModel(mesh, base.thickness, base.pressures, base.increments)
            reference = min(timed(base, law, AS_SHIPPED)[0] for _ in range(5))
            repeats = 3 if wanted < 1000 else 1
            (band, apex, kind), (sparse, _, _) = (
                min(timed(model, law, limit) for _ in range(repeats)) for limit in (MOST_BAND, 0)
            )
            shipped = timed(model, law, AS_SHIPPED)[2] if wanted < 4000 else "SuperLU"
            best = min(band, sparse) / reference
            found.append((len(mesh.quads), best))
            text = f"{band:9.3f}" if kind == "band" else f"{'-':>9s}"
            print(f"{len(mesh.quads):6d}{mesh.points.size - len(model.fixed):10d}{text}"
                  f"{sparse:12.3f}{best:20.1f}{shipped:>9s}{apex:10.3f}", flush=True)  # fmt: skip
    sizes, ratios = np.log([row for row in found if np.isfinite(row[1])]).T
    print(f"time grows with quads to the power {np.polyfit(sizes, ratios, 1)[0]:.2f}")


def timed(model, law, limit):
    factorisation.LARGEST_BAND = limit
    try:
        solver, done = MembraneSolver(), []
        membrane = solver._membrane(model, law)
        assert isinstance(membrane, Membrane)
        kind = type(membrane.tangent).__name__
        wall = seconds(lambda: done.append(solver.run(model, law)))
    except SolverFailure as failure:
        print(failure)
        return float("nan"), float("nan"), "failed"
    finally:
        factorisation.LARGEST_BAND = AS_SHIPPED
    apex = done[0].displacement[-1, model.mesh.node_sets["apex"][0], 2]
    return wall, float(apex), "band" if kind == "BandedTangent" else "SuperLU"


if __name__ == "__main__":
    start_on(analysis, growth)
