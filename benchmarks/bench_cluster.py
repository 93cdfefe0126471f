"""One and two workers, processes of this machine and of a Dask cluster, beside the cost of a run.

Efficiency is the time of the runs alone, over workers times the time from the first run to the last
(a worker is got ready before). Runs are those of a program that sleeps, so that cores which others
use cannot make a worker slower: what is lost is what bubblefit and Dask take. Then starts of the
example with a known solution, whose own seconds are measured, as a fit runs them.

From these costs a study is reckoned on paper: 1,000 starts on 100 workers, handed out one after the
other by one client, as fast as it serves many workers here, their lengths drawn from the starts
measured.

Usage: bench_cluster.py [STARTS]: of the example (8).
"""

from __future__ import annotations

import heapq
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import cloudpickle
import numpy as np
from bubblefit.runs.executor import Executor
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.base import hearing
from known_solution import known_project, known_setup

#: s, of one run; and for how many s there are runs for a worker.
LENGTHS, BUSY_S = (0.01, 0.1, 1.0), 3.0
#: s: a run of CalculiX on the example's bubble, docs/how-to/calculix.md; runs of it in a start.
CALCULIX_S, CALCULIX_RUNS = 4.0, 4
STUDY, WORKERS = 1000, 100
#: Of each of two workers, and short runs for them: more than the client can hand out.
THREADS, MANY = 16, 1000


def main(arguments: Sequence[str]) -> None:
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    print("| runs of | workers | processes here | ms a run | Dask | ms a run |")
    print("|---|---|---|---|---|---|")
    for length in LENGTHS:
        for workers in (1, 2):
            row = f"| {length:g} s | {workers} |"
            for place in (here, cluster):
                with place(workers) as executor:
                    count = max(int(workers * BUSY_S / length), 2 * workers)
                    count = min(count, 200 * workers)
                    efficiency, lost = timed(executor, workers, count, length)
                row += f" {100 * efficiency:.0f} % | {1000 * lost:.1f} |"
            print(row, flush=True)
    starts = int(arguments[0]) if arguments else 8
    seconds: list[float] = []
    setup = known_setup(known_project())
    for workers in (1, 2):
        row = []
        for place in (here, cluster):
            with place(workers) as executor:
                begun = time.perf_counter()
                told = executor.run_starts(setup.problem, setup.options, 1, range(starts))
                ended = [r for r in told if isinstance(r, StartRecord)]
                wall = time.perf_counter() - begun
            own = [record.wall_s for record in ended]
            seconds += own
            row.append(f"{100 * sum(own) / workers / wall:.0f} % ({wall:.1f} s)")
        what = f"starts of {np.mean(own):.2f} s"
        print(f"| {what} | {workers} | {row[0]} | | {row[1]} | |", flush=True)
    with cluster(2, THREADS) as executor:
        begun = time.perf_counter()
        timed(executor, 2 * THREADS, MANY, LENGTHS[0])
        handing = (time.perf_counter() - begun) / MANY
    print(f"\nmore workers than it can serve: {1 / handing:.0f} runs a second, "
          f"{1000 * handing:.1f} ms of the client for each")  # fmt: skip
    on_paper(np.array(seconds), handing)


@contextmanager
def here(workers: int) -> Iterator[Executor]:
    """Processes of this machine."""
    yield Executor(workers)


@contextmanager
def cluster(workers: int, threads: int = 1) -> Iterator[Executor]:
    """Workers of a Dask cluster on this machine."""
    from distributed import LocalCluster

    options = {"threads_per_worker": threads, "dashboard_address": ":0", "silence_logs": 50}
    with LocalCluster(n_workers=workers, **options) as local, hearing(lambda said: None):
        yield Executor(scheduler=local.scheduler_address)


def timed(executor: Executor, workers: int, count: int, length: float) -> tuple[float, float]:
    """Efficiency of so many runs, and s lost a run."""

    def prepare() -> Callable[[int, Any], tuple[float, float]]:
        def run(number: int, tell: Any) -> tuple[float, float]:
            begun = time.time()
            time.sleep(length)
            return begun, time.time()

        return run

    told = [t for t in executor.run_tasks(prepare, range(count)) if t is not None]
    first, last = min(begun for begun, _ in told), max(end for _, end in told)
    own = sum(end - begun for begun, end in told)
    return own / (workers * (last - first)), (workers * (last - first) - own) / count


def on_paper(seconds: np.ndarray, handing: float) -> None:
    """1,000 starts on 100 workers, from starts measured; `handing` s of the client for each."""
    random = np.random.default_rng(1)
    print()
    print(f"{STUDY} starts on {WORKERS} workers, on paper (s):")
    print("| starts | seconds each | one worker | 100 workers | efficiency |")
    print("|---|---|---|---|---|")
    for name, factor in (
        ("membrane", 1.0),
        (f"CalculiX, {CALCULIX_RUNS} runs of {CALCULIX_S:g} s", 0.0),
    ):
        spread = seconds / seconds.mean()
        mean = seconds.mean() if factor else CALCULIX_S * CALCULIX_RUNS
        lengths = mean * random.choice(spread, STUDY)
        wall = scheduled(lengths, handing)
        alone = float(np.sum(lengths + handing))
        print(f"| {name} | {mean:.2f} | {alone:.0f} | {wall:.1f} | "
              f"{100 * np.sum(lengths) / (WORKERS * wall):.0f} % |")  # fmt: skip


def scheduled(lengths: np.ndarray, handing: float) -> float:
    """When the last ends: each goes to the first worker that is free, one after the other."""
    free, client, end = [0.0] * WORKERS, 0.0, 0.0
    heapq.heapify(free)
    for length in lengths:
        client = max(client, free[0]) + handing  # one client hands out, one at a time
        heapq.heapreplace(free, client + float(length))
        end = max(end, client + float(length))
    return end


if __name__ == "__main__":
    main(sys.argv[1:])
