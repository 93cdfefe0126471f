"""Licences: 200 runs of a program of which four may run at once; who dies on the way takes none.

Three processes, each with two of its own, and a Dask cluster of three local workers share four
licences; a worker is killed (SIGKILL) while its program runs. The program itself writes down how
many copies run (tests/counted_program.py). Once all lock the same files; once every process locks
files of its own, so that only the cluster's scheduler counts. With none counted at all it is shown
that more than four would run.

Usage: bench_licences.py [JOBS]. Ends with exit code 1 where a line is not as it has to be.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import cloudpickle
import counted_program
from bubblefit.runs.executor import Executor
from bubblefit.solvers.base import hearing
from bubblefit.solvers.licences import licensed
from counted_program import CountedSolver, seen

LICENCES, PROCESSES, OF_EACH, WORKERS, SECONDS, LONG = 4, 3, 2, 3, 0.05, 1.0
FORK: Any = multiprocessing.get_context("fork")


def main(arguments: Sequence[str]) -> None:
    from distributed import LocalCluster

    jobs = int(arguments[0]) if arguments else 200
    cloudpickle.register_pickle_by_value(counted_program)
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    print("| counted by | at once, at most | results | lost | twice | programs begun again |")
    print("|---|---|---|---|---|---|")
    well = True
    for counted in ("locks of files", "leases of the scheduler", "nobody"):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            # Before there are threads: the three are copies of this process.
            address, results = FORK.Queue(), FORK.Queue()
            mine, theirs = range(jobs * 2 // 5), range(jobs * 2 // 5, jobs)
            others = [
                FORK.Process(
                    target=process, args=(folder, counted, theirs[n::PROCESSES], address, results)
                )
                for n in range(PROCESSES)
            ]
            for other in others:
                other.start()
            options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
            with LocalCluster(n_workers=WORKERS, **options) as cluster:
                for _ in others:
                    address.put(cluster.scheduler_address)
                killer = threading.Thread(target=kill_one, args=(folder,))
                killer.start()
                there = cluster.scheduler_address
                ended = run(Executor(scheduler=there), folder, counted, mine, there)
                for _ in others:
                    ended += results.get()
                for other in others:
                    other.join()
                killer.join()
            found = seen(folder / "runs")
        again = sum(count > 1 for count in found.begun.values())
        of_each = Counter(ended)
        lost = sum(of_each[n] == 0 for n in range(jobs))
        twice = sum(count > 1 for count in [*of_each.values(), *found.ended.values()])
        print(f"| {counted} | {found.most} | {len(ended)} | {lost} | {twice} | {again} |")
        sys.stdout.flush()
        well &= (len(ended), lost, twice, again) == (jobs, 0, 0, 1)
        well &= found.most > LICENCES if counted == "nobody" else found.most <= LICENCES
    sys.exit(0 if well else 1)


def process(folder: Path, counted: str, numbers: Sequence[int], address: Any, results: Any) -> None:
    """One of the three."""
    results.put(run(Executor(OF_EACH), folder, counted, numbers, address.get()))


def run(
    executor: Executor, folder: Path, counted: str, numbers: Sequence[int], scheduler: str
) -> list[int]:
    """The jobs of these numbers; the results that came."""

    def prepare() -> Callable[[int, Any], Any]:
        shared = counted == "locks of files"
        given = {
            "licences": LICENCES if counted != "nobody" else None,
            "licence_folder": str(folder / ("locks" if shared else f"locks-{os.getpid()}")),
            "licence_scheduler": None if shared else scheduler,
        }
        said = {key: value for key, value in given.items() if value is not None}

        def job(number: int, tell: Any) -> Any:
            # The one that is killed takes longer: it has to be killed before its end.
            seconds = LONG if number == 0 else SECONDS
            solver: Any = licensed(CountedSolver(folder / "runs", seconds), "counted", said)
            return solver.run(number, None)

        return job

    with hearing(lambda said: None):
        return [one for one in executor.run_tasks(prepare, numbers) if one is not None]


def kill_one(folder: Path) -> None:
    """Kill the worker of the cluster that has job 0, while its program runs."""
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


if __name__ == "__main__":
    main(sys.argv[1:])
