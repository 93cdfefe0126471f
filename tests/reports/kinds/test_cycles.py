"""Presenter of cyclic tests: RMS errors of the load by specimen and cycle, with made-up loads."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.data_files import READING, Output
from bubblefit.notes import Note
from bubblefit.reports.kinds import cycles
from bubblefit.solvers.base import History

from ...support.charts import data

STRAIN = np.array([0.0, 0.01, 0.02, 0.0, 0.02])
CYCLE = np.array([1, 1, 1, 2, 2])
LOAD = np.array([0.0, 100.0, 200.0, 20.0, 200.0])
#: By how much the model is off, N.
OFF = np.array([0.0, 3.0, 0.0, 4.0, 4.0])
RMS = {"cycle 1": np.sqrt(3.0), "cycle 2": 4.0}


def history(off):
    zeros = np.zeros(3)
    return History(LOAD + off, np.zeros((len(LOAD), 1, 3)), zeros, zeros)


@pytest.fixture
def prepared():
    note = Note(READING, "the file has two headings")
    evaluated = SimpleNamespace(notes=[note])
    parts = {
        name: SimpleNamespace(name=name, load=LOAD, cycle=CYCLE, strain=STRAIN, evaluated=evaluated)
        for name in ("a", "b")
    }

    def fitted_parts(fitted):
        return [
            SimpleNamespace(
                data=specimen, history=run, rms=np.sqrt(np.mean((run.load - LOAD) ** 2))
            )
            for specimen, run in zip(parts.values(), fitted.histories, strict=True)
        ]

    test = SimpleNamespace(name="belt", matched=parts)
    return SimpleNamespace(test=test, data_notes=[], fitted_parts=fitted_parts)


@pytest.fixture
def fitted():
    return SimpleNamespace(histories=(history(OFF), history(0 * OFF)))


def test_residuals_are_loads_by_specimen_cycle_and_strain(prepared, fitted):
    table = cycles.residuals(prepared, fitted)
    assert table["part"].tolist() == ["a"] * 5 + ["b"] * 5
    assert table["cycle"].tolist() == 2 * CYCLE.tolist()
    assert table["difference"].tolist() == [*OFF, *(0 * OFF)]
    assert set(table["unit"]) == {"N"}


def test_findings_are_rms_errors_by_specimen_and_cycle(prepared, fitted):
    found = cycles.findings(prepared, fitted)
    errors = found.numbers["rms_N"]
    assert errors["a"] == pytest.approx(RMS)
    assert errors["b"] == {"cycle 1": 0.0, "cycle 2": 0.0}
    assert found.lines[0] == "a: RMS error of load in N: cycle 1 1.73, cycle 2 4"
    share = 100 * np.sqrt(np.mean(OFF**2)) / LOAD.max()
    assert found.summary == f"RMS error of load {share:.2g} % of the largest"
    assert [note.kind for note in found.warnings] == [READING, READING]


def test_page_has_table_of_misfits_and_a_chart_of_each_specimen(prepared, fitted, tmp_path):
    found = cycles.findings(prepared, fitted)
    page = cycles.show(prepared, fitted, found, Output(tmp_path))
    (table,) = page.tables
    assert [row[:2] for row in table.rows] == [
        ["a", "cycle 1"], ["a", "cycle 2"], ["b", "cycle 1"], ["b", "cycle 2"]
    ]  # fmt: skip
    assert {name for name, _ in page.files} == {cycles.TABLE, cycles.FIGURE}
    (charts,) = page.parts
    assert [chart.title for chart in charts.charts] == ["a", "b"]
    measured, modelled = data(charts.charts[0])
    assert measured[0] == pytest.approx(100 * STRAIN)
    assert modelled[1] - measured[1] == pytest.approx(OFF)


def test_simulation_names_cards_that_fail(prepared, tmp_path):
    failure = SolverFailure("no equilibrium", "membrane")
    outcomes = {
        ("good", "a"): history(OFF),
        ("good", "b"): history(0 * OFF),
        ("bad", "a"): failure,
        ("bad", "b"): history(OFF),
    }
    runs = {key: SimpleNamespace(outcome=outcome) for key, outcome in outcomes.items()}
    cards = {"good": None, "bad": None}
    found = cycles.simulate(prepared.test, cards, runs, Output(tmp_path))
    numbers = found.numbers["cards"]
    assert numbers["good"]["rms_N"]["a"] == pytest.approx(RMS)
    assert numbers["bad"]["failed"] == {"a": "no equilibrium"}
    assert set(numbers["bad"]["rms_N"]) == {"b"}
    assert "bad: a: failed: no equilibrium" in found.lines
    assert (tmp_path / cycles.FIGURE).is_file()
