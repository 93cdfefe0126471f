"""Charts of studies: laws, profiles, nu12; every value in its place, thresholds, gaps."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.forward import Simulation
from bubblefit.materials.forms.base import form_named
from bubblefit.notes import Verdict
from bubblefit.reports import study_pages
from bubblefit.reports.charts import Chart, Charts, axis_ends
from bubblefit.reports.content import Table
from bubblefit.runs.folder import Presented
from bubblefit.runs.profile import Target
from bubblefit.runs.refinement import ratios

from ..support.charts import check_charts, named
from ..support.refusals import complaint


def law(name, coefficients, fitted, validated=np.nan, folds=()):
    return SimpleNamespace(
        name=name, coefficients=coefficients, fitted=fitted, validated=validated,
        left_out=lambda: folds,
    )  # fmt: skip


def test_errors_of_laws_are_drawn_by_form():
    rows = [
        law("constant", 3, 210.0, 260.0, [200.0, 300.0]),
        law("cubic", 12, 48.0, 60.0, [50.0, np.nan]),
        law("trilinear", 9, float("nan")),
    ]
    charts = study_pages.law_charts(rows, 45.0, "RMS error, N", "c")
    check_charts(charts)
    (chart,) = charts.charts
    assert list(chart.y_names) == [
        "constant (3)", "cubic (12), 1 fold without a result", "trilinear (9), no fit",
    ]  # fmt: skip
    own = named(chart)
    assert own["error of the fit"].x == [210.0, 48.0, None]
    assert own["cross-validated error"].x == [260.0, 60.0, None]
    assert own["error of the fit"].y == [1, 2, 3]
    assert [s.x for s in chart.series if s.name == "single folds"] == [[200, 300], [50, None]]
    assert own["noise of the data"].x == [45.0, 45.0] and not chart.log_x
    assert study_pages.law_charts([law("a", 3, 1.0, 20.0)], None, "N", "").charts[0].log_x


def test_profiles_are_drawn_with_threshold():
    panel = SimpleNamespace(
        name="E1 at 1 %", curve=([90.0, 100.0, 120.0], [5.0, 0.0, 2.0]), best=100.0,
        sigma=5.0, ends=(92.5, None), target=Target("E1", 0.01),
    )  # fmt: skip
    chart = study_pages.profile_chart(panel, 3.84)
    own = named(chart)
    assert (own["profile"].x, own["profile"].y) == ([90.0, 100.0, 120.0], [5.0, 0.0, 2.0])
    assert (own["ends"].x, own["ends"].y) == ([92.5, 92.5], [0.0, 3.84])
    assert [series.name for series in chart.series].count("ends") == 1
    assert chart.level == 3.84 and axis_ends(chart)[1][1] == pytest.approx(1.6 * 3.84)
    sigma = own["by the 1 sigma of the fit"]
    for x, y in zip(sigma.x, sigma.y, strict=True):
        value = ((x - 100.0) / 5.0) ** 2
        assert y == pytest.approx(value, abs=1e-4) if value < 6 else y is None or y < 6.2
    assert "92.5 MPa, upper end not closed" in chart.alt


def test_comparison_has_live_charts_of_each_test(tmp_path, monkeypatch):
    """The charts of a simulation with every form are parts of the page; its tables are not."""
    loads = Charts("loads", [Chart("warp", "mm", "N", [])], "Load over elongation")
    simulated = []

    def simulate(test, cards, runs, out):
        simulated.append((test.name, cards, list(runs), out.folder))
        return Simulation({}, parts=[loads, Table("Errors", ["N"], [[1.0]])])

    monkeypatch.setattr(
        study_pages, "presenter_of", lambda kind: SimpleNamespace(simulate=simulate)
    )
    test = SimpleNamespace(name="three", kind="strips", models=lambda: {"warp": "model"})
    prepared = SimpleNamespace(test=test)
    solver = SimpleNamespace(run=lambda model, law: law)
    setup = SimpleNamespace(tests=[prepared], make_solver=lambda: solver)
    fit = SimpleNamespace(setup=setup, law="law", card="card")
    study = SimpleNamespace(forms=[SimpleNamespace(name="cubic", fit=fit)])
    (charts,) = study_pages._responses(study, prepared, tmp_path)
    assert charts.charts == loads.charts and charts.caption == "three: Load over elongation"
    assert simulated == [("three", {"cubic": "card"}, [("cubic", "warp")], tmp_path)]


def test_ratios_are_drawn_over_nu12():
    lines = {f"at {k}": ratios([0.1, 0.24], [1.0 + 0.1 * k, 1.0], 1.0) for k in range(8)}
    few = {"one": ratios([0.1, 0.2], [np.nan, 1.0], 1.0)}
    parts = {"a": SimpleNamespace(responses=lines), "b": SimpleNamespace(responses=few)}
    study = SimpleNamespace(parts=parts, base=0.24, response="apex")
    chart, few = study_pages.nu12_charts(study, "c").charts
    assert [series.rank for series in chart.series[:-1]] == pytest.approx(np.linspace(0, 1, 8))
    assert chart.series[3].y == pytest.approx([1.3, 1.0]) and chart.level == 1.0
    assert "1 to 1.7" in chart.alt
    assert few.series[0].y == [None, 1.0] and few.series[0].rank is None
    runs = [
        SimpleNamespace(
            count=count, relative={"one": error},
            moduli={"E1": [at_rest, later, 9.0], "E2": [8.0] * 3, "G12": [error] * 3},
        )
        for count, error, at_rest, later in (
            (0.5, 0.01, 90.0, 50.0), (1.0, 0.02, 100.0, 60.0), (2.0, 0.03, 110.0, 70.0),
        )
    ]  # fmt: skip
    study = SimpleNamespace(
        counted="strip", ended=runs, strain=lambda name, place: place,
        sigma=lambda name: [0.1, 0.05, 0.0] if name == "E1" else None,
        labels={name: name for name in ("E1", "E2", "G12")},
    )  # fmt: skip
    errors, others = study_pages.weights_charts(study)
    assert errors.charts[0].series[0].y == pytest.approx([1.0, 2.0, 3.0])
    first, _, shear = others.charts
    assert [s.y for s in first.series] == [[90, 100, 110], [100], [50, 60, 70], [60], [9, 9, 9]]
    assert [(s.lower, s.upper) for s in first.series[1:4:2]] == [([90], [110]), ([57], [63])]
    assert first.series[1].x == [1.0] and [s.y for s in shear.series] == 3 * [[0.01, 0.02, 0.03]]
    assert first.log_x and first.x_label == "weight of strip, times that of the project"


def test_errors_of_tests_left_out_are_drawn_beside_those_of_the_fit():
    """A law of which no test was fitted has its predictions alone."""
    table = pd.DataFrame({
        "law": ["a", "a", "card", "card"], "test": ["one", "two"] * 2,
        "foretold_relative": [0.03, 0.04, 0.05, np.nan],
        "fitted_relative": [0.01, 0.02, np.nan, np.nan],
    })  # fmt: skip
    (chart,) = study_pages.held_out_charts(SimpleNamespace(table=lambda: table), "c").charts
    assert {name: series.x for name, series in named(chart).items()} == {
        "a, predicted": pytest.approx([3.0, 4.0]),
        "card, predicted": [pytest.approx(5.0), None],
        "a, fitted": pytest.approx([1.0, 2.0]),
    }
    assert list(chart.y_names) == ["one", "two"]


def test_moduli_that_stay_unknown_are_rings_in_a_plan():
    sigmas = [{"E1": 0.02, "G12": np.inf}, {"E1": 0.01, "G12": 2.0}, {"E1": 0.015, "G12": 0.3}]
    present, *candidates = (SimpleNamespace(summary=s, moduli=s, title="a test") for s in sigmas)
    study = SimpleNamespace(present=present, candidates=candidates)
    (chart,) = study_pages.plan_charts(study, "c").charts
    shown = named(chart)
    assert list(chart.y_names) == ["the present tests alone", "1. a test", "2. a test"]
    assert shown["E1"].x == pytest.approx([2.0, 1.0, 1.5])
    assert shown["G12"].x == [None, None, pytest.approx(30.0)]
    rings = shown["G12, not known"]
    assert (rings.x, rings.y, rings.hollow) == ([100.0, 100.0], [1.0, 2.0], True)
    assert "E1, not known" not in shown


def test_percentiles_of_a_bootstrap_are_drawn_over_strain():
    strain, best = np.array([0.0, 0.02]), np.array([100.0, 110.0])
    names = ("E1", "E2", "G12")
    fit = SimpleNamespace(value=best, lower=best - 9.0, upper=best + 9.0)
    form = form_named("constant", {}, [0.1] * 3)
    study = SimpleNamespace(
        strains=dict.fromkeys(names, strain), of_fit=dict.fromkeys(names, fit),
        bands=dict.fromkeys(names, (best - 5.0, best + 4.0)),
        optimum=SimpleNamespace(best=SimpleNamespace(law=SimpleNamespace(form=form))),
    )  # fmt: skip
    for chart in study_pages.bootstrap_charts(study, "c").charts:
        of_fit, low, high = chart.series
        assert [series.x for series in chart.series] == [[0.0, 2.0]] * 3
        assert (of_fit.y, of_fit.lower, of_fit.upper) == ([100, 110], [91, 101], [109, 119])
        assert (low.y, high.y) == ([95, 105], [104, 114])
        assert chart.alt.endswith("at rest 100 MPa, samples 95 to 104 MPa")


class Thicknesses(Presented):
    """A study that `study_pages.CONTENT` does not list."""

    project = SimpleNamespace(title="Made", fabric=SimpleNamespace(lab="", thickness=0.8))
    notes, numbers = (), {"command": "study thickness"}
    verdict = Verdict("usable", "the load follows the thickness")

    def table(self):
        return pd.DataFrame({"thickness_mm": [0.5, 1.0], "load_N": [8.0, 16.0], "model": "warp"})

    def result_lines(self):
        return []


def test_page_of_study_without_its_own_shows_its_table(tmp_path):
    page = Thicknesses().report(tmp_path / "out").read_text()
    assert "Made: study thickness" in page and "the load follows the thickness" in page
    assert re.search(r"thickness_mm.*load_N.*model.*0\.5.*8.*warp.*1.*16.*warp", page, re.DOTALL)
    written = pd.read_csv(tmp_path / "out" / "thickness.csv")
    pd.testing.assert_frame_equal(written, Thicknesses().table())
    assert (
        json.loads((tmp_path / "out" / "result.json").read_text())["command"] == "study thickness"
    )


def test_plot_of_study_without_charts_is_refused():
    words = "plot: a study of type Thicknesses has no charts; table() has its numbers"
    assert complaint(Thicknesses().plot) == words
