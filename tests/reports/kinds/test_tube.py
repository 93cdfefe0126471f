"""Presenter of tubes: residuals, RMS errors in words and numbers, figures of strains."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.data_files import Output
from bubblefit.experiments.tube import PART, TubeObjective
from bubblefit.meshes.strip_models import TubeModel
from bubblefit.project.project import read_project
from bubblefit.reports.kinds import tube
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.tubes import RADIUS, THICKNESS, TUBE_LAW, TUBE_LOADS, known_tube
from ...support.charts import data


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    (test,) = read_project(known_tube(tmp_path_factory.mktemp("tube"))).tests.values()
    model = TubeModel(TUBE_LOADS, RADIUS, THICKNESS)
    soft = replace(TUBE_LAW, nu12=0.3)
    histories = [MembraneSolver().run(model, law) for law in (TUBE_LAW, soft)]
    return SimpleNamespace(test=test, right=histories[0], wrong=histories[1])


def fitted(history):
    return SimpleNamespace(histories=(history,))


def test_residuals_of_the_known_law_vanish(known):
    table = tube.residuals(SimpleNamespace(test=known.test), fitted(known.right))
    assert set(table["quantity"]) == set(tube.NAMES)
    assert len(table) == 3 * len(TUBE_LOADS) and set(table["unit"]) == {"%"}
    assert table["row"].tolist() == 3 * list(range(1, 1 + len(TUBE_LOADS)))
    assert table["difference"].abs().max() < 1e-6


def test_findings_are_rms_errors_in_percent(known):
    found = tube.findings(SimpleNamespace(test=known.test), fitted(known.wrong))
    objective = TubeObjective(known.test, 1.0)
    difference = objective.modelled(known.wrong) - objective.measured_strain
    expected = 100 * np.sqrt(np.mean(difference**2, axis=0))
    errors = found.numbers["rms_percent"]
    assert list(errors) == list(tube.NAMES)
    assert list(errors.values()) == pytest.approx(expected.tolist())
    assert f"{tube.NAMES[0]} {errors[tube.NAMES[0]]:.3g}" in found.summary


def test_page_has_misfit_table_and_a_chart_of_each_strain(known, tmp_path):
    prepared, fit = SimpleNamespace(test=known.test), fitted(known.wrong)
    found = tube.findings(prepared, fit)
    page = tube.show(prepared, fit, found, Output(tmp_path))
    (table,) = page.tables
    assert dict(table.rows) == found.numbers["rms_percent"]
    assert {name for name, _ in page.files} == {"strains.csv", tube.FIGURE}
    assert all((tmp_path / name).is_file() for name, _ in page.files)
    (charts,) = page.parts
    objective = TubeObjective(known.test, 1.0)
    for k, chart in enumerate(charts.charts):
        measured, modelled = data(chart)
        assert measured[1] == pytest.approx(100 * objective.measured_strain[:, k], abs=1e-4)
        assert modelled[1] == pytest.approx(100 * objective.modelled(known.wrong)[:, k], abs=1e-4)


def test_simulation_gives_errors_of_every_card(known, tmp_path):
    outcomes = {"right": known.right, "wrong": known.wrong}
    runs = {(name, PART): SimpleNamespace(outcome=run) for name, run in outcomes.items()}
    found = tube.simulate(known.test, dict.fromkeys(outcomes), runs, Output(tmp_path))
    right, wrong = (found.numbers["cards"][name]["rms_percent"] for name in outcomes)
    assert max(right.values()) < 1e-6 < 1e-3 < max(wrong.values())
    assert [line.split(":")[0] for line in found.lines] == ["right", "wrong"]
    assert (tmp_path / tube.FIGURE).is_file()
