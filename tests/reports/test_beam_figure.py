"""The bent cylinder's figure: what is drawn where, in mm."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.reports.beam import BeamBodies, plot_beam
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

#: mm of the collar's wall; how far the close view goes, in the collar's lengths.
WALL, CLOSE = 12.0, 2.2
BODIES = BeamBodies(((-500.0, -150.0), (500.0, -150.0)), 50.0, 10.0, 100.0, 80.0)
#: Four quads in a row on the seen side, two behind: (n, 3) mm.
Z = np.linspace(-600.0, 600.0, 5)
POINTS = np.array([[x, y, z] for x in (80.0, -80.0) for y in (-75.0, 75.0) for z in Z])
QUADS = np.array([[i, i + 1, i + 6, i + 5] for i in (0, 1, 2, 3, 10, 11)])
STRAIN = np.array([0.01, 0.02, 0.03, -0.4, 0.9, 0.9])
OUTLINE = np.array([[-600.0, -75.0], [600.0, -75.0], [600.0, 75.0], [-600.0, -75.0]])
RING = (np.array([[-75.0, 0.0], [0.0, 75.0]]), np.array([[-70.0, -5.0], [0.0, 60.0]]))


@pytest.fixture
def figure(figures: list[Figure]) -> Figure:
    plot_beam("b.png", POINTS, QUADS, STRAIN, OUTLINE, RING, BODIES, "150 mm, 140 kPa")
    return figures[0]


def test_the_side_is_the_half_that_is_seen(figure: Figure) -> None:
    whole, close, _, bar = figure.axes
    for axes in (whole, close):
        (faces,) = (c for c in axes.collections if isinstance(c, PolyCollection))
        z_of_first = faces.get_paths()[0].vertices[:4, 0]
        assert len(faces.get_paths()) == 4 and np.abs(z_of_first).max() <= 600.0
        # What lies behind (0.9) is left out of the drawing.
        assert faces.get_array().max() == pytest.approx(0.03)
        # Colours go as far as the fabric is stretched anywhere; a wrinkle has the lowest.
        assert faces.get_clim() == pytest.approx((-0.9, 0.9))
        assert axes.get_aspect() == 1.0
        (before,) = axes.lines
        np.testing.assert_array_equal(np.transpose(before.get_data()), OUTLINE)
    assert bar.get_ylabel() == "log strain along the axis"
    assert (whole.get_ylabel(), whole.get_title("left")) == ("y, mm", "150 mm, 140 kPa")
    assert (close.get_xlabel(), close.get_ylabel()) == ("z, mm", "y, mm")
    assert close.get_title("left") == "at the collar"


def test_everything_is_in_sight(figure: Figure) -> None:
    whole, close, *_ = figure.axes
    assert whole.get_xlim() == pytest.approx((-618.0, 618.0))
    # The supports' feet below, the collar's wall above, and room.
    assert whole.get_ylim() == pytest.approx((-220.0, 10.0 + 100.0 + WALL + 20.0))
    assert close.get_xlim() == pytest.approx((-CLOSE * 80.0, CLOSE * 80.0))
    tall = 100.0 + 4 * WALL
    assert close.get_ylim() == pytest.approx((10.0 - tall, 10.0 + tall))


def test_supports_and_collar_are_true_to_scale(figure: Figure) -> None:
    whole, _, cut, _ = figure.axes
    circles = [p for p in whole.patches if isinstance(p, Circle)]
    assert [(*c.center, c.radius) for c in circles] == [
        (-500.0, -150.0, 50.0), (500.0, -150.0, 50.0)
    ]  # fmt: skip
    inside, low, high = (p for p in whole.patches if isinstance(p, Rectangle))
    ends = [(r.get_x(), r.get_y(), r.get_width(), r.get_height()) for r in (inside, low, high)]
    assert ends == [
        (-40.0, -90.0 - WALL, 80.0, 2 * (100.0 + WALL)),
        (-40.0, -90.0 - WALL, 80.0, WALL),
        (-40.0, 110.0, 80.0, WALL),
    ]
    (ring,) = (p for p in cut.patches if isinstance(p, Circle))
    assert (*ring.center, ring.radius) == (0.0, 10.0, 100.0 + 0.5 * WALL)
    assert not ring.get_fill()


def test_the_cut_is_the_ring_before_and_now(figure: Figure) -> None:
    cut = figure.axes[2]
    for line, ring, name in zip(cut.lines, RING, ("inflated", "bent"), strict=True):
        np.testing.assert_array_equal(np.transpose(line.get_data()), ring)
        assert line.get_label() == name
    assert cut.get_aspect() == 1.0
    assert (cut.get_xlabel(), cut.get_ylabel()) == ("x, mm", "y, mm")
    # The legend stands beside the panel's upper right corner.
    (box, panel) = cut.get_legend().get_window_extent(), cut.get_window_extent()
    assert 0 <= box.x0 - panel.x1 < 20 and 0 <= panel.y1 - box.y1 < 20
    assert not any(axes.xaxis.get_gridlines()[0].get_visible() for axes in figure.axes[:3])


def test_the_whole_beam_stands_above_the_others(figure: Figure) -> None:
    whole, close, cut, _ = (axes.get_position() for axes in figure.axes)
    assert whole.y0 > max(close.y1, cut.y1) and close.x1 < cut.x0
    assert whole.width > 1.3 * close.width


def test_what_is_nearer_hides_what_is_behind(figures: list[Figure]) -> None:
    """Quads on the half that is seen, its middle included, from the far to the near."""
    x = np.array([40.0, -40.0, 0.0, 80.0])
    side = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])  # z, y
    points = np.array([[at, y, z + at] for at in x for z, y in side])
    quads, strain = np.arange(16).reshape(4, 4), np.array([0.1, 0.2, 0.3, 0.4])
    plot_beam("b", points, quads, strain, 0.1 * OUTLINE, RING, BODIES)
    for axes in figures[0].axes[:2]:
        (faces,) = (c for c in axes.collections if isinstance(c, PolyCollection))
        assert faces.get_array().tolist() == [0.3, 0.1, 0.4]
        middles = [path.vertices[:4, 0].mean() for path in faces.get_paths()]
        assert middles == pytest.approx([0.0, 40.0, 80.0])


@pytest.mark.parametrize(
    ("supports", "collar", "rises", "ends"),
    [
        (-150.0, 0.0, 0.0, (-200.0, 112.0)),  # feet, collar
        (0.0, 10.0, 0.0, (-102.0, 122.0)),  # collar
        (0.0, -10.0, 95.0, (-122.0, 170.0)),  # collar, inflated beam
        (0.0, 60.0, -80.0, (-155.0, 172.0)),  # beam, collar
    ],
)
def test_the_lowest_and_the_highest(figures: list[Figure], supports, collar, rises, ends) -> None:
    """Of the beam now and before, of collar and supports, with 20 mm of room."""
    bodies = BeamBodies(((-500.0, supports), (500.0, supports)), 50.0, collar, 100.0, 80.0)
    now, before = POINTS + np.array([0.0, min(rises, 0.0), 0.0]), OUTLINE.copy()
    before[:, 1] += max(rises, 0.0)
    plot_beam("b", now, QUADS, STRAIN, before, RING, bodies)
    low, high = ends
    assert figures[0].axes[0].get_ylim() == pytest.approx((low - 20.0, high + 20.0))


@pytest.mark.parametrize(
    ("strain", "ends", "beyond"),
    [
        ([0.01, 0.02, 0.03, -0.4, 0.0, 0.0], (-0.03, 0.03), "min"),
        ([0.01, 0.02, 0.03, 0.0, 0.0, 0.0], (0.0, 0.03), "neither"),
        ([0.01, 0.02, 0.03, -0.02, 0.0, 0.0], (-0.03, 0.03), "neither"),
        ([-0.4, -0.1, 0.0, 0.0, 0.0, 0.0], (-1e-6, 0.0), "min"),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (0.0, 1.0), "neither"),
    ],
)
def test_colours_of_wrinkles(figures: list[Figure], strain, ends, beyond) -> None:
    """All of them one colour, and the bar says that there is more."""
    plot_beam("b.png", POINTS, QUADS, np.array(strain), OUTLINE, RING, BODIES)
    (faces,) = (c for c in figures[0].axes[0].collections if isinstance(c, PolyCollection))
    assert faces.get_clim() == pytest.approx(ends)
    bars = [c.colorbar for axes in figures[0].axes for c in axes.collections if c.colorbar]
    assert [bar.extend for bar in bars] == [beyond]
