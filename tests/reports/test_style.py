"""The one look of all figures: colours, scales, room, the legend."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.style import (
    DASHES,
    NAMED,
    from_zero,
    legend_above,
    logarithmic,
    named_look,
    new_figure,
    pressure_colours,
    quiet,
    spans_a_decade,
    strain_colours,
)
from matplotlib import colormaps
from matplotlib.lines import Line2D


def test_the_best_lies_on_top_and_colours_come_again_with_other_dashes() -> None:
    looks = [named_look(rank) for rank in range(25)]
    assert [look["color"] for look in looks[:7]] == [*NAMED, NAMED[0]]
    assert [look["linestyle"] for look in looks[::6]] == [*DASHES, DASHES[0]]
    layers = [look["zorder"] for look in looks]
    assert layers == sorted(layers, reverse=True) and len(set(layers)) == 25


@pytest.mark.parametrize(
    ("values", "wanted"),
    [([1.0, 10.0], False), ([1.0, 10.1], True), ([0.0, 50.0], False), ([-1.0, 50.0], False),
     ([np.nan, 1.0, np.inf, 11.0], True), ([np.nan], False), ([], False), ([[1.0], [11.0]], True)],
)  # fmt: skip
def test_more_than_a_decade(values: list[float], wanted: bool) -> None:
    assert spans_a_decade(values) is wanted


@pytest.mark.parametrize(
    ("values", "top"), [([3.0, 20.0], 22.0), ([np.nan, 2.0, np.inf], 2.2), ([np.nan], 1.0), ([], 1)]
)
def test_from_zero(values: list[float], top: float) -> None:
    axes = new_figure(3, 3).subplots()
    from_zero(axes, values)
    assert axes.get_ylim() == pytest.approx((0.0, top))


@pytest.mark.parametrize(
    ("strain", "colours", "ends"),
    [([-0.05, 1.0], "viridis_r", (-0.05, 1.0)), ([-0.06, 1.0], "PuOr", (-1.0, 1.0)),
     ([-1.0, 0.06], "PuOr", (-1.0, 1.0)), ([-1.0, 0.05], "viridis", (-1.0, 0.05)),
     ([-1.0, 0.0], "viridis", (-1.0, 0.0)), ([-2.0, -1.0], "viridis", (-2.0, 0.0)),
     ([0.3, 0.5], "viridis_r", (0.0, 0.5)), ([0.0, 0.0], "viridis_r", (0.0, 1.0)),
     ([np.nan, 0.2], "viridis_r", (0.0, 0.2))],
)  # fmt: skip
def test_colours_of_strain(strain: list[float], colours: str, ends: tuple[float, float]) -> None:
    name, norm = strain_colours(strain)
    assert (name, norm.vmin, norm.vmax) == (colours, *ends)


def test_colours_of_pressures_end_with_the_darkest() -> None:
    shades = colormaps["viridis_r"]
    assert pressure_colours(3) == [shades(0.12), shades(0.56), shades(1.0)]


def test_quiet_axes() -> None:
    axes = new_figure(3, 3).subplots()
    quiet(axes, "x, mm", "y, N", "title")
    assert [axes.spines[side].get_visible() for side in ("left", "bottom", "top", "right")] == [
        True, True, False, False,
    ]  # fmt: skip
    assert axes.xaxis.get_gridlines()[0].get_visible() and axes.get_axisbelow() is True
    quiet(axes, "x, mm", "y, N")
    assert axes.get_title("left") == "title"


@pytest.mark.parametrize(("count", "columns", "wide"), [(5, 4, 3), (4, 4, 4), (3, 4, 3), (7, 3, 3)])
def test_rows_of_the_legend_are_filled(count: int, columns: int, wide: int) -> None:
    figure = new_figure(8, 3)
    legend_above(figure, {}, columns)
    assert not figure.legends
    legend_above(figure, {str(i): Line2D([], []) for i in range(count)}, columns)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [str(i) for i in range(count)]
    assert legend._ncols == wide


def test_logarithmic_axes_have_plain_numbers() -> None:
    axes = new_figure(3, 3).subplots()
    logarithmic(axes)
    axes.set_ylim(0.9, 110.0)
    axes.figure.draw_without_rendering()
    low, high = axes.get_ylim()
    shown = [t.get_text() for t in axes.get_yticklabels() if low <= t.get_position()[1] <= high]
    assert shown == ["1", "2", "5", "10", "20", "50", "100"]
