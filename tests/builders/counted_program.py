"""A program of which only so many copies may run: each writes down how many there were with it.

As a script: counted_program.py FOLDER NUMBER SECONDS. Every copy locks a file of its own, which
the kernel unlocks when it ends, in whatever way; the copies whose files are locked are those that
run. What they see is written line by line below one lock: `begin NUMBER ALIVE`, `end NUMBER 0`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LOG, ALIVE = "log", "alive"


def work(folder: Path, number: str, seconds: float) -> None:
    import fcntl
    import os
    import time

    own = os.open(folder / ALIVE / str(os.getpid()), os.O_RDWR | os.O_CREAT)
    with open(folder / LOG, "a") as log:
        fcntl.flock(log, fcntl.LOCK_EX)
        fcntl.flock(own, fcntl.LOCK_EX)
        alive = 0
        for path in (folder / ALIVE).iterdir():
            other = os.open(path, os.O_RDWR)
            try:
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()  # it has ended
            except BlockingIOError:
                alive += 1
            os.close(other)
        log.write(f"begin {number} {alive}\n")
    time.sleep(seconds)
    with open(folder / LOG, "a") as log:
        fcntl.flock(log, fcntl.LOCK_EX)
        log.write(f"end {number} 0\n")


@dataclass
class CountedSolver:
    """A solver that only starts the program; its models are the numbers of the jobs."""

    folder: Path
    seconds: float = 0.02
    name: str = "counted"
    external: bool = True
    progress: Callable[[Any], None] | None = None
    identity: str = "counted 1"

    def __post_init__(self) -> None:
        (self.folder / ALIVE).mkdir(parents=True, exist_ok=True)

    def run(self, model: Any, law: Any, scratch: Any = None, timeout: Any = None) -> Any:
        from bubblefit.errors import SolverFailure
        from bubblefit.solvers.process import run_process

        command = [sys.executable, "-I", "-S", __file__, self.folder, str(model), str(self.seconds)]
        outcome = run_process(command, self.folder, self.folder / f"job-{model}.txt", timeout)
        if outcome.exit_code:
            raise SolverFailure(f"job {model} was killed", self.name, outcome.exit_code)
        return model

    def check(self) -> Any:
        from bubblefit.solvers.base import SolverCheck

        return SolverCheck(self.name, True, "1", True)


@dataclass(frozen=True)
class CountedCopies:
    """What the copies wrote: how many ran at once at most, and how often each began and ended."""

    most: int
    begun: dict[str, int]
    ended: dict[str, int]


def counted_copies(folder: Path) -> CountedCopies:
    most, begun, ended = 0, dict[str, int](), dict[str, int]()
    for line in (folder / LOG).read_text().splitlines():
        what, number, alive = line.split()
        count = begun if what == "begin" else ended
        count[number] = count.get(number, 0) + 1
        most = max(most, int(alive))
    return CountedCopies(most, begun, ended)


if __name__ == "__main__":
    work(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
