"""Figures, report page and VTU: written whole, readable, honest about what is missing."""

from __future__ import annotations

import os
from pathlib import Path

import meshio
import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.files import replacing
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports.cuts import node_cut, point_cut
from bubblefit.reports.html import number, percent
from bubblefit.reports.moduli import plot_moduli
from bubblefit.reports.optima import plot_optima
from bubblefit.reports.profiles import plot_profiles
from bubblefit.reports.scatter import _below_one, plot_heights
from bubblefit.reports.style import BLACK, SKY, VERMILION
from bubblefit.reports.vtu import write_vtu
from matplotlib.figure import Figure

from ..drawings import data, legend, lines

#: Best, median and worst of 50 starts (docs/references.md, its Fig. 4.8).
PUBLISHED = {"best": 0.096, "median": 0.226, "worst": 3.2}
STRAIN_SYMBOLS = (r"\varepsilon_1", r"\varepsilon_2", r"\gamma_{12}")
PRESSURES = np.array([0.022, 0.186, 0.3])


def cap(xy: np.ndarray, height: float) -> np.ndarray:
    """Displacement (n, 3) of a parabolic cap of radius 100 mm."""
    inside = 1 - (xy**2).sum(axis=1) / 1e4
    return np.column_stack([0.05 * xy * inside[:, None], height * inside])


def polar(angles: np.ndarray) -> np.ndarray:
    r, t = np.meshgrid(np.linspace(10, 100, 10), angles)
    ring = np.column_stack([(r * np.cos(t)).ravel(), (r * np.sin(t)).ravel()])
    return np.vstack([[0.0, 0.0], ring])


QUARTER, FULL = polar(np.linspace(0, np.pi / 2, 7)), polar(np.linspace(0, 2 * np.pi, 25)[:-1])


@pytest.mark.parametrize("values", [[0.0, 1e-9, 3.2], [np.nan, 1.3, np.inf, 1.4], [np.nan], [0.1]])
def test_optima(tmp_path: Path, drawn: list[Figure], values: list[float]):
    """Every start that ended, worst first; a line at every published value."""
    plot_optima(tmp_path / "optima.png", values, references=PUBLISHED)
    plot_optima(tmp_path / "plain.png", values)
    ended = sorted((v for v in values if np.isfinite(v)), reverse=True)
    for figure, references in zip(drawn, (PUBLISHED, {}), strict=True):
        (axes,) = figure.axes
        optima, *published = data(axes)
        np.testing.assert_array_equal(optima[0], np.arange(1, len(ended) + 1))
        np.testing.assert_array_equal(optima[1], np.maximum(ended, 1e-16))
        assert [line[1].tolist() for line in published] == [[v] * 2 for v in references.values()]
        assert [text.get_text() for text in axes.texts] == [
            f"published {name} {value:g}" for name, value in references.items()
        ]
        low, high = axes.get_ylim()
        assert all(low <= y <= high for y in (*optima[1], *references.values()))
        # Room for every start, the failed ones too, half a place to either side.
        assert axes.get_xlim() == (0.5, max(len(values), 2) + 0.5)
        # Starts are counted: there is none between two.
        assert all(float(place).is_integer() for place in axes.get_xticks())
        failed = len(values) - len(ended)
        said = f"Optima of {len(values)} start" + ("s" if len(values) > 1 else "")
        said += f", {failed} without a result" if failed else ""
        if ended:
            best, median, worst = ended[-1], np.median(ended), ended[0]
            said += f": best {best:.3g}, median {median:.3g}, worst {worst:.3g}"
        assert axes.get_title("left") == said


@pytest.mark.parametrize(
    ("values", "references", "scale", "ends"),
    [
        ([1.0, 10.0], {}, "linear", (0.0, 11.5)),
        ([1.0, 10.01], {}, "log", (10**-0.3, 10**1.3004)),
        ([1e-9, 10.0], {}, "log", (10**-9.6, 10**1.6)),
        ([1.0], {"worst": 1e3}, "log", (10**-0.3, 10**3.3)),
        ([np.nan], {}, "linear", (0.0, 1.15)),
    ],
)
def test_scale_of_the_optima(figures: list[Figure], values, references, scale, ends) -> None:
    """Logarithmic from a decade on, with room below and above."""
    plot_optima("o", values, "RMS, mm", references)
    (axes,) = figures[0].axes
    assert axes.get_yscale() == scale and axes.get_ylim() == pytest.approx(ends, rel=1e-3)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("start, sorted from worst to best", "RMS, mm")


def test_published_values_are_named_at_their_lines(figures: list[Figure]) -> None:
    """At the right end; the best below its line, the others above."""
    plot_optima("o", [0.1, 3.0, 1.0], references=PUBLISHED)
    (axes,) = figures[0].axes
    right = axes.get_window_extent().x1
    for text, (name, value) in zip(axes.texts, PUBLISHED.items(), strict=True):
        box, line = text.get_window_extent(), axes.transData.transform((1.0, value))[1]
        assert 0 < right - box.x1 < 6
        assert 0 < (line - box.y1 if name == "best" else box.y0 - line) < 6


@pytest.mark.parametrize("fits, known", [(5, True), (5, False), (1, True), (1, False)])
def test_moduli(tmp_path: Path, drawn: list[Figure], fits: int, known: bool):
    strains = np.linspace(0, [0.08, 0.1, 0.06], 20).T
    truth = 1000 * (1 - 3 * strains)
    curves = np.array([truth * (1 + 1e-6 * i) for i in range(fits)])
    plot_moduli(tmp_path / "m.png", strains, curves, truth if known else None)
    (figure,) = drawn
    assert len(figure.axes) == (6 if known else 3)
    for m, top in enumerate(figure.axes[:3]):
        (best,), others = lines(top, BLACK), lines(top, SKY)
        np.testing.assert_array_equal(best, [strains[m], curves[0, m]])
        assert sorted(other[1, 0] for other in others) == sorted(curves[1:, m, 0])
        assert [line[1].tolist() for line in lines(top, VERMILION)] == [truth[m].tolist()] * known
    for m, below in enumerate(figure.axes[3:]):
        off = [line[1] for line in data(below)]
        # Percent; the best, drawn last, is the known one itself.
        np.testing.assert_array_equal(off[-1], np.full(20, 1e-10))
        assert [y[0] for y in off[:-1]] == pytest.approx([1e-4 * i for i in range(fits - 1, 0, -1)])
        assert below.texts[0].get_text() == "best: at most 1e-10 %", m
    assert ("known" in legend(figure)) == known
    top, strain = "tangent modulus, MPa", [f"${s}$" for s in STRAIN_SYMBOLS]
    words = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    along = [f"{n} strain {s}" for n, s in zip(("warp", "fill", "shear"), strain, strict=True)]
    upper = ["", "", ""] if known else along
    assert words[:3] == [(upper[0], top), (upper[1], ""), (upper[2], "")]
    if known:
        below = "deviation from known, %"
        assert words[3:] == [(along[0], below), (along[1], ""), (along[2], "")]


@pytest.mark.parametrize(
    ("off", "ends"),
    [
        ([3.0, 4.0], (1.0, 100.0)),
        ([2e-5, 0.3], (1e-5, 10.0)),
        ([1e-9, 0.3], (1e-6, 10.0)),
    ],
)
def test_decades_of_the_deviation(figures: list[Figure], off: list[float], ends) -> None:
    """Whole ones with room for words above; of more than seven the lowest are not seen."""
    strains = np.tile([0.0, 0.1], (3, 1))
    truth = np.full((3, 2), 1000.0)
    plot_moduli("m", strains, [truth * (1 + 0.01 * np.array(off))], truth)
    for axes in figures[0].axes[3:]:
        assert axes.get_ylim() == pytest.approx(ends)
        (text,), panel = axes.texts, axes.get_window_extent()
        box = text.get_window_extent()
        assert 0 < panel.x1 - box.x1 < 0.05 * panel.width
        assert 0 < panel.y1 - box.y1 < 0.1 * panel.height


@pytest.mark.parametrize("known", [1200.0, 900.0, -100.0])
def test_fit_and_known_modulus_are_seen(figures: list[Figure], known: float) -> None:
    strains, fit = np.tile([0.0, 0.1], (3, 1)), np.full((1, 3, 2), 1000.0)
    plot_moduli("m", strains, fit, np.full((3, 2), known))
    ends = (min(0.0, known), 1.08 * max(1000.0, known))
    assert [axes.get_ylim() for axes in figures[0].axes[:3]] == [pytest.approx(ends)] * 3


@pytest.mark.parametrize("points", [QUARTER, FULL], ids=["quarter", "full"])
def test_profiles_and_heights(tmp_path: Path, drawn: list[Figure], points: np.ndarray):
    heights = (13.0, 30.0, 39.0)
    model = np.array([cap(points, h) for h in heights])
    grid = FULL[np.hypot(*FULL.T) < 90]
    measured = [(grid, cap(grid, h + 1)) for h in heights]
    plot_profiles(tmp_path / "one.png", PRESSURES, points, model)
    several = np.array([model, 1.01 * model])
    plot_profiles(tmp_path / "p.png", PRESSURES, points, several, measured)
    one, both = drawn
    for axis, panel in enumerate(one.axes):
        for line, height in zip(data(panel), heights, strict=True):
            assert line[1] == pytest.approx(height_at(line[0], height), rel=0.02, abs=0.3)
            assert line[1].max() == pytest.approx(height)
        shown = data(both.axes[axis])
        for best, next_best, dots, height in zip(
            shown[::3], shown[1::3], shown[2::3], heights, strict=True
        ):
            assert best[1].max() == pytest.approx(height)
            assert next_best[1].max() == pytest.approx(1.01 * height)
            assert dots[1].max() == pytest.approx(height + 1)
        best, other, dots = both.axes[axis].lines[:3]
        assert best.get_alpha() == 1.0 > other.get_alpha() > 0.2
        assert best.get_linewidth() > other.get_linewidth()
        assert dots.get_markerfacecolor() == "white" and dots.get_markeredgewidth() > 0.3
        assert panel.get_title("left") == ("cut along x (warp)", "cut along y (fill)")[axis]
        assert panel.get_xlabel() == ("x, mm", "y, mm")[axis]
        assert panel.get_ylabel() == ("height z, mm", "")[axis]
    assert legend(one) == ["300 kPa", "186 kPa", "22 kPa", "model"]
    assert legend(both)[3:] == ["model (2 best)", "measured"]


@pytest.mark.parametrize(("lift", "bottom"), [(5.0, 0.0), (-50.0, -52.0)])
def test_profiles_stand_on_the_sheet(figures: list[Figure], lift: float, bottom: float) -> None:
    """The axis begins with height zero, or below where a frame hangs lower."""
    plot_profiles("p", [0.022], FULL, [cap(FULL, 40.0) + np.array([0.0, 0.0, lift])])
    for axes in figures[0].axes:
        assert axes.get_ylim()[0] == pytest.approx(bottom)


def height_at(position: np.ndarray, height: float) -> np.ndarray:
    """Of a cap over where its points have moved to, nearly."""
    at = position / (1 + 0.05 * (1 - position**2 / 1e4))
    return height * (1 - at**2 / 1e4)


def test_heights_are_drawn_against_each_other(tmp_path: Path, drawn: list[Figure]):
    seen = [np.linspace(1.0, h, 12) for h in (13.0, 30.0, 39.0)]
    modelled = [z + 0.1 * k for k, z in enumerate(seen)]
    plot_heights(tmp_path / "h.png", PRESSURES, seen, modelled)
    plot_heights(tmp_path / "same.png", PRESSURES, seen, seen)
    left, right = drawn[0].axes
    for shown, off, z, model in zip(data(left)[1:], data(right)[1:], seen, modelled, strict=True):
        np.testing.assert_array_equal(shown, [z, model])
        np.testing.assert_array_equal(off, [z, model - z])
    for axes, rule in ((left, left.get_xlim()), (right, (0.0, 0.0))):
        assert axes.lines[0].get_ydata() == pytest.approx(rule) and axes.lines[0].get_zorder() == 3
    rms = np.sqrt(np.mean([0.0, 0.01, 0.04]))
    assert right.get_title("left") == f"RMS {rms:.2g} mm"
    every, spread = np.concatenate(seen), np.concatenate(modelled) - np.concatenate(seen)
    said = 1 - (spread**2).sum() / ((every - every.mean()) ** 2).sum()
    assert left.get_title("left") == f"$R^2$ = 1 $-$ {1 - said:.1e}"
    assert legend(drawn[0]) == ["300 kPa", "186 kPa", "22 kPa"]
    assert drawn[1].axes[1].get_title("left") == "RMS 0 mm"
    assert drawn[1].axes[0].get_title("left") == "$R^2$ = 1 $-$ 0.0e+00"


def test_fit_that_explains_nothing(figures: list[Figure]) -> None:
    """Of equal heights no share is explained; below the mean's error it is negative."""
    plot_heights("h", [0.022], [[3.0, 3.0]], [[3.0, 4.0]], "known")
    plot_heights("h", [0.022], [[3.0, 5.0]], [[5.0, 3.0]], "known")
    titles = [figure.axes[0].get_title("left") for figure in figures]
    assert titles == ["$R^2$ = nan", "$R^2$ = -3.000"]
    assert figures[0].axes[1].get_ylabel() == "modelled $-$ known, mm"
    assert [_below_one(r) for r in (0.999, 0.9991)] == ["0.999", "1 $-$ 9.0e-04"]


@pytest.mark.parametrize("axis", [0, 1])
def test_cut_follows_the_nodes_on_the_axis(axis: int):
    cut = node_cut(QUARTER, cap(QUARTER, 30.0), axis)
    assert len(cut.position) == 11 and cut.height[0] == pytest.approx(30.0)
    assert (np.diff(cut.position) > 0).all() and (np.diff(cut.height) < 0).all()
    assert cut.position[5] == pytest.approx(50 + 0.05 * 50 * 0.75)


def test_cut_of_a_mesh_without_nodes_on_the_axis_is_interpolated():
    turned = polar(np.linspace(0, 2 * np.pi, 73)[:-1] + np.pi / 72)
    cut = node_cut(turned, cap(turned, 30.0), 0)
    middle = np.interp(0.0, cut.position, cut.height)
    assert len(cut.position) > 70 and middle == pytest.approx(30.0, rel=0.01)


def test_measured_points_beside_the_axis_count():
    x, y = np.meshgrid(np.arange(-87.5, 90, 5.0), np.arange(-87.5, 90, 5.0))
    grid = np.column_stack([x.ravel(), y.ravel()])
    assert len(point_cut(grid, cap(grid, 30.0), 0).position) == 2 * x.shape[1]


def square() -> Mesh:
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    return Mesh(points, np.array([[0, 1, 2, 3]]), {"rim": np.arange(4)})


def test_vtu_holds_the_deformed_mesh(tmp_path: Path):
    mesh = square()
    u = np.arange(12.0).reshape(4, 3)
    path = write_vtu(
        mesh, u, tmp_path / "b.vtu", {"height": u[:, 2]}, {"thickness": np.array([0.81])}
    )
    back = meshio.read(path)
    assert back.points == pytest.approx(mesh.points + u)
    assert back.point_data["displacement"] == pytest.approx(u)
    assert back.point_data["height"] == pytest.approx(u[:, 2])
    assert back.cell_data["thickness"][0] == pytest.approx([0.81])
    with pytest.raises(ValueError, match="height: 3 rows for 4 nodes"):
        write_vtu(mesh, u, path, {"height": np.zeros(3)})


def test_numbers():
    assert [number(v) for v in (None, float("nan"), 3, "x", 0.123456)] == [
        "–", "–", "3", "x", "0.1235",
    ]  # fmt: skip
    assert [number(v) for v in (float("inf"), 12345.6, True)] == ["–", "1.235e+04", "True"]
    shares = (0.01234, 0.9949, 0.995, 0.996, 1.234, 12.0, 0.1, 0.0)
    assert [percent(share) for share in shares] == [
        "1.2 %", "99 %", "100 %", "100 %", "123 %", "1200 %", "10 %", "0 %",
    ]  # fmt: skip


def test_replacing_keeps_the_old_file_when_the_block_fails(tmp_path: Path):
    path = tmp_path / "result.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["result.txt"]
    with pytest.raises(OutputError, match="No space left"), replacing(path) as temporary:
        temporary.write_text("half")
        raise OSError(28, "No space left on device")
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["result.txt"]
