"""Starts coarse to fine beside starts on the full mesh: the same optima, and how much less time.

Both ways in one run, in this one process, in processor time. Every distinct optimum of the full way
is looked for among those of the other; optima are told apart as a fit does it (`runs/fit.py`).

Usage: bench_coarse.py [STARTS] [PROJECT [DATA]]. STARTS of the example with a known solution (50),
or of another project, whose measured data lie in the folder DATA.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.project.project import Project, read_project
from bubblefit.runs import fit as stages
from bubblefit.runs.executor import Executor
from bubblefit.runs.fit import SAME_MODULI, distinct, moduli_apart
from bubblefit.runs.setup import CoarseToFine, FitSetup, coarse_problem
from bubblefit.runs.starts import StartRecord, run_start
from known_solution import known_project, known_setup


def every_start(setup: FitSetup) -> tuple[list[StartRecord], float]:
    """How every start ended, and the seconds of the processor that it took."""
    begun = time.process_time()
    records = stages.every_start(setup, (), lambda _: None, lambda _: None)
    return records, time.process_time() - begun


def in_this_process() -> None:
    """Starts run one after the other where their time can be read."""

    def run_tasks(self, prepare, numbers, *_, **__):  # type: ignore[no-untyped-def]
        task = prepare()
        for number in numbers:
            yield task(number, lambda _: None)

    Executor.run_tasks = run_tasks  # type: ignore[method-assign]


def main(arguments: Sequence[str]) -> None:
    """Print both ways side by side."""
    starts = int(arguments[0]) if arguments else 50
    project: Project = known_project()
    if len(arguments) > 1:
        project = read_project(arguments[1], *map(Path, arguments[2:]))
    setup = known_setup(project.with_fit(starts=starts))
    fine = replace(setup, project=setup.project.with_fit(coarse_to_fine=True))
    problem = setup.problem()
    for one in filter(None, (problem, coarse_problem(setup))):
        run_start(one, setup.options, 0, 0, lambda _: None)  # compiles, and warms caches up
    in_this_process()
    (full, long), (both, short) = every_start(setup), every_start(fine)

    tolerance = setup.project.fit.tolerance
    for name, records, seconds in (("full mesh", full, long), ("coarse to fine", both, short)):
        e = [np.inf if r.objective is None else r.objective for r in records]
        analyses = sum(r.analyses for r in records)
        print(f"{name:16s} best e {min(e):.6g}, worst {max(e):.6g}, {analyses} analyses, "
              f"{seconds:.1f} s of the processor")  # fmt: skip
    meshes = CoarseToFine.of(fine, both)
    print("" if meshes is None else meshes.words)
    print(f"processor time: {short / long:.2f} of that of the full mesh")
    groups = [g for g in distinct(problem, full, tolerance) if g[0].objective is not None]
    ends = [r for r in both if r.objective is not None and r.same_as is None]
    for group in groups:
        apart = min(moduli_apart(problem, group[0], end) for end in ends)
        said = "found" if apart <= SAME_MODULI else "NOT FOUND"
        print(f"optimum e {group[0].objective:.6g} of {len(group)} starts: {said} coarse to fine, "
              f"moduli within {100 * apart:.2g} %")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
