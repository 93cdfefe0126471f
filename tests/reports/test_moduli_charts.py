"""Charts of moduli: fits, a known solution, bands, what each test determines."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.charts import axis_ends
from bubblefit.reports.moduli import moduli_charts, moduli_together, pinned_charts

from ..drawings import data, legend, lines, named
from ..figure_checks import check_charts

STRAINS = np.linspace(0, [0.15, 0.2, 0.6], 20).T
MODULI = np.array([[800.0], [150.0], [20.0]]) * (1 + STRAINS)


@pytest.mark.parametrize("fits, known", [(5, True), (5, False), (1, True), (1, False)])
def test_moduli(fits: int, known: bool) -> None:
    strains = np.linspace(0, [0.08, 0.1, 0.06], 20).T
    truth = 1000 * (1 - 3 * strains)
    curves = np.array([truth * (1 + 1e-3 * i) for i in range(fits)])
    charts = moduli_charts(strains, curves, truth if known else None)
    check_charts(charts)
    assert len(charts.charts) == (6 if known else 3) and charts.columns == 3
    for m, top in enumerate(charts.charts[:3]):
        (best,), others = lines(top, "best"), lines(top, f"next {fits - 1}")
        np.testing.assert_allclose(best, [strains[m], curves[0, m]], rtol=1e-5)
        starts = [other[1, 0] for other in others]
        assert starts == pytest.approx(curves[1:, m, 0].tolist(), rel=1e-5)
        assert len(lines(top, "known")) == known
        assert top.y_label == "tangent modulus, MPa"
        assert top.x_label == ("logarithmic strain ε1", "logarithmic strain ε2",
                               "shear strain γ12")[m]  # fmt: skip
    for below in charts.charts[3:]:
        off = [line[1] for line in data(below)]
        # Percent; the best is the known one itself, and is not drawn below what is seen.
        assert off[0] == pytest.approx(np.full(20, off[0][0])) and off[0][0] <= 1e-7
        assert [y[0] for y in off[1:]] == pytest.approx([0.1 * i for i in range(1, fits)])
        assert below.alt == "best: at most 1e-10 %" and below.log_y
        assert below.y_label == "deviation from known, %"


@pytest.mark.parametrize("known", [1200.0, 900.0])
def test_fit_and_known_modulus_are_seen(known: float) -> None:
    strains, fit = np.tile([0.0, 0.1], (3, 1)), np.full((1, 3, 2), 1000.0)
    for chart in moduli_charts(strains, fit, np.full((3, 2), known)).charts[:3]:
        assert axis_ends(chart)[1] == pytest.approx((0.0, 1.12 * max(1000.0, known)))


def test_named_laws_with_their_own_ranges() -> None:
    band = np.array([MODULI - 5.0, MODULI + 5.0])
    band[1, 2, 15:] = np.inf
    charts = moduli_charts(
        np.array([STRAINS, 0.4 * STRAINS]), np.array([MODULI, 2 * MODULI]),
        names=["uniaxial", "bubble"], band=band,
    )  # fmt: skip
    shear = charts.charts[2]
    np.testing.assert_allclose(lines(shear, "uniaxial")[0], [STRAINS[2], MODULI[2]], rtol=1e-5)
    other = [0.4 * STRAINS[2], 2 * MODULI[2]]
    np.testing.assert_allclose(lines(shear, "bubble")[0], other, rtol=1e-5)
    first = named(shear)["uniaxial"]
    assert first.ends and first.upper[15:] == [None] * 5
    np.testing.assert_allclose(first.lower, MODULI[2] - 5.0, rtol=1e-5)
    assert legend(charts) == ["uniaxial", "bubble"]


def test_best_and_next() -> None:
    fits = np.array([MODULI, 1.1 * MODULI, 1.2 * MODULI])
    charts = moduli_charts(STRAINS, fits, MODULI / 1.01)
    assert legend(charts) == ["best", "next 2", "known"]
    top, low = charts.charts[0], charts.charts[3]
    assert [s.faint for s in top.series] == [False, True, True, False]
    assert lines(low, "best")[0][1] == pytest.approx(1.0)
    assert low.alt == "best: at most 1 %"


def test_moduli_that_do_not_match() -> None:
    with pytest.raises(ValueError, match="1 names for 2 fits"):
        moduli_charts(STRAINS, np.array([MODULI] * 2), names=["a"])
    with pytest.raises(ValueError, match="same strains"):
        moduli_charts(STRAINS[None], MODULI[None], MODULI)


def test_the_three_moduli_together() -> None:
    charts = moduli_together(STRAINS, MODULI, 0.1 * MODULI, "Table 3.2")
    linear = moduli_together(STRAINS, MODULI - 30.0).charts[0]
    check_charts(charts)
    (log,) = charts.charts
    assert log.log_y and not linear.log_y and log.title == "Table 3.2"
    low, high = axis_ends(linear)[1]
    assert low < MODULI.min() - 30.0 and high == pytest.approx(1.08 * (MODULI.max() - 30.0))
    assert (log.x_label, log.y_label) == ("logarithmic strain", "tangent modulus, MPa")
    for m, s in enumerate(log.series):
        np.testing.assert_allclose([s.x, s.y], [STRAINS[m], MODULI[m]], rtol=1e-5)
        np.testing.assert_allclose([s.lower, s.upper], [0.9 * MODULI[m], 1.1 * MODULI[m]], 1e-5)
        assert s.ends


def test_what_each_test_determines() -> None:
    """Above 1000 %, or not finite, a triangle; what is known is a line."""
    lost = np.full((3, 20), 30.0)
    lost[2] = np.inf
    charts = pinned_charts(STRAINS, {"bubble": lost, "both": np.full((3, 20), 1.0)}, "c")
    check_charts(charts)
    warp, _, shear = charts.charts
    assert lines(warp, "bubble")[0][1] == pytest.approx(30.0)
    assert [s.name for s in warp.series] == ["bubble", "both"] and warp.level is None
    assert named(shear)["bubble"].y == [None] * 20 and shear.level == 1000.0
    mark = named(shear)["bubble, not determined"]
    assert mark.shape == "triangle-up" and min(mark.y) > 1000.0
    assert lines(shear, "both")[0][1] == pytest.approx(1.0)
    assert shear.log_y and shear.y_label == "1 σ, % of the modulus"
    assert "above 1000 % a modulus is not determined" in charts.caption


@pytest.mark.parametrize("value", [0.0, 0.4, 1000.0, np.inf])
def test_pinned_at_the_ends(value: float) -> None:
    charts = pinned_charts(STRAINS, {"both": np.full((3, 20), value)}, "c")
    check_charts(charts)
    own = named(charts.charts[0])
    assert ("both, not determined" in own) == (value > 1000.0)
    assert value > 1000.0 or own["both"].y == pytest.approx([max(value, 1e-3)] * 20)
