"""processes.py: the share of the cores that a process may use, and tasks done by copies of it."""

import contextvars
import os
import signal
from collections import Counter

import pytest
from bubblefit.processes import (
    _shares,
    copies_for,
    cores,
    may_run_at_once,
    run_side_by_side,
    share_cores,
    share_of_cores,
)


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
