"""Charts of moduli and of studies: every value in its place, thresholds, bands, gaps."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.reports import fit_page, study_pages
from bubblefit.reports.charts import axis_ends, moduli_charts, pinned_charts
from bubblefit.runs.refinement import ratios

from ..support.charts import check_charts, data, legend, lines, named


@pytest.mark.parametrize(
    ("values", "said"),
    [([0.0, 1e-9, 3.2], "3 starts: best 1e-16, median 1e-09, worst 3.2"),
     ([np.nan, 1.0, np.inf, 2.0], "4 starts, 2 without a result: best 1, median 1.5, worst 2"),
     ([np.nan], "1 start, 1 without a result"), ([3], "1 start: best 3, median 3, worst 3")],
)  # fmt: skip
def test_optima(values, said):
    ended = sorted((v for v in values if np.isfinite(v)), reverse=True)
    charts = fit_page.optima_chart(values, "Words")
    check_charts(charts)
    (chart,) = charts.charts
    (optima,) = data(chart)
    np.testing.assert_array_equal(optima[0], np.arange(1, len(ended) + 1))
    np.testing.assert_allclose(optima[1], np.maximum(ended, 1e-16))
    assert chart.log_y == (len(ended) > 0 and max(optima[1]) > 10 * min(optima[1]))
    assert chart.alt == said and said in charts.caption
    assert (chart.x_label, chart.y_label) == ("start, from worst to best", "objective")


def law(name, coefficients, fitted, validated=np.nan, folds=()):
    return SimpleNamespace(
        name=name, coefficients=coefficients, fitted=fitted, validated=validated,
        left_out=lambda: folds,
    )  # fmt: skip


def test_laws():
    rows = [
        law("constant", 3, 210.0, 260.0, [200.0, 300.0]),
        law("cubic", 12, 48.0, 60.0, [50.0, np.nan]),
        law("trilinear", 9, float("nan")),
    ]
    charts = study_pages.law_charts(rows, 45.0, "RMS error, N", "c")
    check_charts(charts)
    (chart,) = charts.charts
    assert list(chart.x_names) == [
        "constant (3)", "cubic (12), 1 fold without a result", "trilinear (9), no fit",
    ]  # fmt: skip
    own = named(chart)
    assert own["error of the fit"].y == [210.0, 48.0, None]
    assert own["cross-validated error"].y == [260.0, 60.0, None]
    assert [s.y for s in chart.series if s.name == "single folds"] == [[200, 300], [50, None]]
    assert chart.level == 45.0 and not chart.log_y and chart.from_zero
    assert study_pages.law_charts([law("a", 3, 1.0, 20.0)], None, "N", "").charts[0].log_y


def test_profiles():
    panel = SimpleNamespace(
        name="E1 at 1 %", curve=([90.0, 100.0, 120.0], [5.0, 0.0, 2.0]), best=100.0,
        sigma=5.0, ends=(92.5, None),
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


def test_nu12():
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
    )  # fmt: skip
    errors, others = study_pages.weights_charts(study)
    assert errors.charts[0].series[0].y == pytest.approx([1.0, 2.0, 3.0])
    first, _, shear = others.charts
    assert [s.y for s in first.series] == [[90, 100, 110], [100], [50, 60, 70], [60], [9, 9, 9]]
    assert [(s.lower, s.upper) for s in first.series[1:4:2]] == [([90], [110]), ([57], [63])]
    assert first.series[1].x == [1.0] and [s.y for s in shear.series] == 3 * [[0.01, 0.02, 0.03]]
    assert first.log_x and first.x_label == "weight of strip, times that of the project"


STRAINS = np.linspace(0, [0.15, 0.2, 0.6], 20).T


@pytest.mark.parametrize("fits, known", [(5, True), (5, False), (1, True), (1, False)])
def test_moduli(fits, known):
    strains = np.linspace(0, [0.08, 0.1, 0.06], 20).T
    truth = 1000 * (1 - 3 * strains)
    curves = np.array([truth * (1 + 1e-3 * i) for i in range(fits)])
    charts = moduli_charts(strains, curves, truth if known else None)
    check_charts(charts)
    names = ["best", *([f"next {fits - 1}"] * (fits > 1)), *(["known"] * known)]
    assert legend(charts) == names
    assert len(charts.charts) == (6 if known else 3) and charts.columns == 3
    labels = ("logarithmic strain ε1, %", "logarithmic strain ε2, %", "shear strain γ12, %")
    for m, (top, label) in enumerate(zip(charts.charts[:3], labels, strict=True)):
        (best,), others = lines(top, "best"), lines(top, f"next {fits - 1}")
        np.testing.assert_allclose(best, [100 * strains[m], curves[0, m]], rtol=1e-5)
        starts = [other[1, 0] for other in others]
        assert starts == pytest.approx(curves[1:, m, 0].tolist(), rel=1e-5)
        assert (top.x_label, top.y_label) == (label, "tangent modulus, MPa")
        assert [s.faint for s in top.series] == [False, *[True] * (fits - 1), *[False] * known]
    for below in charts.charts[3:]:
        off = [line[1] for line in data(below)]
        assert off[0] == pytest.approx(np.full(20, off[0][0])) and off[0][0] <= 1e-7
        assert [y[0] for y in off[1:]] == pytest.approx([0.1 * i for i in range(1, fits)])
        assert below.alt == "best: at most 1e-10 %" and below.log_y
        assert below.y_label == "deviation from known, %"


def test_what_each_test_determines():
    lost = np.full((3, 20), 30.0)
    lost[2] = np.inf
    charts = pinned_charts(STRAINS, {"bubble": lost, "both": np.full((3, 20), 1.0)}, "c")
    check_charts(charts)
    warp, _, shear = charts.charts
    assert lines(warp, "bubble")[0][1] == pytest.approx(30.0)
    assert [s.name for s in warp.series] == ["bubble", "both"] and warp.level is None
    assert named(shear)["bubble"].y == [None] * 20 and shear.level == 100.0
    mark = named(shear)["bubble, not determined"]
    assert mark.shape == "triangle-up" and min(mark.y) > 100.0
    assert lines(shear, "both")[0][1] == pytest.approx(1.0)
    assert shear.log_y and shear.y_label == "1 σ, % of the modulus"
    assert "from 100 % on a modulus is not determined" in charts.caption
    for value in (0.0, 0.4, 100.0, np.inf):
        charts = pinned_charts(STRAINS, {"both": np.full((3, 20), value)}, "c")
        check_charts(charts)
        own = named(charts.charts[0])
        assert ("both, not determined" in own) == (value >= 100.0)
        assert value >= 100.0 or own["both"].y == pytest.approx([max(value, 1e-3)] * 20)
