"""Starts side by side: processes that die, errors that cross their border, and order."""

from __future__ import annotations

import multiprocessing
import multiprocessing.util
import os
import signal
import struct
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import BubblefitError, InputError, SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.executor import Executor, run_tasks
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.process import run_process
from bubblefit.solvers.scratch import run_folder

from .. import needs

MODEL = BubbleModel(disk_mesh(100.0, 96, "quarter"), 0.81, [0.05, 0.15, 0.3])
KNOWN = HypoelasticLaw.linear(400.0, 250.0, 12.0)
BOUNDS = LawBounds.of_entries(
    np.array([1.0, 50.0, 50.0]),
    np.array([100.0, 1000.0, 1500.0]),
    {"E1": 5.0, "E2": 5.0, "G12": 0.5},
)


@cache
def fields() -> np.ndarray:
    """What the known law does."""
    return MembraneSolver().run(MODEL, KNOWN).displacement


def build(solver: MembraneSolver | None = None) -> FitProblem:
    data = [FieldTarget(p, u) for p, u in zip(MODEL.pressures, fields(), strict=True)]
    comparison = Comparison("bubble", MODEL, solver or MembraneSolver(), FieldObjective(data))
    unknowns = Unknowns.of(Polynomial(0), KNOWN.nu12, [0.13] * 3, BOUNDS, [comparison])
    return FitProblem((comparison,), KNOWN, unknowns)


def run_starts(problem: Any, options: FitOptions, seed: int, numbers: list[int], jobs: int) -> Any:
    return Executor(jobs).run_starts(problem, options, seed, numbers)


def study_with(jobs: int, numbers: list[int]) -> dict[int, tuple]:
    ends: dict[int, tuple] = {}
    analyses: dict[int, list[int]] = {n: [] for n in numbers}
    for record in run_starts(build, FitOptions(max_analyses=60), 5, numbers, jobs):
        if isinstance(record, StartRecord):
            assert len(analyses[record.number]) == record.analyses
            ends[record.number] = (record.objective, record.unknowns, record.analyses)
        elif record is not None:
            analyses[record.start].append(record.analysis)
    for told in analyses.values():
        assert told == list(range(1, len(told) + 1))
    return ends


def test_jobs_and_order_do_not_change_a_start():
    alone = study_with(1, [0, 1, 2, 3])
    assert all(value < 1e-6 for value, _, _ in alone.values())
    assert study_with(2, [3, 0, 1, 2]) == alone
    assert study_with(1, [2])[2] == alone[2]


class Dying(MembraneSolver):
    def _analyse(self, *arguments: Any) -> Any:
        os._exit(9)


class Broken(MembraneSolver):
    def _analyse(self, *arguments: Any) -> Any:
        raise InputError("mesh.vtu", "quads", "made to fail")


def build_dying() -> FitProblem:
    return build(Dying())


def build_broken() -> FitProblem:
    return build(Broken())


def build_failing() -> FitProblem:
    raise SolverFailure("no licence", "marc", 3004, "last line", Path("/tmp/scratch"))


def test_a_process_that_dies_is_noticed():
    with pytest.raises(BubblefitError, match="--resume") as caught:
        list(run_starts(build_dying, FitOptions(), 1, [0, 1], 2))
    assert caught.value.exit_code == 4


def test_errors_cross_the_process_border_whole():
    with pytest.raises(SolverFailure, match="no licence") as failure:
        list(run_starts(build_failing, FitOptions(), 1, [0, 1], 2))
    assert failure.value.exit_number == 3004 and failure.value.scratch == Path("/tmp/scratch")
    with pytest.raises(InputError, match=r"mesh.vtu: quads: made to fail") as caught:
        list(run_starts(build_broken, FitOptions(), 1, [0, 1], 2))
    assert caught.value.field == "quads"


def test_no_shared_memory_is_needed(monkeypatch):
    def refuse(*arguments, **named):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", refuse)
    assert sorted(filter(None, run_tasks(lambda: lambda n, tell: 10 * n, [1, 2, 3], 2))) == [
        10, 20, 30,
    ]  # fmt: skip


def killed_once(folder: Path, where: str) -> Any:
    """Task 2 kills its process the first time, before, amid or after what it says."""

    def task(number: int, tell: Any) -> tuple[int, bytes]:
        mark = folder / f"{number} was begun"
        first = number == 2 and not mark.exists()
        mark.touch()
        if first and where == "before":
            os.kill(os.getpid(), signal.SIGKILL)
        tell(("told", number))
        if first and where == "amid":
            # The length of a record, and the first bytes of it.
            os.write(tell.__self__.fileno(), struct.pack("!i", 1000) + b"x" * 10)
            os.kill(os.getpid(), signal.SIGKILL)
        if first and where == "after":
            os.kill(os.getpid(), signal.SIGKILL)
        return number, bytes(10**5)

    return task


@pytest.mark.parametrize("where", ["before", "amid", "after"])
@pytest.mark.parametrize("jobs", [1, 2])
def test_the_task_of_a_killed_process_is_done_again(tmp_path, caplog, where, jobs):
    found = []
    for record in run_tasks(lambda: killed_once(tmp_path, where), [1, 2, 3, 4], jobs):
        if record is not None:
            found.append(record)
    ended = [number for number, content in found if content == bytes(10**5)]
    assert sorted(ended) == [1, 2, 3, 4]
    (said,) = caplog.messages
    assert "exit code -9" in said
    assert not multiprocessing.active_children()


def test_what_cannot_cross_is_told_in_words():
    class Own(Exception):
        """Of a function: it cannot be pickled."""

    def task(number, tell):
        raise Own("of its own sort")

    with pytest.raises(BubblefitError, match="Own: of its own sort"):
        list(run_tasks(lambda: task, [1], 1))


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_workers_end_when_their_parent_is_killed(tmp_path):
    needs.linux("who is alive")

    def task(number, tell):
        with run_folder("t", tmp_path, False, "t", "log") as folder:
            tell((os.getpid(), folder))
            run_process(["sleep", "300"], folder, folder / "log")

    read, write = os.pipe()
    parent = os.fork()
    if parent == 0:
        for record in run_tasks(lambda: task, [1, 2], 2):
            if record is not None:
                os.write(write, f"{record[0]}\n".encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as told:
        workers = [int(told.readline()) for _ in range(2)]
        os.kill(parent, signal.SIGKILL)
        os.waitpid(parent, 0)
        deadline = time.monotonic() + 20
        while any(map(alive, workers)) or list(tmp_path.iterdir()):
            assert time.monotonic() < deadline
            time.sleep(0.05)


def test_the_processes_end_when_the_reader_stops():
    # Wherever the workers are: one was once told to end within a lock of its queue, and hung.
    for records in range(1, 7):
        running = run_starts(build, FitOptions(max_analyses=60), 5, [0, 1, 2, 3], 2)
        for _ in range(records):
            next(running)
        running.close()
        assert not multiprocessing.active_children()


def test_a_process_told_to_end_at_its_very_end_does_not_go_on_as_its_parent(monkeypatch, tmp_path):
    parent, leave = os.getpid(), os._exit

    def told_to_end(status):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.1)
        leave(status)

    monkeypatch.setattr(os, "_exit", told_to_end)
    try:
        assert list(filter(None, run_tasks(lambda: lambda number, tell: 10 * number, [1, 2], 2)))
    finally:
        if os.getpid() != parent:
            (tmp_path / "went on").touch()
            leave(0)
    assert not list(tmp_path.iterdir())


def test_processes_end_by_themselves_when_all_is_done(tmp_path):
    parent = os.getpid()

    def ending():
        atexit = multiprocessing.util.Finalize(None, written, exitpriority=1)
        assert atexit.still_active()
        return lambda number, tell: number

    def written():
        assert os.getpid() != parent
        time.sleep(0.2)
        (tmp_path / str(os.getpid())).touch()

    assert sorted(filter(None, run_tasks(ending, [1, 2, 3, 4], 2))) == [1, 2, 3, 4]
    assert len(list(tmp_path.iterdir())) == 2
