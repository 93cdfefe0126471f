"""Run on several processes and a Dask cluster: licences that are counted, cost of a run."""

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import contextmanager, nullcontext
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import cloudpickle
import counted_program
import numpy as np
from bubblefit.runs.executor import Executor
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.base import hearing
from bubblefit.solvers.licences import licensed
from common import known_project, known_setup, start_on
from counted_program import CountedSolver, seen

LICENCES, PROCESSES, OF_EACH, WORKERS, SECONDS, LONG = 4, 3, 2, 3, 0.05, 1.0
FORK = multiprocessing.get_context("fork")
#: s, of one run; and for how many s there are runs for a worker.
LENGTHS, BUSY_S = (0.01, 0.1, 1.0), 3.0


@contextmanager
def local_cluster(workers):
    from distributed import LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
    with LocalCluster(n_workers=workers, **options) as local:
        yield local.scheduler_address


def licences(jobs=200):
    """Run JOBS of a program of which four may run at once; kill a worker while it runs.

    Three processes and a cluster of three workers share the licences: by locks of files, by leases
    of the scheduler, and uncounted. Exit code 1 where a line is not as it has to be.
    """
    print("| counted by | at once, at most | results | lost | twice | programs begun again |")
    print("|---" * 6 + "|")
    well = True
    for counted in ("locks of files", "leases of the scheduler", "nobody"):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            # Before there are threads: the three are copies of this process.
            address, results = FORK.Queue(), FORK.Queue()
            mine, theirs = range(jobs * 2 // 5), range(jobs * 2 // 5, jobs)
            parts = [theirs[n::PROCESSES] for n in range(PROCESSES)]
            others = [
                FORK.Process(target=process, args=(folder, counted, part, address, results))
                for part in parts
            ]
            for other in others:
                other.start()
            with local_cluster(WORKERS) as there:
                for _ in others:
                    address.put(there)
                killer = threading.Thread(target=kill_one, args=(folder,))
                killer.start()
                ended = run(Executor(scheduler=there), folder, counted, mine, there)
                for _ in others:
                    ended += results.get()
                for one in (*others, killer):
                    one.join()
            found = seen(folder / "runs")
        again = sum(count > 1 for count in found.begun.values())
        of_each = Counter(ended)
        lost = sum(of_each[n] == 0 for n in range(jobs))
        twice = sum(count > 1 for count in [*of_each.values(), *found.ended.values()])
        row = f"| {counted} | {found.most} | {len(ended)} | {lost} | {twice} | {again} |"
        print(row, flush=True)
        well &= (len(ended), lost, twice, again) == (jobs, 0, 0, 1)
        well &= (found.most > LICENCES) == (counted == "nobody")
    if not well:
        sys.exit(1)


def process(folder, counted, numbers, address, results):
    results.put(run(Executor(OF_EACH), folder, counted, numbers, address.get()))


def run(executor, folder, counted, numbers, scheduler):
    def prepare():
        shared = counted == "locks of files"
        given = {
            "licences": LICENCES if counted != "nobody" else None,
            "licence_folder": str(folder / ("locks" if shared else f"locks-{os.getpid()}")),
            "licence_scheduler": None if shared else scheduler,
        }
        said = {key: value for key, value in given.items() if value is not None}

        def job(number, tell):
            # The one that is killed takes longer: it has to be killed before its end.
            counting = CountedSolver(folder / "runs", LONG if number == 0 else SECONDS)
            return licensed(counting, "counted", said).run(number, None)

        return job

    with hearing(lambda said: None):
        return [one for one in executor.run_tasks(prepare, numbers) if one is not None]


def kill_one(folder):
    while True:
        for path in (folder / "runs" / "alive").glob("*"):
            try:
                words = Path(f"/proc/{path.name}/cmdline").read_bytes().split(b"\0")
                status = Path(f"/proc/{path.name}/status").read_text()
            except OSError:
                continue
            if len(words) > 5 and words[5] == b"0":
                os.kill(int(status.split("PPid:")[1].split()[0]), signal.SIGKILL)
                return
        time.sleep(0.002)


def here(workers):
    return nullcontext(Executor(workers))


@contextmanager
def cluster(workers):
    with local_cluster(workers) as address, hearing(lambda said: None):
        yield Executor(scheduler=address)


def cost(starts=8):
    """Measure what a run costs on one and two workers, here and of a Dask cluster."""
    print(
        "| runs of | workers | processes here | ms a run | Dask | ms a run |\n" + "|---" * 6 + "|"
    )
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
    setup = known_setup(known_project())
    for workers in (1, 2):
        row = []
        for place in (here, cluster):
            with place(workers) as executor:
                begun = time.perf_counter()
                heard = executor.run_starts(setup.problem, setup.options, 1, range(starts))
                own = [record.wall_s for record in heard if isinstance(record, StartRecord)]
                wall = time.perf_counter() - begun
            row.append(f"{100 * sum(own) / workers / wall:.0f} % ({wall:.1f} s)")
        what = f"starts of {np.mean(own):.2f} s"
        print(f"| {what} | {workers} | {row[0]} | | {row[1]} | |", flush=True)


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
    cloudpickle.register_pickle_by_value(counted_program)
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    start_on(licences, cost)
