"""One start, with a problem made up: what is counted, told, and said of its end."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import NoFeasibleStart
from bubblefit.runs import starts as room
from bubblefit.runs.starts import EvaluationRecord, StartRecord, run_start


class Problem:
    """Two coefficients and an offset; the solver that counts is another program."""

    def __init__(self, name: str, external: bool, surrogate: Any = None) -> None:
        self.solver = SimpleNamespace(name=name, external=external)
        self.surrogate, self.watch, self.failure = surrogate, None, ""
        self.unknowns = SimpleNamespace(size=2, to_coefficients=np.diag([10.0, 100.0]))
        self.resets, self.cached = 0, 0

    def reset(self) -> None:
        self.resets += 1


Y = np.array([0.5, 0.25, -3.0])
OPTIMUM = SimpleNamespace(
    value=0.75, status="converged", failure="", coefficients=np.array([5.0, 25.0]),
    best=SimpleNamespace(unknowns=Y, histories=("a short one", "a long one")),
)  # fmt: skip


def started(
    monkeypatch: pytest.MonkeyPatch, problem: Problem, optimum: Any
) -> tuple[StartRecord, list[EvaluationRecord]]:
    """Two analyses by the surrogate, and one of each of the program's, one of which failed."""

    def fit_from(problem: Any, begun: Any, options: Any, near: bool) -> Any:
        assert (begun, options, near) == ("at start 4 of 7", "options", False)
        problem.surrogate.watch(Y, 0.9, "ok", "membrane")
        problem.surrogate.watch(Y, 0.8, "ok", "membrane")
        problem.watch(Y, None, "no licence", "calculix")
        problem.watch(Y, 0.75, "ok", "calculix")
        problem.watch(Y, 0.75, "ok", "calculix")
        return optimum

    strains = {"a short one": [0.1, 0.3, 0.0], "a long one": [0.2, 0.1, 0.0]}
    monkeypatch.setattr(room, "strains_of", strains.__getitem__)
    monkeypatch.setattr(room, "feasible_start", lambda p, s, n: f"at start {n} of {s}")
    monkeypatch.setattr(room, "fit_from", fit_from)
    told: list[EvaluationRecord] = []
    options: Any = "options"
    return run_start(problem, options, 7, 4, told.append), told  # type: ignore[arg-type]


@pytest.fixture
def problem() -> Problem:
    return Problem("calculix", True, Problem("membrane", False))


def test_what_is_told_and_counted(monkeypatch: pytest.MonkeyPatch, problem: Problem) -> None:
    begun = time.perf_counter()
    record, told = started(monkeypatch, problem, OPTIMUM)
    assert 0 <= record.wall_s <= time.perf_counter() - begun
    assert told == [
        EvaluationRecord(4, number, value, status, (5.0, 25.0), (-3.0,), solver)
        for number, (value, status, solver) in enumerate(
            [(0.9, "ok", "membrane"), (0.8, "ok", "membrane"), (None, "no licence", "calculix"),
             (0.75, "ok", "calculix"), (0.75, "ok", "calculix")], 1,
        )
    ]  # fmt: skip
    assert record == StartRecord(
        4, (7, 4), 0.75, "converged", 5, (0.5, 0.25, -3.0), (5.0, 25.0), record.wall_s, 3, "",
        (0.2, 0.3, 0.0),
    )  # fmt: skip
    assert problem.resets == 1
    assert problem.watch is None and problem.surrogate.watch is None


def test_runs_from_the_cache_are_counted_apart(monkeypatch, problem: Problem) -> None:
    problem.cached = 2
    record, _ = started(monkeypatch, problem, OPTIMUM)
    assert (record.external_runs, record.cached_runs, record.analyses) == (1, 2, 5)
    assert StartRecord.from_json(record.to_json()) == record


def test_runs_of_a_solver_of_our_own_are_no_external_ones(monkeypatch) -> None:
    own = Problem("calculix", False, Problem("membrane", False))
    assert started(monkeypatch, own, OPTIMUM)[0].external_runs == 0


@pytest.mark.parametrize(
    ("own", "leads", "why"),
    [
        ("no licence", "tired", "no licence"),
        ("", "tired", "tired"),
        ("", "", "the first analysis failed"),
    ],
)
def test_no_optimum(monkeypatch, problem: Problem, own: str, leads: str, why: str) -> None:
    problem.failure, problem.surrogate.failure = own, leads
    record, told = started(monkeypatch, problem, None)
    assert record == StartRecord(
        4, (7, 4), None, f"calculix failed: {why}", 5, (), (), record.wall_s, 3, why
    )
    assert len(told) == 5


def test_a_failure_that_ended_it_is_kept(monkeypatch, problem: Problem) -> None:
    cut = SimpleNamespace(**{**vars(OPTIMUM), "failure": "killed", "status": "killed"})
    record, _ = started(monkeypatch, problem, cut)
    assert (record.objective, record.status, record.failure) == (0.75, "killed", "killed")


def test_no_feasible_start_is_no_failure(monkeypatch, problem: Problem) -> None:
    def none(*_: Any) -> None:
        raise NoFeasibleStart("none in 1000 draws")

    monkeypatch.setattr(room, "feasible_start", none)
    options: Any = None
    record = run_start(problem, options, 7, 4, lambda told: None)  # type: ignore[arg-type]
    assert record == StartRecord(
        4, (7, 4), None, "none in 1000 draws", 0, (), (), record.wall_s, 0, ""
    )
    assert problem.watch is None


def test_from_the_optimum_of_the_coarse_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Analyses, time and runs of other programs are counted on; nothing is drawn."""
    coarse = StartRecord(
        4, (7, 4), 0.5, "converged", 6, (1.0, 2.0, 3.0), (), 100.0, 0, mesh="coarse"
    )

    def fit_from(problem: Any, begun: Any, options: Any, near: bool) -> Any:
        assert begun.tolist() == [1.0, 2.0, 3.0] and near
        problem.watch(Y, 0.75, "ok", "membrane")
        return OPTIMUM

    monkeypatch.setattr(room, "strains_of", lambda history: [0.0] * 3)
    monkeypatch.setattr(room, "fit_from", fit_from)
    told: list[EvaluationRecord] = []
    problem: Any = Problem("membrane", False)
    record = run_start(problem, None, 7, 4, told.append, coarse=coarse)  # type: ignore[arg-type]
    assert [(e.analysis, e.mesh) for e in told] == [(7, "full")]
    assert (record.analyses, record.coarse_analyses, record.coarse_objective) == (7, 6, 0.5)
    assert record.objective == 0.75 and record.mesh == "full" and record.wall_s > 100.0
    assert StartRecord.from_json(record.to_json()) == record


def test_a_record_of_an_older_version() -> None:
    """It knows neither of external runs nor of failures, nor of meshes and what was reached."""
    record = StartRecord(1, (7, 1), 0.5, "ok", 3, (1.0,), (2.0,), 0.25)
    said = record.to_json()
    assert (said.pop("external_runs"), said.pop("failure")) == (0, "")
    later = ("reached", "mesh", "coarse_objective", "coarse_analyses", "same_as", "cached_runs")
    assert [said.pop(name) for name in later] == [(), "full", None, 0, None, 0]
    assert StartRecord.from_json(said) == record
    for key in said:
        with pytest.raises(KeyError):
            StartRecord.from_json({k: v for k, v in said.items() if k != key})
