"""Compare starts on the known solution: methods, seeds, where starts begin, coarse to fine."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.search import RandomStarts, SobolStarts
from bubblefit.project.project import read_project
from bubblefit.runs.executor import Executor
from bubblefit.runs.multistart import (
    SAME_MODULI,
    MultiStart,
    distinct_optima,
    moduli_difference,
)
from bubblefit.runs.setup import coarse_problem, coarse_to_fine
from bubblefit.runs.starts import StartRecord, run_start
from common import known_project, known_setup, start_on

#: By name: how, and what is remarkable about it.
METHODS = {
    "lm": (FitOptions("lm", tolerance=1e-7, max_analyses=100), "exact Jacobian, QP step"),
    "slsqp": (FitOptions("slsqp", "exact", "margin", 1e-7, 500), "exact gradient, margin"),
    "slsqp-thesis": (
        FitOptions("slsqp", "differences", "boolean", 1e-7, 600), "differences, boolean"
    ),
    "cobyla": (FitOptions("cobyla", "exact", "boolean", 1e-7, 600), "no gradient, boolean"),
}  # fmt: skip
FOUND = 1e-6
ELEMENTS, SAME = 48, 0.01


def ended(setup, options, seed, count):
    """Run starts; return e of each, the median of analyses, and best, median and worst e."""
    found = Executor().run_starts(setup.problem, options, seed, range(count))
    records = [record for record in found if isinstance(record, StartRecord)]
    e = objectives(records)
    words = f"{e.min():9.1e}{np.median(e):9.1e}{e.max():9.1e}"
    return e, float(np.median([r.analyses for r in records])), words


def objectives(records):
    return np.array([np.inf if r.objective is None else r.objective for r in records])


def methods(starts=6, *names):
    """Compare optimisers (NAMES as in the first column) from the same random feasible starts."""
    setup = known_setup(known_project())
    print(f"{'method':13s}{'':26s}{'starts':>7s}{'best':>9s}{'median':>9s}{'worst':>9s}"
          f"{'<1e-6':>7s}{'<1e-3':>7s}{'<0.5':>6s}{'analyses':>10s}{'wall, s':>9s}")  # fmt: skip
    for name in names or METHODS:
        options, how = METHODS[name]
        begun = time.perf_counter()
        e, analyses, words = ended(setup, options, setup.project.fit.seed, starts)
        wall = time.perf_counter() - begun
        below = [int((e < limit).sum()) for limit in (1e-6, 1e-3, 0.5)]
        print(f"{name:13s}{how:26s}{len(e):7d}{words}{below[0]:7d}{below[1]:7d}{below[2]:6d}"
              f"{analyses:10.0f}{wall:9.1f}", flush=True)  # fmt: skip


def seeds(count=1, starts=50):
    """Count how many of STARTS random starts of each of COUNT seeds find the known solution."""
    setup = known_setup(known_project())
    found, tried = 0, 0
    print(f"seed{'best e':>9s}{'median':>9s}{'worst':>9s}{'analyses':>10s}  below {FOUND:g}")
    for seed in range(1, count + 1):
        e, analyses, words = ended(setup, METHODS["lm"][0], seed, starts)
        below = int((e < FOUND).sum())
        found, tried = found + below, tried + len(e)
        print(f"{seed:4d}{words}{analyses:10.0f}  {below} of {len(e)}", flush=True)
    print(f"{found} of {tried} starts below {FOUND:g}")


def places(starts=12, seeds=2):
    """Compare random and Sobol starts by analyses until one ends in the best optimum."""
    setup = known_setup(known_project(ELEMENTS))
    problem = setup.problem()
    ways = {
        "random": RandomStarts(),
        "Sobol": SobolStarts(),
    }
    print("| starts | analyses a start | in the best optimum | analyses until it | ratio |")
    print("|---" * 5 + "|")
    ends = {}
    for way, problem.starts in ways.items():
        ends[way] = [run_start(problem, setup.options, seed, number, lambda _: None)
                     for seed in range(1, 1 + seeds) for number in range(starts)]  # fmt: skip
    least = min(objectives(records).min() for records in ends.values())
    limit = max((1 + SAME) * least, setup.project.fit.tolerance)
    random = None
    for way, records in ends.items():
        best = int((objectives(records) <= limit).sum())
        analyses = sum(record.analyses for record in records)
        until = analyses / best if best else np.inf
        random = random or until
        print(f"| {way} | {analyses / len(records):.1f} | {best} of {len(records)} | "
              f"{until:.1f} | {until / random:.2f} |", flush=True)  # fmt: skip


def coarse(starts=50, *project):
    """Compare starts coarse to fine with starts on the full mesh: optima and processor time.

    STARTS of the example, or of PROJECT (and the folder of its measured data).
    """
    own = read_project(project[0], *map(Path, project[1:])) if project else known_project()
    setup = known_setup(own.with_fit(starts=starts, coarse_to_fine=False))
    fine = replace(setup, project=setup.project.with_fit(coarse_to_fine=True))
    problem, tolerance = setup.problem(), setup.project.fit.tolerance
    for one in filter(None, (problem, coarse_problem(setup))):
        run_start(one, setup.options, 0, 0, lambda _: None)  # compiles, and warms caches up
    found = []
    Executor.run_tasks = in_this_process
    for name, way in (("full mesh", setup), ("coarse to fine", fine)):
        begun = time.process_time()
        records = MultiStart(way, (), lambda _: None, lambda _: None).run()
        found.append((records, time.process_time() - begun))
        e, analyses = objectives(records), sum(r.analyses for r in records)
        print(f"{name:16s} best e {min(e):.6g}, worst {max(e):.6g}, {analyses} analyses, "
              f"{found[-1][1]:.1f} s of the processor")  # fmt: skip
    (full, long), (both, short) = found
    print(coarse_to_fine(fine, both) or "")
    print(f"processor time: {short / long:.2f} of that of the full mesh")
    ends = [r for r in both if r.objective is not None and r.same_as is None]
    for group in distinct_optima(problem, full, tolerance):
        if group[0].objective is not None:
            apart = min(moduli_difference(problem, group[0], end) for end in ends)
            said = "found" if apart <= SAME_MODULI else "NOT FOUND"
            print(f"optimum e {group[0].objective:.6g} of {len(group)} starts: {said} coarse to "
                  f"fine, moduli within {100 * apart:.2g} %")  # fmt: skip


def in_this_process(self, prepare, numbers, *_, **__):
    """Run starts one after the other where their processor time can be read."""
    task = prepare()
    for number in numbers:
        yield task(number, lambda _: None)


if __name__ == "__main__":
    start_on(methods, seeds, places, coarse)
