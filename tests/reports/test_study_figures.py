"""Figures of studies: refinement and its cost, responses over nu12."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.reports import ConvergencePanel, plot_convergence, plot_nu12
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
    words = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert words == ["22 kPa", "300 kPa"]
    with pytest.raises(ValueError, match="no models"):
        plot_nu12(tmp_path / "none.png", {}, 0.24, "load")


def test_more_quantities_than_colours_are_drawn(tmp_path: Path, drawn: list[Figure]) -> None:
    names = [*(f"load at {d} mm, N" for d in (40, 100, 240)), *(f"quantity {i}" for i in range(9))]
    panel = ConvergencePanel("case", [2.0, 1.0], {n: [0.1] for n in names}, [10, 40], [0.1, 0.3])
    plot_convergence(tmp_path / "c.png", [panel], "elements")
    shown = drawn[0].axes[0].lines[: len(names)]
    assert [line.get_ydata().tolist() for line in shown] == [[0.1]] * len(names)
    assert legend(drawn[0]) == [*names, "order 1", "order 2"]
