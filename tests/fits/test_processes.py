"""Starts side by side: processes that die, errors that cross their border, and order."""

from __future__ import annotations

import multiprocessing.util
import os
import signal
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import BubblefitError, InputError, SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.fits.processes import _here, run_starts, run_tasks
from bubblefit.fits.start import StartRecord
from bubblefit.identification.bounds import LawBounds
from bubblefit.identification.comparison import Comparison
from bubblefit.identification.methods import FitOptions
from bubblefit.identification.problem import FitProblem
from bubblefit.identification.unknowns import Unknowns
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.models.bubble import BubbleModel
from bubblefit.solvers.membrane.solver import MembraneSolver

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


def test_jobs_and_order_do_not_change_a_start() -> None:
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


def test_a_process_that_dies_is_noticed() -> None:
    with pytest.raises(BubblefitError, match="--resume") as caught:
        list(run_starts(build_dying, FitOptions(), 1, [0, 1], 2))
    assert caught.value.exit_code == 4


def test_errors_cross_the_process_border_whole() -> None:
    with pytest.raises(SolverFailure, match="no licence") as failure:
        list(run_starts(build_failing, FitOptions(), 1, [0, 1], 2))
    assert failure.value.exit_number == 3004 and failure.value.scratch == Path("/tmp/scratch")
    with pytest.raises(InputError, match=r"mesh.vtu: quads: made to fail") as caught:
        list(run_starts(build_broken, FitOptions(), 1, [0, 1], 2))
    assert caught.value.field == "quads"


def test_without_shared_memory_one_process_does_it_all(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A container with /dev/shm missing or read-only cannot make the semaphores of a queue."""

    def refuse(*arguments: Any, **named: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", refuse)
    ends = study_with(2, [0, 1])
    assert all(value < 1e-6 for value, _, _ in ends.values())
    assert "one process only" in caplog.text


def test_the_processes_end_when_the_reader_stops() -> None:
    import multiprocessing

    # Wherever the workers are: one was once told to end within a lock of its queue, and hung.
    for records in range(1, 7):
        running = run_starts(build, FitOptions(max_analyses=60), 5, [0, 1, 2, 3], 2)
        for _ in range(records):
            next(running)
        running.close()
        assert not multiprocessing.active_children()


def test_a_process_told_to_end_at_its_very_end_does_not_go_on_as_its_parent(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It is a copy of the parent: an exception would run through the code that started it."""
    parent, leave = os.getpid(), os._exit

    def told_to_end(status: int) -> None:
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


def test_processes_end_by_themselves_when_all_is_done(tmp_path: Path) -> None:
    """They are not killed while they still write what they have to write."""
    parent = os.getpid()

    def ending() -> Any:
        atexit = multiprocessing.util.Finalize(None, written, exitpriority=1)
        assert atexit.still_active()
        return lambda number, tell: number

    def written() -> None:
        assert os.getpid() != parent
        time.sleep(0.2)
        (tmp_path / str(os.getpid())).touch()

    assert sorted(filter(None, run_tasks(ending, [1, 2, 3, 4], 2))) == [1, 2, 3, 4]
    assert len(list(tmp_path.iterdir())) == 2


def test_without_other_processes_every_record_comes_in_turn() -> None:
    """What a task tells comes before what it returns."""

    def task(number: int, tell: Any) -> int:
        tell(f"within {number}")
        return 10 * number

    assert list(_here(lambda: task, [3, 1])) == ["within 3", 30, "within 1", 10]
