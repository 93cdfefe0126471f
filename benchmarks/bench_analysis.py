"""Cost of one bubble analysis and of its gradient.

Usage: bench_analysis.py [REPEATS]. The quarter model of the known-solution example (thesis: 800
quads, here 200 in the quarter). The variants take turns, so that a busy machine slows all alike,
and the least time of each is printed: other programs can only add to it.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from bubblefit.solvers.base import parameters_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law
from threadpoolctl import threadpool_info, threadpool_limits


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    model, law = known_model_and_law()
    solver = MembraneSolver()
    # Warm starts come from a neighbour, as in a fit that is settling: 0.1 % away, with its slope.
    near = law.with_beta(1.001 * law.beta)
    history, _ = solver.run_with_sensitivity(model, near)
    guess = history.path + history.path_slope @ (law.beta - near.beta)
    threads = max((info["num_threads"] for info in threadpool_info()), default=1)

    def all_threads() -> None:
        solver.run(model, law)

    variants: dict[str, Callable[[], object]] = {
        "analysis, cold": lambda: solver.run(model, law),
        "analysis, warm": lambda: solver.run(model, law, guess=guess),
        "with 12 derivatives, cold": lambda: solver.run_with_sensitivity(model, law),
        "with 12 derivatives, warm": lambda: solver.run_with_sensitivity(model, law, guess=guess),
        "with all 14, cold": lambda: solver.run_with_sensitivity(model, law, parameters_of(law)),
    }
    times: dict[str, list[float]] = {name: [] for name in variants}
    with threadpool_limits(1):
        for _ in range(repeats):
            for name, run in variants.items():
                times[name].append(seconds(run))
    parallel = [seconds(all_threads) for _ in range(5)]
    base = min(times["analysis, cold"])
    print(f"{len(model.mesh.quads)} quads, {len(model.increments)} increments, one core")
    print(f"{'':28s}{'ms':>8s}{'a second':>10s}{'in cold analyses':>18s}")
    for name, values in times.items():
        t = min(values)
        print(f"{name:28s}{1e3 * t:8.1f}{1 / t:10.0f}{t / base:18.2f}")
    t = min(parallel)
    print(f"{f'cold, {threads} BLAS threads':28s}{1e3 * t:8.1f}{1 / t:10.0f}{t / base:18.2f}")
    gradient = min(times["with 12 derivatives, cold"]) / base - 1
    print(f"a gradient costs {gradient:.2f} of an analysis (goal: at most 0.5)")


def seconds(run: Callable[[], object]) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


if __name__ == "__main__":
    main()
