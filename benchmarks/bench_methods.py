"""Optimisation methods on the known solution, from the same random feasible starts.

Usage: bench_methods.py [STARTS] [METHOD ...], METHOD as in the first column. The published study
(DOT's method of feasible directions on Marc, finite differences, boolean constraints): best
0.096, median 0.226, worst 3.2, 36 of 50 below 0.5.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from bubblefit.inference.methods.base import FitOptions
from bubblefit.runs.executor import Executor
from bubblefit.runs.starts import StartRecord
from known_solution import known_project, known_setup

#: Name, how, and what is remarkable about it.
METHODS = {
    "lm": FitOptions("lm", tolerance=1e-7, max_analyses=100),
    "slsqp": FitOptions("slsqp", "exact", "margin", 1e-7, 500),
    "slsqp-thesis": FitOptions("slsqp", "differences", "boolean", 1e-7, 600),
    "cobyla": FitOptions("cobyla", "exact", "boolean", 1e-7, 600),
}
HOW = {
    "lm": "exact Jacobian, QP step",
    "slsqp": "exact gradient, margin",
    "slsqp-thesis": "differences, boolean",
    "cobyla": "no gradient, boolean",
}


def main() -> None:
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    names = sys.argv[2:] or list(METHODS)
    setup = known_setup(known_project())
    build, seed = setup.problem, setup.project.fit.seed
    print(f"{'method':13s}{'':26s}{'starts':>7s}{'best':>9s}{'median':>9s}{'worst':>9s}"
          f"{'<1e-6':>7s}{'<1e-3':>7s}{'<0.5':>6s}{'analyses':>10s}{'wall, s':>9s}")  # fmt: skip
    for name in names:
        begun = time.perf_counter()
        records = [
            record
            for record in Executor().run_starts(build, METHODS[name], seed, range(starts))
            if isinstance(record, StartRecord)
        ]
        wall = time.perf_counter() - begun
        e = np.array([np.inf if r.objective is None else r.objective for r in records])
        analyses = np.median([r.analyses for r in records])
        below = [int((e < limit).sum()) for limit in (1e-6, 1e-3, 0.5)]
        print(f"{name:13s}{HOW[name]:26s}{len(e):7d}{e.min():9.1e}{np.median(e):9.1e}"
              f"{e.max():9.1e}{below[0]:7d}{below[1]:7d}{below[2]:6d}{analyses:10.0f}"
              f"{wall:9.1f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
