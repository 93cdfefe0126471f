"""Charts as plain data: ends of axes, colours, moduli and what determines them."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.reports import charts as declared
from bubblefit.reports import vega
from bubblefit.reports.charts import Chart, axis_ends, dots, line, moduli_charts, pinned_charts
from bubblefit.reports.vega import panel

from ..support.charts import check_charts, data, legend, lines, named


def test_ends_of_axes_enclose_values():
    def chart(series, **look):
        return axis_ends(Chart("t", "x", "y", series, **look))

    banded = line("a", [0, 4], [0, 5], band=([1, 1], [90, 90]))
    assert chart([banded], top=10.0) == ((0, 4), (0, 10))
    assert all(high > low for low, high in chart([]))
    log = chart([line("", [1, 10], [-1, 100])], log_x=True, log_y=True)
    assert log[0] == (1.0, 10.0) and 0 < log[1][0] < 100 < log[1][1]
    assert chart([dots("", [1, 2], [1, 2])], y_names=("a", "b"))[1] == (2.5, 0.5)
    part = chart([line("", [0, 9], [0, 9])], x_range=(1, 2), y_range=(3, 4))
    assert part == ((1, 2), (3, 4))
    title = "E1, along the warp: best: at most 1.2e-08 % of the modulus that is known"
    lines = panel(Chart(title, "x", "y", [banded]), vega.NARROW)["title"]["text"]
    assert " ".join(lines) == title and len(lines) == 2  # whole, and not cut by dots
    assert max(map(len, lines)) * vega.TITLE_LETTER_WIDTH <= vega.NARROW + 40
    flat = Chart("", "x, mm", "y, mm", [line("", [0, 100], [0, 25])], equal=True)
    width, height = (signal["value"] for signal in panel(flat)["signals"][:2])
    (x0, x1), (y0, y1) = axis_ends(flat)
    assert width / (x1 - x0) == pytest.approx(height / (y1 - y0), rel=1e-3)


@pytest.mark.parametrize(
    ("values", "ends"),
    [([4.0, 4.0], (2.0, 6.0)), ([-8.0], (-12.0, -4.0)), ([0.0], (0.0, 0.5)), ([1, 3], (0.9, 3.1))],
)
def test_axis_of_equal_values_goes_half_of_them_beyond(values, ends):
    chart = Chart("t", "x", "y", [line("a", np.arange(len(values)), values)], y_range=None)
    assert axis_ends(chart)[1] == pytest.approx(ends)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [([1.0, 10.0], False), ([1.0, 10.1], True), ([0.0, 50.0], False), ([-1.0, 50.0], False),
     ([np.nan, 1.0, np.inf, 11.0], True), ([np.nan], False), ([], False), ([[1.0], [11.0]], True)],
)  # fmt: skip
def test_logarithmic_axis_for_more_than_a_decade(values, wanted):
    assert declared.spans_a_decade(values) is wanted


@pytest.mark.parametrize(
    ("strain", "shades", "ends"),
    [([-0.05, 1.0], "from least", (-0.05, 1.0)), ([-0.06, 1.0], "about zero", (-1.0, 1.0)),
     ([-1.0, 0.06], "about zero", (-1.0, 1.0)), ([-1.0, 0.05], "from least", (-1.0, 0.05)),
     ([0.0, 0.0], "from least", (0.0, 1.0)), ([np.nan, 0.2], "from least", (0.2, 1.2))],
)  # fmt: skip
def test_values_have_colours_of_their_scale(strain, shades, ends):
    assert declared.shades_of(strain) == shades
    assert declared.ends_of(np.array(strain), shades) == pytest.approx(ends)


STRAINS = np.linspace(0, [0.15, 0.2, 0.6], 20).T


@pytest.mark.parametrize("fits, known", [(5, True), (5, False), (1, True), (1, False)])
def test_moduli_are_drawn_with_their_bands(fits, known):
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
        assert below.title in [f"{name}, {below.alt}" for name in COMPONENTS]


def test_sigma_of_each_test_is_drawn_over_strain():
    lost = np.full((3, 20), 30.0)
    lost[2] = np.inf
    charts = pinned_charts(STRAINS, {"bubble": lost, "both": np.full((3, 20), 1.0)}, "c")
    check_charts(charts)
    warp, _, shear = charts.charts
    assert lines(warp, "bubble")[0][1] == pytest.approx(30.0)
    assert lines(warp, "bubble")[0][0] == pytest.approx(100 * STRAINS[0], rel=1e-5)
    assert lines(shear, "both")[0][0] == pytest.approx(100 * STRAINS[2], rel=1e-5)
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
