"""Charts of studies: every value of a result in its place, thresholds, bands, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.charts import axis_ends
from bubblefit.reports.moduli import bootstrap_charts
from bubblefit.reports.studies import (
    ConvergencePanel,
    LawRow,
    ProfilePanel,
    convergence_charts,
    law_charts,
    nu12_charts,
    optima_chart,
    plan_charts,
    profile_charts,
    weights_charts,
)
from bubblefit.reports.vega import view

from ..drawings import data, named
from ..figure_checks import check_charts

#: Best, median and worst of 50 starts (docs/references.md, its Fig. 4.8).
PUBLISHED = {"best": 0.096, "median": 0.226, "worst": 3.2}


@pytest.mark.parametrize("values", [[0.0, 1e-9, 3.2], [np.nan, 1.3, np.inf, 1.4], [np.nan], [0.1]])
def test_optima(values: list[float]) -> None:
    """Every start that ended, worst first; a line at every published value."""
    ended = sorted((v for v in values if np.isfinite(v)), reverse=True)
    for references in (PUBLISHED, {}):
        charts = optima_chart(values, "Words", "RMS, mm", references)
        check_charts(charts)
        (chart,) = charts.charts
        optima, *published = data(chart)
        np.testing.assert_array_equal(optima[0], np.arange(1, len(ended) + 1))
        np.testing.assert_allclose(optima[1], np.maximum(ended, 1e-16))
        assert [line[1].tolist() for line in published] == [[v] * 2 for v in references.values()]
        names = [f"published {name} {value:g}" for name, value in references.items()]
        assert [s.name for s in chart.series[1:]] == names
        levels = [*optima[1], *references.values()]
        assert chart.log_y == (bool(levels) and max(levels) > 10 * min(levels))
        failed = len(values) - len(ended)
        said = f"{len(values)} start" + ("s" if len(values) > 1 else "")
        said += f", {failed} without a result" if failed else ""
        if ended:
            best, median, worst = ended[-1], np.median(ended), ended[0]
            said += f": best {max(best, 1e-16):.3g}, median {max(median, 1e-16):.3g}"
            said += f", worst {worst:.3g}"
        assert chart.alt == said and said in charts.caption
        assert (chart.x_label, chart.y_label) == ("start, from worst to best", "RMS, mm")


def test_laws() -> None:
    rows = [
        LawRow("constant", 3, 210.0, 260.0, [200.0, 300.0]),
        LawRow("cubic", 12, 48.0, 60.0, [50.0, np.nan]),
        LawRow("trilinear", 9, float("nan")),
    ]
    charts = law_charts(rows, 45.0, "RMS error, N", "c")
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
    assert law_charts([LawRow("a", 3, 1.0, 20.0)], None, "N", "").charts[0].log_y
    with pytest.raises(ValueError, match="no laws"):
        law_charts([], None, "N", "")


def test_profiles() -> None:
    """One end is not closed: then there is no line at it."""
    panel = ProfilePanel(
        "E1 at 1 %", [90.0, 100.0, 120.0], [5.0, 0.0, 2.0], 100.0, 5.0, (92.5, None), (90.0, 110.0)
    )
    found = profile_charts([panel], 3.84, "c")
    (chart,) = found.charts
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


def test_bootstrap() -> None:
    strains = {name: np.array([0.0, 0.1]) for name in ("E1", "E2", "G12")}
    best = {name: np.array([10.0, 20.0]) * k for k, name in enumerate(strains, 1)}
    samples = {name: np.array([0.9 * v, 1.3 * v]) for name, v in best.items()}
    fit = {name: np.array([0.95 * v, 1.05 * v]) for name, v in best.items()}
    charts = bootstrap_charts(strains, best, samples, fit, "c").charts
    for k, chart in enumerate(charts, 1):
        own, low, high = chart.series
        assert own.y == pytest.approx([10 * k, 20 * k])
        assert own.lower == pytest.approx([9.5 * k, 19 * k])
        assert own.upper == pytest.approx([10.5 * k, 21 * k])
        assert low.y == pytest.approx([9 * k, 18 * k]) and low.name == high.name
        assert high.y == pytest.approx([13 * k, 26 * k])
        assert axis_ends(chart)[1][1] > 26 * k
        # Two curves, once in the legend.
        (names,) = [s["domain"] for s in view(chart)["scales"] if s["name"] == "legend-stroke"]
        assert len(names) == 2


def test_convergence() -> None:
    """The solver's tolerance is not drawn; guides are of first and second order."""
    panel = ConvergencePanel(
        "warp", [4.0, 2.0, 1.0], {"apex at 1 kPa": [1.0, 0.25], "load": [0.5, 1e-7]},
        [8, 32, 128], [0.1, 0.3, 1.1],
    )  # fmt: skip
    found = convergence_charts([panel], "elements", "Title")
    chart, cost = found.charts
    own = named(chart)
    assert own["apex at 1 kPa"].x == [4.0, 2.0] and own["apex at 1 kPa"].y == [1.0, 0.25]
    assert own["load"].y == [0.5, None]
    assert own["apex at 1 kPa"].rank is not None and own["load"].rank is None
    assert own["order 1"].y == pytest.approx([1.6, 0.8])
    assert own["order 2"].y == pytest.approx([1.6, 0.4])
    assert chart.log_x and chart.log_y and chart.x_label == "mean edge, mm"
    assert (cost.series[0].x, cost.series[0].y) == ([8, 32, 128], [0.1, 0.3, 1.1])
    assert "below 1e-05 %" in found.caption


def test_no_change_at_all() -> None:
    panel = ConvergencePanel("warp", [0.2, 0.1], {"load": [0.0]}, [8, 32], [0.1, 0.3])
    chart = convergence_charts([panel], "increments", "Title").charts[0]
    assert [series.y for series in chart.series] == [[None]] and chart.alt.endswith(": none")
    assert view(chart)["marks"]


def test_nu12() -> None:
    lines = {f"at {k}": ([0.1, 0.24], [1.0 + 0.1 * k, 1.0]) for k in range(8)}
    chart, few = nu12_charts({"a": lines, "b": {"one": ([0.1, 0.2], [np.nan, 1.0])}}, 0.24,
                             "apex", "c").charts  # fmt: skip
    assert [series.rank for series in chart.series[:-1]] == pytest.approx(np.linspace(0, 1, 8))
    assert chart.series[3].y == pytest.approx([1.3, 1.0]) and chart.level == 1.0
    assert chart.y_label == "apex / that at nu12 = 0.24" and "1 to 1.7" in chart.alt
    assert (chart.series[-1].x, chart.series[-1].y) == ([0.24], [1.0])
    assert few.series[0].y == [None, 1.0] and few.series[0].rank is None


def test_weights() -> None:
    """Errors in percent; a bar of one standard deviation where the weight is as written."""
    moduli = {"E1": {0.0: [90.0, 100.0, 110.0], 0.05: [50.0, 60.0, 70.0]}, "G12": {0.0: [1, 2, 3]}}
    sigma = {"E1": [0.1, 0.05], "G12": None}
    errors, others = weights_charts(
        "strip", [0.5, 1.0, 2.0], {"one": [0.01, 0.02, 0.03]}, moduli, sigma
    )
    assert errors.charts[0].series[0].y == pytest.approx([1.0, 2.0, 3.0])
    first, shear = others.charts
    assert [s.y for s in first.series] == [[90, 100, 110], [100], [50, 60, 70], [60]]
    bars = [(s.lower, s.upper) for s in first.series[1::2]]
    assert bars == [([90], [110]), ([57], [63])]
    assert first.series[1].x == [1.0] and [s.y for s in shear.series] == [[1, 2, 3]]
    assert first.log_x and first.x_label == "weight of strip, times that of the project"


def test_names_stand_where_numbers_would() -> None:
    """Aslant where there is no room."""
    names = ["one", "two & a name that is far too long for its place in the row", *"abcd"]
    known = plan_charts(names, {"E1": [1.0, 20.0, 100.0, 3, 4, 5], "G12": [2.0] * 6}, "c")
    (chart,) = known.charts
    assert axis_ends(chart)[0] == (0.5, 6.5) and chart.log_y
    (words,) = [a for a in view(chart)["axes"] if a["orient"] == "bottom"]
    assert words["values"] == [1, 2, 3, 4, 5, 6] and words["labelAngle"] == -28
    assert chart.series[0].y == [1, 20, None, 3, 4, 5]
    assert np.round(chart.series[1].x).tolist() == [1, 2, 3, 4, 5, 6]
    # What is not known is a ring at the end of the axis.
    ring = named(chart)["E1, not known"]
    assert ring.hollow and ring.y == [100.0] and np.round(ring.x).tolist() == [3]
