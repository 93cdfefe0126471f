"""processes.py: the share of the cores that a process may use, and tasks done by copies of it."""

import contextvars
import os
import signal
import sys
from collections import Counter

import numpy as np
import pytest
from bubblefit.processes import (
    _SharedMemory,
    _shares,
    copies_for,
    cores,
    may_run_at_once,
    run_side_by_side,
    share_cores,
    share_of_cores,
)

from .support.commands import output_of


def test_processes_share_the_cores():
    def shares():
        share_cores(2 * cores())
        return share_of_cores()

    assert share_of_cores() == cores() >= 1
    assert contextvars.copy_context().run(shares) == 1


def test_longest_tasks_are_shared_out_first():
    assert _shares([1.0, 5.0, 2.0, 2.5], 2) == [[1], [3, 2, 0]]
    assert _shares([1.0, 1.0], 3) == [[0], [1]]
    assert _shares([1.0, 0.001, 0.001], 2) == [[0, 1, 2]]  # a copy would save no time
    assert _shares([], 2) == [[]]


def test_copies_do_tasks_beside_this_process_and_keep_what_they_learn():
    calls = Counter()

    def do(number, message):
        calls[number] += 1
        return message, calls[number], os.getpid()

    with may_run_at_once(2):
        copies = copies_for(do, [1.0, 1.0, 0.5])
        runs = [copies.run([f"{turn}{k}" for k in range(3)]) for turn in "ab"]
        processes = {k: {run[k][2] for run in runs} for k in range(3)}
    assert [[message for message, _, _ in run] for run in runs] == [
        ["a0", "a1", "a2"], ["b0", "b1", "b2"]]  # fmt: skip
    assert [[count for _, count, _ in run] for run in runs] == [[1, 1, 1], [2, 2, 2]]
    assert processes[0] == processes[2] == {os.getpid()} != processes[1]
    assert calls == {0: 2, 2: 2}
    (other,) = processes[1]
    assert not copies.exist
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)


def test_no_copies_are_made_where_none_are_allowed_or_needed():
    def do(number, message):
        raise AssertionError

    assert copies_for(do, [1.0, 1.0]) is None
    with may_run_at_once(1):
        assert copies_for(do, [1.0, 1.0]) is None
    with may_run_at_once(2):
        assert copies_for(do, [1.0]) is None
        assert copies_for(do, [1.0, 0.0001]) is None


def test_tasks_of_copies_make_no_copies():
    def do(number):
        return os.getpid(), run_side_by_side(lambda _: os.getpid(), 2)

    with may_run_at_once(2):
        (first, below_first), (second, below_second) = run_side_by_side(do, 2)
        assert first == os.getpid() != second
        assert below_first == [first, first] and below_second == [second, second]
        assert len({*run_side_by_side(lambda _: os.getpid(), 2)}) == 2


def test_other_copies_take_the_place_of_the_first():
    with may_run_at_once(2):
        first = copies_for(lambda number, message: "first", [1.0, 1.0])
        second = copies_for(lambda number, message: "second", [1.0, 1.0])
        assert not first.exist and second.exist
        assert second.run([None, None]) == ["second", "second"]


def test_task_of_a_copy_that_died_is_done_here():
    here = os.getpid()

    def do(number, message):
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return number

    with may_run_at_once(2):
        copies = copies_for(do, [1.0, 1.0])
        assert copies.run([None, None]) == [0, 1]
        assert copies.run([None, None]) == [0, 1]


@pytest.mark.parametrize("size", [64, 10_000])
def test_arrays_of_a_copy_come_back_as_they_were_if_memory_holds_them_or_not(size):
    rows = np.arange(12.0).reshape(3, 4)
    results = [{"rows": rows, "columns": rows.T, "part": rows[:, 1], "words": "as before"}, None]
    memory = _SharedMemory(size)
    content, sizes = memory.pack(results)
    assert bool(sizes) == (size > 2 * rows.nbytes)
    copied, nothing = memory.unpack(content, sizes)
    memory.pack([np.zeros(24)])
    assert nothing is None and copied["words"] == "as before"
    for name in ("rows", "columns", "part"):
        np.testing.assert_array_equal(copied[name], results[0][name])
    copied["rows"][:] = 0.0


def test_machine_without_memory_to_share_passes_arrays_by_the_pipe(monkeypatch):
    def refuse(*_):
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr("mmap.mmap", refuse)
    with may_run_at_once(2):
        first, second = run_side_by_side(lambda number: np.full(3, number), 2)
    assert first.tolist() == [0, 0, 0] and second.tolist() == [1, 1, 1]


def test_error_in_a_copy_is_raised_here():
    def do(number, message):
        if number == 1:
            raise ZeroDivisionError
        return number

    with may_run_at_once(2), pytest.raises(ZeroDivisionError):
        copies_for(do, [1.0, 1.0]).run([None, None])


def test_sharing_that_would_save_little_is_balanced():
    with may_run_at_once(2):
        copies = copies_for(lambda number, message: number, [3.0, 1.0, 1.0, 1.0])
        assert copies.is_balanced([3.0, 1.0, 1.0, 1.0])
        assert copies.is_balanced([3.0, 1.2, 1.2, 1.2])
        assert not copies.is_balanced([1.0, 1.0, 1.0, 1.0])


#: Prints the numbers of threads of BLAS, a line each time, in a process that has loaded neither the
#: library of numpy nor that of scipy before: in a block of one thread, after it, in an analysis.
THREADS = """
from bubblefit.processes import one_blas_thread

def look(progress=None):
    import scipy.linalg
    from threadpoolctl import threadpool_info
    print(*(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"))

with one_blas_thread():
    look()
look()
"""
ANALYSIS = """
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

solver = MembraneSolver()
solver.progress = look
law = HypoelasticLaw.linear(800.0, 400.0, 20.0)
solver.run(BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.8, (0.05,)), law)
look()
"""


@pytest.mark.parametrize("chosen", [{}, {"OPENBLAS_NUM_THREADS": "2"}], ids=["default", "chosen"])
def test_all_libraries_of_blas_have_one_thread(chosen):
    """The environment chooses for blocks, but not for analyses, whose matrices are too small."""
    environment = {name: text for name, text in os.environ.items() if "_NUM_THREADS" not in name}
    printed = output_of(sys.executable, "-c", THREADS + ANALYSIS, env=environment | chosen)
    in_block, after_it, *in_analysis, at_last = [set(line.split()) for line in printed.splitlines()]
    several = {chosen.get("OPENBLAS_NUM_THREADS", str(cores()))}
    assert in_block == (several if chosen else {"1"})
    assert after_it == at_last == several
    assert in_analysis and all(threads == {"1"} for threads in in_analysis)
