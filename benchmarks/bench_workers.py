"""Run on several processes and a Dask cluster: the cost of a run."""

import sys
import time
from contextlib import contextmanager, nullcontext

import cloudpickle
import numpy as np
from bubblefit.runs.executor import Executor
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.base import hearing
from common import known_project, known_setup, start_on

#: s, of one run; and for how many s there are runs for a worker.
LENGTHS, BUSY_S = (0.01, 0.1, 1.0), 3.0


@contextmanager
def local_cluster(workers):
    from distributed import LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
    with LocalCluster(n_workers=workers, **options) as local:
        yield local.scheduler_address


@contextmanager
def cluster(workers):
    with local_cluster(workers) as address, hearing(lambda said: None):
        yield Executor(scheduler=address)


def cost(starts=8):
    """Measure what a run costs on one and two workers, here and of a Dask cluster."""
    places = (lambda count: nullcontext(Executor(count)), cluster)
    print(
        "| runs of | workers | processes here | ms a run | Dask | ms a run |\n" + "|---" * 6 + "|"
    )
    for length in LENGTHS:
        for workers in (1, 2):
            row = f"| {length:g} s | {workers} |"
            for place in places:
                with place(workers) as executor:
                    count = max(int(workers * BUSY_S / length), 2 * workers)
                    count = min(count, 200 * workers)
                    efficiency, lost = timed(executor, workers, count, length)
                row += f" {100 * efficiency:.0f} % | {1000 * lost:.1f} |"
            print(row, flush=True)
    setup = known_setup(known_project())
    for workers in (1, 2):
        efficiencies = []
        for place in places:
            with place(workers) as executor:
                begun = time.perf_counter()
                heard = executor.run_starts(setup.problem, setup.options, 1, range(starts))
                own = [record.wall_s for record in heard if isinstance(record, StartRecord)]
                wall = time.perf_counter() - begun
            efficiencies.append(f"{100 * sum(own) / workers / wall:.0f} % ({wall:.1f} s)")
        what = f"starts of {np.mean(own):.2f} s"
        print(f"| {what} | {workers} | {efficiencies[0]} | | {efficiencies[1]} | |", flush=True)


def timed(executor, workers, count, length):
    """Return the efficiency of so many runs, and s lost a run."""

    def prepare():
        def run(number, tell):
            begun = time.time()
            time.sleep(length)
            return begun, time.time()

        return run

    done = [one for one in executor.run_tasks(prepare, range(count)) if one is not None]
    first, last = min(begun for begun, _ in done), max(end for _, end in done)
    own = sum(end - begun for begun, end in done)
    return own / (workers * (last - first)), (workers * (last - first) - own) / count


if __name__ == "__main__":
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    start_on(cost)
