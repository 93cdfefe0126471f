"""What becomes of a mutant: the tests that run its line, on the copy with the change in it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

from . import server
from .drawing import Mutant
from .house import environment, instead
from .measured import Measured

#: A test that takes this many times its own time, and so many seconds (a fixture may have been
#: made for another test when it was measured), runs for ever.
PATIENCE = (4.0, 60.0)
#: What the tests load anyway, once for all of them.
LIBRARIES = (
    "click", "gmsh", "hypothesis", "jinja2", "matplotlib.backends.backend_agg", "meshio", "nlopt",
    "numba", "pandas", "pydantic", "pytest", "quadprog", "rich.console", "scipy.interpolate",
    "scipy.optimize", "scipy.sparse.linalg", "tomli_w",
)  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """outcome: caught, survived, late (the tests did not end: a loop without an end, or a busy
    machine), or unrun (no test runs the line); by: the test that caught it; tests: how many there
    were to catch it"""

    mutant: Mutant
    outcome: str
    by: str = ""
    tests: int = 0


class Judge:
    """Tests run by a process of its own (`server`) in the copy `house`, libraries loaded before."""

    def __init__(
        self, house: Path, measured: Measured, limit: float, libraries: Sequence[str] = LIBRARIES
    ) -> None:
        self.house, self.measured, self.limit, self.libraries = house, measured, limit, libraries
        self.unfit: set[str] = set()
        self.process: subprocess.Popen[str]

    def __enter__(self) -> Judge:
        self.process = subprocess.Popen(
            [sys.executable, server.__file__, *self.libraries],
            cwd=self.house,
            env=environment(self.house),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()

    def run(self, tests: list[str]) -> dict[str, str]:
        """outcome and test as `server.outcome` has them."""
        factor, least = PATIENCE
        seconds = least + factor * sum(map(self.measured.cost, tests))
        into: IO[Any] | None = self.process.stdin
        out: IO[Any] | None = self.process.stdout
        assert into is not None and out is not None
        into.write(json.dumps({"tests": tests, "seconds": seconds}) + "\n")
        into.flush()
        return json.loads(out.readline())

    def judge(self, mutant: Mutant) -> Verdict:
        """A test that fails without the change, too, catches nothing and is left out."""
        while True:
            where = mutant.file, mutant.first, mutant.last
            tests = self.measured.tests(*where, self.limit, mutant.loading)
            tests = [test for test in tests if test not in self.unfit]
            if not tests:
                return Verdict(mutant, "unrun")
            with instead(self.house / mutant.file, mutant.source):
                done = self.run(tests)
            by = done["test"]
            if done["outcome"] in ("survived", "late"):
                return Verdict(mutant, done["outcome"], tests=len(tests))
            if by not in self.measured.seconds or self.fit(by):
                return Verdict(mutant, "caught", by, len(tests))

    def fit(self, test: str) -> bool:
        """Whether a test passes on the code as it is, alone in this process."""
        if self.run([test])["outcome"] != "survived":
            self.unfit.add(test)
        return test not in self.unfit


@contextmanager
def judge(
    house: Path, measured: Measured, limit: float, libraries: Sequence[str] = LIBRARIES
) -> Iterator[Judge]:
    """A judge whose process ends with the block."""
    with Judge(house, measured, limit, libraries) as one:
        yield one


def verdicts(
    houses: Sequence[Path],
    mutants: Iterable[Mutant],
    measured: Measured,
    limit: float,
    end: float = float("inf"),
    libraries: Sequence[str] = LIBRARIES,
) -> Iterator[Verdict]:
    """Of the mutants, in their order, until the time is `end`; a judge in each of the copies."""
    free: SimpleQueue[Judge] = SimpleQueue()

    def one(mutant: Mutant) -> Verdict | None:
        if time.monotonic() >= end:
            return None
        judge = free.get()
        try:
            return judge.judge(mutant)
        finally:
            free.put(judge)

    with ExitStack() as stack:
        for house in houses:
            free.put(stack.enter_context(judge(house, measured, limit, libraries)))
        with ThreadPoolExecutor(len(houses)) as pool:
            yield from filter(None, pool.map(one, mutants))
