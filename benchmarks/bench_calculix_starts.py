"""Fits to data that CalculiX made, from random starts, the membrane leading.

Usage: bench_calculix_starts.py [STARTS]. The known solution on 48 S8R shells, starts 0 to
STARTS - 1 of seed 1 (1 unless given): e after each run of CalculiX, and how far the moduli are off
over the strains reached. `bench_calculix_starts.py 10` makes the ten starts of
docs/validation/results.md.
"""

from __future__ import annotations

import sys

import numpy as np
from bubblefit.inference.assessment import moduli_error
from bubblefit.inference.methods.base import FitOptions
from bubblefit.runs.starts import run_start
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_project, known_setup, objectives_of
from threadpoolctl import threadpool_limits

#: Quads of the full disk.
COARSE = 192


def main() -> None:
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    setup = known_setup(known_project(COARSE, solver="calculix"))
    problem, known = setup.problem(), setup.tests[0].known
    assert known is not None
    reached = MembraneSolver().run(problem.comparisons[0].model, known).strain_max
    for number in range(starts):
        heard: list[float] = []
        hear = objectives_of("calculix", heard)
        with threadpool_limits(1):
            record = run_start(problem, FitOptions("lm", max_analyses=100), 1, number, hear)
        law = known.with_beta(problem.unknowns.beta(np.array(record.unknowns)))
        error = 100 * max(moduli_error(law, known, reached).values())
        runs = ", ".join(f"{e:.1e}" for e in heard)
        print(f"start {number}: e = {runs}; moduli within {error:.1g} %", flush=True)


if __name__ == "__main__":
    main()
