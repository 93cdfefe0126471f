"""Presenters: what a kind must define, defaults of the rest, and presenters of plug-ins."""

from types import SimpleNamespace

import pandas as pd
import pytest
from bubblefit.experiments.base import Findings
from bubblefit.experiments.data_files import Output
from bubblefit.reports import presenter
from bubblefit.reports.presenter import PagePresenter, PlugInPresenter, page_presenter_of

from ..support.charts import data

PREPARED = SimpleNamespace(test=SimpleNamespace(name="torsion"))


def residuals(**columns):
    count = len(next(iter(columns.values())))
    return pd.DataFrame({"part": ["a"] * count, **columns})


@pytest.mark.parametrize(
    ("method", "count"), [("findings", 2), ("residuals", 2), ("simulate", 4), ("show_outcome", 2)]
)
def test_method_that_a_kind_must_define_is_named(method, count):
    with pytest.raises(NotImplementedError, match=f"PagePresenter needs {method}"):
        getattr(PagePresenter(), method)(*[None] * count)


def test_data_are_not_shown_before_a_fit_by_default(tmp_path):
    assert PagePresenter().examine(PREPARED, Output(tmp_path)) is None
    assert PagePresenter().charts == {}


def test_default_page_shows_misfit_and_every_value(tmp_path):
    table = residuals(
        angle=[1.0, 2.0, 4.0],
        quantity=["moment"] * 3,
        unit=["N mm"] * 3,
        measured=[10.0, 20.0, 41.0],
        modelled=[10.5, 20.0, 40.0],
    )
    kind = PagePresenter()
    kind.residuals = lambda prepared, fitted: table
    findings = Findings({}, (), (), "RMS 1 N mm", "RMS 1 N mm")
    shown = kind.show(PREPARED, None, findings, Output(tmp_path, "torsion-"))
    assert shown.facts == [("misfit", "RMS 1 N mm")]
    (charts,) = shown.parts
    assert charts.name == "torsion-values"
    (chart,) = charts.charts
    assert (chart.title, chart.x_label, chart.y_label) == ("torsion", "angle", "N mm")
    measured, modelled = data(chart)
    assert measured.tolist() == [[1.0, 2.0, 4.0], [10.0, 20.0, 41.0]]
    assert modelled.tolist() == [[1.0, 2.0, 4.0], [10.5, 20.0, 40.0]]


def test_values_without_an_abscissa_are_numbered(tmp_path):
    table = residuals(quantity=["load"] * 2, unit=["N"] * 2, measured=[1, 2], modelled=[1, 3])
    (chart,) = presenter.value_charts(PREPARED, table, Output(tmp_path)).charts
    assert chart.x_label == "number"
    assert data(chart)[0][0].tolist() == [1, 2]


def test_presenter_of_a_plug_in_gets_the_defaults_it_lacks(monkeypatch, tmp_path):
    def draw(prepared, fitted):
        return None

    plug_in = SimpleNamespace(findings=lambda prepared, fitted: "found", CHARTS={"torque": draw})
    monkeypatch.setattr(presenter, "presenter_of", {"torsion": plug_in}.__getitem__)
    page = page_presenter_of("torsion")
    assert isinstance(page, PlugInPresenter)
    assert page.findings(None, None) == "found"
    assert page.charts == {"torque": draw}
    assert page.examine(PREPARED, Output(tmp_path)) is None
    with pytest.raises(NotImplementedError, match="PlugInPresenter needs residuals"):
        page.residuals(None, None)


def test_presenter_inside_the_package_is_taken_as_it_is():
    assert not isinstance(page_presenter_of("strips"), PlugInPresenter)
