"""Figures of studies: refinement and its cost, responses over nu12."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.reports.convergence import ConvergencePanel, plot_convergence
from bubblefit.reports.nu12 import plot_nu12
from bubblefit.reports.style import NAMED, pressure_colours
from matplotlib.figure import Figure

from ..drawings import legend


def test_convergence_figure(tmp_path: Path, drawn: list[Figure]) -> None:
    changes = {"apex at 22 kPa, mm": [1.0, 0.25], "in-plane, mm": [0.5, 1e-9]}
    one = ConvergencePanel("bubble", [4.0, 2.0, 1.0], changes, [10, 40, 160], [0.1, 0.3, 1.0])
    still = ConvergencePanel("warp", [2.0, 1.0], {"in-plane, mm": [0.0]}, [10, 40], [0.1, 0.3])
    plot_convergence(tmp_path / "c.png", [one, still], "elements")
    bubble, warp, cost = drawn[0].axes
    assert bubble.get_xscale() == bubble.get_yscale() == "log"
    by_length = [line.get_data() for line in bubble.lines]
    assert by_length[0][0].tolist() == [4.0, 2.0] and by_length[0][1].tolist() == [1.0, 0.25]
    assert by_length[1][1].tolist() == [0.5]  # what the tolerance hides is not drawn
    # Dashes above everything, from the coarsest size on.
    assert [line[1][0] for line in by_length[2:]] == pytest.approx([1.6, 1.6])
    patterns = {str(line._unscaled_dash_pattern) for line in bubble.lines[1:]}
    assert len(patterns) == 3
    # What is one series goes from light to dark, the others are told apart by colour.
    assert [line.get_color() for line in bubble.lines[:2]] == [pressure_colours(1)[0], NAMED[0]]
    assert [line.get_color() for line in cost.lines] == [*NAMED[:2]]
    assert [t.get_text() for t in cost.get_legend().get_texts()] == ["bubble", "warp"]
    (words,) = warp.texts
    box, panel = words.get_window_extent(), warp.get_window_extent()
    assert abs((box.x0 + box.x1) - (panel.x0 + panel.x1)) < 4
    assert panel.y0 + 0.3 * panel.height < box.y0 < panel.y1 - 0.3 * panel.height
    assert not len(warp.get_xticks()) and not len(warp.get_yticks())
    for line, order in zip(by_length[2:], (1, 2), strict=True):
        assert np.log2(line[1][0] / line[1][1]) == pytest.approx(order)
    assert [t.get_text() for t in warp.texts] == ["no change above 1e-05 %"]
    assert len(cost.lines) == 2
    with pytest.raises(ValueError, match="no models"):
        plot_convergence(tmp_path / "none.png", [], "elements")


def test_nu12_figure(tmp_path: Path, drawn: list[Figure]) -> None:
    lines = {f"{p} kPa": ([0.05, 0.24, 0.45], [1.03, 1.0, np.nan]) for p in (22, 300)}
    plot_nu12(tmp_path / "n.png", {"bubble": lines}, 0.24, "largest displacement")
    axes = drawn[0].axes[0]
    assert "nu12 = 0.24" in axes.get_ylabel()
    assert [len(line.get_xdata()) for line in axes.lines] == [2, 3, 3, 1]
    rule, first, second, base = axes.lines
    assert list(rule.get_ydata()) == [1.0, 1.0]
    assert [(*base.get_xdata(), *base.get_ydata())] == [(0.24, 1.0)]
    np.testing.assert_array_equal(first.get_ydata(), [1.03, 1.0, np.nan])
    assert [first.get_color(), second.get_color()] == [*NAMED[:2]]
    words = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert words == ["22 kPa", "300 kPa"]
    with pytest.raises(ValueError, match="no models"):
        plot_nu12(tmp_path / "none.png", {}, 0.24, "load")


@pytest.mark.parametrize("count", [4, 5])
def test_more_than_four_responses_go_from_light_to_dark(figures: list[Figure], count: int) -> None:
    x = np.array([0.05, 0.45])
    plot_nu12("n", {"bubble": {str(i): (x, 1 + i * x) for i in range(count)}}, 0.24, "rise")
    colours = [line.get_color() for line in figures[0].axes[0].lines[1:-1]]
    assert colours == (list(NAMED[:4]) if count == 4 else pressure_colours(5))


def test_a_change_as_small_as_the_tolerance_is_none(figures: list[Figure]) -> None:
    panel = ConvergencePanel(
        "one", [4.0, 2.0, 1.0], {"a": [1e-5, 2e-5]}, [10, 40, 160], [0.1, 0.3, 1]
    )
    plot_convergence("c", [panel], "increments")
    change, cost = figures[0].axes
    assert change.lines[0].get_ydata().tolist() == [2e-5]
    assert change.get_xlabel() == "step, share of the load" and cost.get_legend() is None


@pytest.mark.parametrize(
    ("works", "wanted"),
    [([1, 40], ["1", "2", "5", "10", "20"]), ([1, 300], ["1", "10", "100"])],
)
def test_sizes_within_two_decades_are_labelled_at_1_2_and_5(
    figures: list[Figure], works: list[float], wanted: list[str]
) -> None:
    panel = ConvergencePanel("one", [2.0, 1.0], {"a": [1.0]}, works, [1.0, 2.0])
    plot_convergence("c", [panel], "elements")
    axes = figures[0].axes[1]
    low, high = axes.get_xlim()
    shown = [t.get_text() for t in axes.get_xticklabels() if low <= t.get_position()[0] <= high]
    assert shown == wanted


def test_more_quantities_than_colours_are_drawn(tmp_path: Path, drawn: list[Figure]) -> None:
    names = [*(f"load at {d} mm, N" for d in (40, 100, 240)), *(f"quantity {i}" for i in range(9))]
    panel = ConvergencePanel("case", [2.0, 1.0], {n: [0.1] for n in names}, [10, 40], [0.1, 0.3])
    plot_convergence(tmp_path / "c.png", [panel], "elements")
    shown = drawn[0].axes[0].lines[: len(names)]
    assert [line.get_ydata().tolist() for line in shown] == [[0.1]] * len(names)
    assert legend(drawn[0]) == [*names, "order 1", "order 2"]
