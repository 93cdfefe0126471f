"""One start of a fit, with a problem made up: what is counted, recorded and said of its end."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.runs import starts as room
from bubblefit.runs.starts import EvaluationRecord, StartRecord, run_start
from hypothesis import given
from hypothesis import strategies as st


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
