"""CalculiX beside the membrane: cost of an analysis, and fits to data that CalculiX made.

Usage: bench_calculix.py [RUNS]. First the same bubble (200 quads, 9 increments of the law) on both
solvers in one run. Then, on a coarser mesh, one start with the membrane leading and CalculiX
correcting, and the same start with NLopt straight on CalculiX (finite differences), stopped after
RUNS runs (60 unless given).
"""

from __future__ import annotations

import sys
import time

import numpy as np
from bench_analysis import seconds
from bubblefit.errors import SolverFailure
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods.base import FitOptions
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.runs.starts import run_start
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law, known_project, known_setup, objectives_of
from threadpoolctl import threadpool_limits

METHODS = (("lm", "led by the membrane"), ("slsqp", "differences"), ("cobyla", "no derivatives"))
COARSE = 192
LEVELS = (1e-2, 1e-3, 1e-4)


def main() -> None:
    most = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    model, law = known_model_and_law()
    compare(model, {"cubic (Table 4.2)": law, "linear": HypoelasticLaw.linear(800.0, 400.0, 20.0)})
    setup = known_setup(known_project(COARSE, solver="calculix"))
    problem, known = setup.problem(), setup.tests[0].known
    assert known is not None
    quads = len(problem.comparisons[0].model.mesh.quads)
    print(f"fits to CalculiX' own data, {quads} quads, start 0: runs until e is below")
    levels = "".join(f"{level:9g}" for level in LEVELS)
    ends = f"{'runs':>7s}{'wall, s':>9s}{'e':>10s}{'E1, %':>8s}{'E2, %':>8s}{'G12, %':>8s}"
    print(f"{'':28s}{levels}{ends}")
    for method, words in METHODS:
        options = FitOptions(method, max_analyses=100 if method == "lm" else most)
        heard: list[float] = []
        hear = objectives_of("calculix", heard)
        begun = time.perf_counter()
        with threadpool_limits(1):
            record = run_start(problem, options, 1, 0, hear)
        wall = time.perf_counter() - begun
        firsts = [next((i + 1 for i, e in enumerate(heard) if e < level), None) for level in LEVELS]
        row = "".join(f"{'-' if first is None else first:>9}" for first in firsts)
        beta = problem.unknowns.beta(np.array(record.unknowns))
        error = moduli_error(known.with_beta(beta), known, np.full(3, 0.1))
        moduli = "".join(f"{100 * error[name]:8.2g}" for name in ("E1", "E2", "G12"))
        print(f"{f'{method}, {words}':28s}{row}{record.external_runs:7d}{wall:9.0f}"
              f"{record.objective:10.1e}{moduli}", flush=True)  # fmt: skip


def compare(model: BubbleModel, laws: dict[str, HypoelasticLaw]) -> None:
    """Seconds of one analysis on both solvers; the least of a few turns each."""
    print(f"{len(model.mesh.quads)} quads, {len(model.increments)} increments of the law, one core")
    membrane = MembraneSolver()
    with threadpool_limits(1):
        for name, law in laws.items():
            for element in ("S8R", "S4"):
                calculix = CalculixSolver(element=element)
                inside = min(seconds(lambda law=law: membrane.run(model, law)) for _ in range(10))
                try:
                    outside = min(
                        seconds(lambda law=law, solver=calculix: solver.run(model, law))
                        for _ in range(2)
                    )
                except SolverFailure as failure:  # S4, cubic card: docs/how-to/calculix.md
                    print(f"{name:18s} {element:4s} {failure.reason}")
                    continue
                ratio = f"{outside / inside:4.0f} times {1e3 * inside:.1f} ms"
                print(f"{name:18s} {element:4s} CalculiX {outside:6.2f} s, {ratio}", flush=True)


if __name__ == "__main__":
    main()
