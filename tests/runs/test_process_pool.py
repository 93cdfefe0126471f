"""Tasks side by side in processes of this machine: the same results, whoever dies on the way."""

import multiprocessing
import multiprocessing.util
import os
import signal
import struct
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import BubblefitError
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs import process_pool
from bubblefit.runs.executor import Executor
from bubblefit.runs.process_pool import ProcessPool
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.process import run_process
from bubblefit.solvers.scratch import run_folder

from ..support import needs
from ..support.commands import alive, wait_for
from ..support.refusals import raised

MODEL = BubbleModel(disk_mesh(100.0, 96, "quarter"), 0.81, [0.05, 0.15, 0.3])


KNOWN = HypoelasticLaw.linear(400.0, 250.0, 12.0)


LOWER, UPPER = np.array([1.0, 50.0, 50.0]), np.array([100.0, 1000.0, 1500.0])


BOUNDS = LawBounds({"E1": 5.0, "E2": 5.0, "G12": 0.5}, None, np.array(LOWER), np.array(UPPER))


@cache
def fields():
    return MembraneSolver().run(MODEL, KNOWN).displacement


def build():
    data = [FieldTarget(p, u) for p, u in zip(MODEL.pressures, fields(), strict=True)]
    comparison = Comparison("bubble", MODEL, MembraneSolver(), FieldObjective(data))
    unknowns = Unknowns.of(Polynomial(0), KNOWN.nu12, [0.13] * 3, BOUNDS, [comparison])
    return FitProblem((comparison,), KNOWN, unknowns)


def run_tasks(prepare, numbers, jobs):
    return ProcessPool(prepare, numbers, jobs, "starts").run()


def run_starts(problem, options, seed, numbers, jobs):
    return Executor(jobs).run_starts(problem, options, seed, numbers)


def study_with(jobs, numbers):
    ends, analyses = {}, {n: [] for n in numbers}
    for record in run_starts(build, FitOptions(max_analyses=60), 5, numbers, jobs):
        if isinstance(record, StartRecord):
            assert len(analyses[record.number]) == record.analyses
            ends[record.number] = (record.objective, record.unknowns, record.analyses)
        elif record is not None:
            analyses[record.start].append(record.analysis)
    for told in analyses.values():
        assert told == list(range(1, len(told) + 1))
    return ends


def test_jobs_and_their_order_do_not_change_a_start():
    alone = study_with(1, [0, 1, 2, 3])
    assert all(value < 1e-6 for value, _, _ in alone.values())
    assert study_with(2, [3, 0, 1, 2]) == alone
    assert study_with(1, [2])[2] == alone[2]


@pytest.mark.parametrize(
    ("jobs", "tasks", "shares"), [(1, 4, (1, 1)), (4, 9, (4, 1)), (5, 2, (2, 2)), (3, 0, (1, 3))]
)
def test_tasks_fewer_than_jobs_share_the_processes(monkeypatch, jobs, tasks, shares):
    given = []

    def worker(context, prepare, *numbers):
        given.append(numbers)
        return SimpleNamespace(give=lambda number: None)

    monkeypatch.setattr(process_pool, "Worker", worker)
    ProcessPool(build, range(tasks), jobs, "starts").start_worker()
    assert given == [shares] and all(isinstance(number, int) for number in given[0])


def test_death_of_a_process_is_noticed():
    words = r"died \(exit code 9; out of memory\?\) at task 5 of the starts, as .* with --resume"
    with pytest.raises(BubblefitError, match=words) as caught:
        list(run_tasks(lambda: lambda number, tell: os._exit(9), [5], 2))
    assert caught.value.exit_code == 4


def test_no_shared_memory_is_needed(monkeypatch):
    def refuse(*arguments, **named):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", refuse)
    told = run_tasks(lambda: lambda n, tell: 10 * n, [1, 2, 3], 2)
    assert sorted(filter(None, told)) == [10, 20, 30]


def killed_once(folder, where):
    """Task 2 kills its process the first time, before, amid or after what it says."""

    def task(number, tell):
        mark = folder / f"{number} was begun"
        first = number == 2 and not mark.exists()
        mark.touch()
        if first and where == "before":
            os.kill(os.getpid(), signal.SIGKILL)
        tell(("told", number))
        if first and where == "amid":
            # The length of a record, and the first bytes of it.
            os.write(tell.__self__.fileno(), struct.pack("!i", 1000) + b"x" * 10)
        if first:
            os.kill(os.getpid(), signal.SIGKILL)
        return number, bytes(10**5)

    return task


@pytest.mark.parametrize("where", ["before", "amid", "after"])
@pytest.mark.parametrize("jobs", [1, 2])
def test_task_of_a_killed_process_is_done_again(tmp_path, caplog, where, jobs):
    found = [*filter(None, run_tasks(lambda: killed_once(tmp_path, where), [1, 2, 3, 4], jobs))]
    ended = [number for number, content in found if content == bytes(10**5)]
    assert sorted(ended) == [1, 2, 3, 4]
    (said,) = caplog.messages
    assert "exit code -9" in said
    assert not multiprocessing.active_children()


def test_task_that_cannot_be_pickled_is_an_error_in_words():
    class Own(Exception):
        """Of a function: it cannot be pickled."""

    def task(number, tell):
        raise Own("of its own sort")

    raised(BubblefitError, "Own: of its own sort", list, run_tasks(lambda: task, [1], 1))


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
        wait_for(lambda: not any(map(alive, workers)) and not list(tmp_path.iterdir()), 20)


def test_processes_end_when_their_reader_stops():
    # Wherever the workers are: one was once told to end within a lock of its queue, and hung.
    for records in range(1, 7):
        running = run_starts(build, FitOptions(max_analyses=60), 5, [0, 1, 2, 3], 2)
        for _ in range(records):
            next(running)
        running.close()
        assert not multiprocessing.active_children()
