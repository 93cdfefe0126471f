"""runs/starts.py: starts, and the best of all, which is run again."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.runs import starts
from bubblefit.runs import starts as room
from bubblefit.runs.starts import EvaluationRecord, StartRecord, best_fit, noise_of, run_start
from hypothesis import given
from hypothesis import strategies as st

from ..support.refusals import raised


@given(
    st.one_of(st.none(), st.floats(0, 1e9)),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=12),
    st.text(max_size=20),
)
def test_start_record_survives_json(value, unknowns, status):
    record = StartRecord(3, (1, 3), value, status, 9, tuple(unknowns), tuple(unknowns), 0.1)
    assert StartRecord.read(record.text) == record


class Problem:
    """Two coefficients and an offset; the solver that counts is another program."""

    def __init__(self, name, external, surrogate=None):
        self.solver = SimpleNamespace(name=name, external=external)
        self.surrogate, self.watch, self.failure = surrogate, None, ""
        self.unknowns = SimpleNamespace(size=2, to_coefficients=np.diag([10.0, 100.0]))
        self.resets, self.cached, self.program_runs = 0, 0, np.zeros(2, dtype=int)

    def reset(self):
        self.resets += 1


Y = np.array([0.5, 0.25, -3.0])


OPTIMUM = SimpleNamespace(
    value=0.75, status="converged", failure="", coefficients=np.array([5.0, 25.0]),
    best=SimpleNamespace(unknowns=Y, histories=("a short one", "a long one")),
)  # fmt: skip


def started(monkeypatch, problem, optimum):
    def fit_from(problem, begun, options):
        assert (begun, options) == ("at start 4 of 7", "options")
        for value in (0.9, 0.8):
            problem.surrogate.watch(Y, value, "ok", "membrane")
        for value, status in ((None, "no licence"), (0.75, "ok"), (0.75, "ok")):
            problem.watch(Y, value, status, "calculix")
        return optimum

    strains = {"a short one": [0.1, 0.3, 0.0], "a long one": [0.2, 0.1, 0.0]}
    monkeypatch.setattr(room, "strains_of", strains.__getitem__)
    monkeypatch.setattr(room, "feasible_start", lambda p, s, n: f"at start {n} of {s}")
    monkeypatch.setattr(room, "fit_from", fit_from)
    told = []
    options = "options"
    return run_start(problem, options, 7, 4, told.append), told


@pytest.fixture
def problem():
    return Problem("calculix", True, Problem("membrane", False))


def test_every_analysis_of_a_start_is_recorded_and_counted(monkeypatch, problem):
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


def test_cached_and_external_runs_are_counted_apart(monkeypatch, problem):
    problem.cached = 2
    record, _ = started(monkeypatch, problem, OPTIMUM)
    assert (record.external_runs, record.cached_runs, record.analyses) == (1, 2, 5)
    assert StartRecord.read(record.text) == record
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
def test_start_without_optimum_has_a_status(monkeypatch, problem, own, leads, why):
    problem.failure, problem.surrogate.failure = own, leads
    record, told = started(monkeypatch, problem, None)
    assert record == StartRecord(
        4, (7, 4), None, f"calculix failed: {why}", 5, (), (), record.wall_s, 3, why
    )
    assert len(told) == 5
    cut = SimpleNamespace(**{**vars(OPTIMUM), "failure": "killed", "status": "killed"})
    record, _ = started(monkeypatch, problem, cut)
    assert (record.objective, record.status, record.failure) == (0.75, "killed", "killed")


def test_best_start_is_run_again(fitted):
    good = fitted.best.ranked[0]
    unknowns = tuple(1.02 * u for u in good.unknowns)
    others = [
        starts.replace(good, objective=good.objective + 0.1, unknowns=unknowns),
        starts.replace(good, objective=None, unknowns=()),
    ]
    for k in range(3):
        records = [*others[:k], good, *others[k:]]
        records = [starts.replace(r, number=number) for number, r in enumerate(records)]
        again = starts.best_fit(fitted.problem, records, fitted.project.fit.tolerance)
        assert again.ranked[0].number == k
        # All records, in their order, and the best with the objective of the repeated run.
        assert [r.number for r in again.records] == [r.number for r in records]
        assert [r is again.ranked[0] for r in again.records] == [r.number == k for r in records]
        np.testing.assert_array_equal(again.law.beta, fitted.law.beta)
        assert again.ranked[0].objective == pytest.approx(fitted.objective, abs=1e-9)


@pytest.mark.parametrize(("external", "tries"), [(True, 2), (False, 1)])
def test_external_program_gets_second_try(strips_fit, external, tries):
    problem = strips_fit.setup.problem()
    asked = []

    def fail(*_, **__):
        asked.append(True)
        problem.failure = "no licence"

    problem.evaluate = fail
    problem.solver.external = external
    said = "the best fit does not run again: no licence; its starts are kept, --resume goes on"
    raised(SolverFailure, said, best_fit, problem, strips_fit.best.records, 0.0)
    assert len(asked) == tries


@pytest.mark.parametrize(("off", "fails"), [(0.9, False), (1.1, True), (-0.9, False), (-1.1, True)])
def test_repeated_run_must_give_objective_within_tolerance_and_noise(strips_fit, off, fails):
    problem, first = strips_fit.setup.problem(), strips_fit.best.ranked[0]
    noise = noise_of(problem)
    assert first.objective is not None
    limit = 1e-5 * first.objective + 1e-6 * sum(noise.values())
    other = replace(first, objective=first.objective + off * limit)
    if fails:
        with pytest.raises(SolverFailure, match="start 0 ended with an objective of"):
            best_fit(problem, [replace(other, number=0)], 0.0)
    else:
        assert best_fit(problem, [other], 0.0).ranked[0].objective == first.objective


def test_noise_is_residual_of_perfect_law(strips_fit):
    noise = noise_of(strips_fit.setup.problem())
    for prepared, shares in zip(strips_fit.setup.tests, ((0.5, 0.5), (3.0,)), strict=True):
        for direction, share in zip(prepared.test.matched, shares, strict=True):
            strip = prepared.test.strips[direction]
            expected = share * strip.scatter / strip.points[1].max()
            assert noise[prepared.part(direction)] == pytest.approx(expected)
