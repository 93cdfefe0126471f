"""The known solution from other random starts: how many find it, seed by seed.

Usage: bench_seeds.py [SEEDS] [STARTS]. Seeds 1 to SEEDS (1 unless given), STARTS each (50), the
default method. `bench_seeds.py 8` makes the 400 starts of docs/validation/results.md.
"""

from __future__ import annotations

import sys

import numpy as np
from bubblefit.inference.methods.base import FitOptions
from bubblefit.runs.executor import Executor
from bubblefit.runs.starts import StartRecord
from known_solution import known_project, known_setup

FOUND = 1e-6


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    starts = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    setup = known_setup(known_project())
    options = FitOptions("lm", tolerance=1e-7, max_analyses=100)
    found, tried = 0, 0
    print(
        f"{'seed':>4s}{'best e':>9s}{'median':>9s}{'worst':>9s}{'analyses':>10s}  below {FOUND:g}"
    )
    for seed in range(1, seeds + 1):
        records = [
            record
            for record in Executor().run_starts(setup.problem, options, seed, range(starts))
            if isinstance(record, StartRecord)
        ]
        e = np.array([np.inf if r.objective is None else r.objective for r in records])
        analyses = np.median([r.analyses for r in records])
        found, tried = found + int((e < FOUND).sum()), tried + len(e)
        print(f"{seed:4d}{e.min():9.1e}{np.median(e):9.1e}{e.max():9.1e}{analyses:10.0f}"
              f"  {int((e < FOUND).sum())} of {len(e)}", flush=True)  # fmt: skip
    print(f"{found} of {tried} starts below {FOUND:g}")


if __name__ == "__main__":
    main()
