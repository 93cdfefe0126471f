"""Each doubt about a bubble just below its limit and at it, and what it says to the last word."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts as motion
from bubblefit.experiments.bubble import doubts as place
from bubblefit.experiments.bubble import doubts as size
from bubblefit.experiments.bubble.doubts import Apex, View
from bubblefit.experiments.kinds import Expected
from bubblefit.meshes.disk import Outline
from bubblefit.readers.fields import DisplacementField

RADIUS = 100.0
FABRIC = Expected({"E1": (250.0, 1500.0), "E2": (50.0, 500.0), "G12": (7.0, 70.0)})
ADVICE = "let a registration find the frame ([bubble.data.points.registration])"
POINTS = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 20.0], [-30.0, 0.0], [0.0, -40.0]])


def field(pressure: float, moved: Any, points: Any = POINTS, z: Any = None) -> DisplacementField:
    moved = np.broadcast_to(np.asarray(moved, dtype=float), (len(points), 3))
    return DisplacementField(pressure, np.asarray(points, dtype=float), moved, z=z)


def said(check, expected: Expected = FABRIC, **seen: Any) -> list[tuple[str, bool, str]]:
    """Return name, certainty and text of what a check finds in a made-up view."""
    whole = View(
        seen.pop("fields", (field(0.2, [0, 0, 30.0]),)), Outline.circle(RADIUS), 0.8, False
    )
    names = ("outline", "radius", "last", "fields", "thickness", "registered", "inner")
    view = SimpleNamespace(**({name: getattr(whole, name) for name in names} | seen))
    return [(doubt.name, doubt.sure, doubt.text) for doubt in check(view, expected)]


def finds(check, count: int, name: str, sure: bool, *words: str, **seen: Any) -> None:
    """Assert that a check finds so many doubts, each of a name and with these words."""
    found = said(check, **seen)
    assert [one[:2] for one in found] == [(name, sure)] * count
    assert all(word in one[2] for one in found for word in words), found


def apex(strain: tuple[float, float], force: float = 20.0) -> Apex:
    return Apex(0.2, 30.0, 0.01, force, 0.1, strain)


@pytest.mark.parametrize(("far", "doubt"), [(10.0, 1), (10.1, 0), (1999.0, 0), (2000.0, 1)])
def test_how_far_points_reach(far, doubt):
    fields = (field(0.2, [0, 0, 30.0], [[0.0, 0.0], [far, 0.0]]),)
    words = ["x and y", f"{far / 100:.3g} radii"]
    finds(
        size.length_unit, doubt, "length-unit", True, *words, fields=fields, rises=np.array([30.0])
    )


@pytest.mark.parametrize(
    ("rise", "doubt"), [(0.4, 1), (0.41, 0), (-0.41, 0), (149.0, 0), (150.0, 1), (-150.0, 1)]
)
def test_how_far_the_centre_rises(rise, doubt):
    words = ["displacements", f"{abs(rise) / 100:.3g} radii at 200 kPa"]
    finds(size.length_unit, doubt, "length-unit", True, *words, rises=np.array([0.0, rise]))


@pytest.mark.parametrize(
    ("modulus", "doubt"), [(12.4, 1), (12.6, 0), (5990.0, 0), (6010.0, 1)]
)  # of bounds 50 to 1500 MPa, four times less and more
def test_the_modulus_of_the_apex(modulus, doubt):
    """Force over strain and thickness, times 1 - 0.25."""
    force = modulus / 0.75 * 0.8 * 0.04
    words = [f"{force:.3g} N/mm", "0.04", f"{modulus:.3g} MPa", "E1 and E2 are 50 to 1.5e+03"]
    apexes = (apex((9, 9)), apex((0.03, 0.05), force))
    finds(size.pressure_unit, doubt, "pressure-unit", True, *words, apexes=apexes)


def test_an_apex_that_says_nothing_of_the_pressure():
    assert len(said(size.pressure_unit, apexes=(apex((0.002, 0.002), 1e9),))) == 1
    assert said(size.pressure_unit, apexes=(apex((0.001, 0.0029), 1e9),)) == []
    assert said(size.pressure_unit, apexes=(apex((0.1, 0.1), np.inf),)) == []
    assert said(size.pressure_unit, apexes=()) == []
    assert said(size.pressure_unit, Expected({}), apexes=(apex((0.1, 0.1), 1e9),)) == []


def test_a_centre_that_goes_down():
    assert said(motion.upside_down, rises=np.array([-3.0, 0.0])) == []
    finds(
        motion.upside_down, 1, "z-flipped", True, "-2.5 mm", "200 kPa", rises=np.array([3.0, -2.5])
    )


def test_a_centre_that_sinks_between_two_frames():
    fields = tuple(field(p, [0, 0, 1.0]) for p in (0.01, 0.02, 0.03, 0.04))
    rises = np.array([10.0, 9.01, 50.0, 40.0])
    words = ["from 50 to 40 mm", "30 and 40 kPa"]
    finds(motion.order, 1, "frame-order", True, *words, fields=fields, rises=rises)
    (found,) = said(motion.order, fields=fields, rises=np.array([10.0, 8.99, 50.0, 50.0]))
    assert "sinks from 10 to 8.99 mm between 10 and 20 kPa:" in found[2]
    assert said(motion.order, fields=fields, rises=np.array([10.0, 9.0, 50.0, 49.0])) == []


def test_a_frame_given_twice():
    moved = [field(p, [0, 0, 5.0]) for p in (0.01, 0.02)]
    other = [field(p, [0, 0, 6.0]) for p in (0.03, 0.04)]
    still = [field(p, 0.0) for p in (0.001, 0.002)]
    words = ["10 and 20 kPa", "given twice"]
    finds(motion.repeated, 1, "repeated-frame", True, *words, fields=(*still, *moved))
    finds(motion.repeated, 1, "repeated-frame", True, "1 more pairs", fields=(*moved, *other))
    fewer = field(0.02, [0, 0, 5.0], POINTS[:4])
    assert said(motion.repeated, fields=(moved[0], fewer)) == []


def test_points_that_are_zero():
    points = np.vstack([POINTS, [[91.0, 0.0], [89.0, 0.0]]])
    moved = np.ones((7, 3))
    moved[5] = 0.0
    assert said(motion.rejected_at_zero, fields=(field(0.2, moved, points),)) == []
    moved[6] = 0.0
    still = "1 of 6 points well within the rim"
    finds(
        motion.rejected_at_zero, 1, "zero-points", True, still, fields=(field(0.2, moved, points),)
    )
    points[6] = 0.0
    both = (still, "2 points lie at exactly x = y = 0", "200 kPa")
    finds(
        motion.rejected_at_zero, 1, "zero-points", True, *both, fields=(field(0.2, moved, points),)
    )
    (found,) = said(motion.rejected_at_zero, fields=(field(0.2, np.ones((7, 3)), points),))
    assert found[2].startswith("2 points lie at exactly x = y = 0")


UP = np.array([1.0, 4.0, 9.0, 2.0, 7.0])
DEFORMED = "the coordinates are those of the deformed sheet; export the reference coordinates"


@pytest.mark.parametrize(("share", "doubt"), [(0.49, 0), (0.51, 1), (1.0, 1), (-1.0, 0)])
def test_a_height_that_follows_the_rise(share, doubt):
    one = field(0.2, np.outer(UP, [0, 0, 1.0]), z=share * UP + 600.0)
    found = said(motion.deformed_coordinates, fields=(one,))
    words = f"the height z follows dz by {share:.0%}: {DEFORMED}"
    assert found == [("deformed-coordinates", True, words)] * doubt
    assert said(motion.deformed_coordinates, fields=(one,), registered=True) == []


@pytest.mark.parametrize(("share", "doubt"), [(0.49, 0), (0.51, 1), (1.0, 1)])
def test_places_that_change_from_frame_to_frame(share, doubt):
    moved = np.column_stack([UP, -UP, 0 * UP])
    low, high = field(0.1, 2 * moved), field(0.2, 3 * moved, POINTS + share * moved[:, :2])
    other = field(0.05, [0, 0, 1.0], POINTS[:3])
    found = said(motion.deformed_coordinates, fields=(other, low, high))
    words = f"x and y change from frame to frame by {share:.0%} of dx and dy: {DEFORMED}"
    assert found == [("deformed-coordinates", True, words)] * doubt


def test_places_that_are_only_a_little_like_the_motion():
    """A correlation of 0.9 is alike, a smaller one is chance."""
    moved = np.array([[3.0], [-3.0], [0.0], [0.0]])
    for across, alike in ((1.45, 1.0), (1.46, 0.0)):  # 1 / sqrt(1 + (1.45 / 3)^2) = 0.9003
        assert motion._follows(np.array([[3.0], [-3.0], [across], [-across]]), moved) == alike
    assert motion._follows(moved, 0 * moved) == 0.0


def test_axes_that_do_not_go_together():
    assert said(motion.mirrored, apexes=()) == []
    assert said(motion.mirrored, apexes=(apex((0.04, -0.0099)),)) == []
    words = ["0.04 along x and -0.0101 along y", "y and dy"]
    both = (apex((0.1, 0.1)), apex((0.04, -0.0101)))
    finds(motion.mirrored, 1, "axis-flipped", True, *words, apexes=both)
    finds(motion.mirrored, 1, "axis-flipped", True, "x and dx", apexes=(apex((-0.04, 0.1)),))
    for strain in ((-0.01, -0.02), (-0.01, 0.0)):
        words = [f"strains {strain[0]:.3g}, {strain[1]:.3g}", "shrinks"]
        finds(motion.mirrored, 1, "axis-flipped", True, *words, apexes=(apex(strain),))


@pytest.mark.parametrize(("height", "doubt"), [(9.99, 0), (10.0, 1), (-10.0, 1), (-9.99, 0)])
def test_heights_about_the_rim(height, doubt):
    one = field(0.2, [0, 0, 30.0], z=height + np.array([0, 0, 0, -50.0, 50.0]))
    words = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
    found = said(place.camera_height, fields=(one,))
    assert found == [("camera-frame", False, words)] * doubt
    assert said(place.camera_height) == []


def rim(**other: float) -> SimpleNamespace:
    return SimpleNamespace(
        **({"x": 0.0, "y": 0.0, "error": 0.1, "angle": 0.0, "turn_error": 0.1} | other)
    )


@pytest.mark.parametrize(
    ("x", "y", "error", "doubt"),
    [(2.0, 2.8, 0.1, 0), (2.11, 2.8, 0.1, 1), (2.11, 2.8, 0.9, 0), (9.0, 12.0, 0.1, 1),
     (9.1, 12.0, 0.1, 2), (9.1, -12.0, 4.0, 0)],
)  # fmt: skip
def test_a_rim_about_another_centre(x, y, error, doubt):
    """3.5 mm off is much, where it is four standard errors; 15 mm is sure."""
    words = [f"x = {x:.3g}, y = {y:.3g} mm (+- {error:.2g})"]
    seen = rim(x=x, y=y, error=error)
    finds(place.off_centre, bool(doubt), "off-centre", doubt == 2, *words, rim=seen)
    assert said(place.off_centre, rim=None) == []


@pytest.mark.parametrize(("tilt", "doubt"), [(1.19, 0), (1.21, 1), (7.99, 1), (8.01, 2)])
def test_a_rise_that_is_not_along_z(tilt, doubt):
    turn = np.radians(tilt)
    moved = 30.0 * np.array([0.6 * np.sin(turn), -0.8 * np.sin(turn), np.cos(turn)])
    # What both frames share is the first one's, and points at the clamp do not count.
    points = np.vstack([POINTS, [[95.0, 0.0]]])
    last = np.vstack([np.tile(moved + 7.0, (5, 1)), [[500.0, 0, 0]]])
    first = np.vstack([np.tile([7.0, 7.0, 7.0], (5, 1)), [[-500.0, 0, 0]]])
    fields = (field(0.1, first[::-1], points[::-1]), field(0.2, last, points))
    for frames in (fields, (field(0.2, moved),), (field(0.2, -moved),)):
        words = f"{tilt:.2g} degrees from z"
        finds(place.tilted, bool(doubt), "tilted", doubt == 2, words, fields=frames)


def test_a_rise_that_is_not_known():
    assert said(place.tilted, fields=(field(0.2, [9.0, 0, 0]),)) == []
    assert said(place.tilted, fields=(field(0.2, [9.0, 0, 1], POINTS[:1] + 95.0),)) == []


@pytest.mark.parametrize(
    ("off", "error", "clear", "doubt"),
    [(4.99, 0.1, 0.7, 0), (5.0, 0.1, 0.7, 1), (-5.0, 0.1, 0.6, 1), (5.0, 0.1, 0.59, 0),
     (12.0, 3.0, 0.7, 1), (11.9, 3.0, 0.7, 0)],
)  # fmt: skip
def test_axes_of_symmetry_beside_the_yarns(off, error, clear, doubt):
    axes = SimpleNamespace(off=off, error=error, clear=clear)
    words = f"{off:.3g} degrees from x and y (+- {error:.2g})"
    finds(place.turned, doubt, "turned", False, words, axes=axes, rim=rim())
    assert said(place.turned, axes=axes, rim=None) == said(place.turned, axes=None, rim=rim()) == []


@pytest.mark.parametrize(
    ("angle", "error", "doubt"),
    [(34.9, 0.1, 0), (35.0, 0.1, 1), (25.0, 0.1, 1), (42.0, 3.0, 1), (41.9, 3.0, 0)],
)
def test_an_ellipse_that_lies_otherwise(angle, error, doubt):
    outline = Outline(120.0, 80.0, 30.0)
    words = [f"{angle:.3g} degrees from x (+- {error:.2g})", "not 30"]
    seen = rim(angle=angle, turn_error=error)
    finds(place.turned, doubt, "turned", False, *words, outline=outline, rim=seen)
    assert said(place.turned, outline=outline, rim=None) == []


@pytest.mark.parametrize(("warp", "doubt"), [(0.0549, 0), (0.0551, 1)])
def test_a_warp_that_is_strained_more(warp, doubt):
    words = [f"{warp:.3g} along the warp and 0.05 along the fill"]
    both = (apex((0.01, 0.02)), apex((0.9, 0.9)), apex((warp + 0.01, 0.07)))
    assert [one[:2] for one in said(place.swapped, apexes=both)] == [("swapped", False)] * doubt
    finds(place.swapped, doubt, "swapped", False, *words, apexes=(apex((warp, 0.05)),))


def test_strains_that_say_nothing_of_warp_and_fill():
    plain = {"apexes": (apex((0.09, 0.05)),)}
    assert len(said(place.swapped, **plain)) == 1
    for strain in ((0.02, 0.0), (0.02, -0.01)):
        assert said(place.swapped, apexes=(apex(strain),)) == []
    assert said(place.swapped, apexes=()) == said(place.swapped, Expected({}), **plain) == []
    assert said(place.swapped, outline=Outline(120.0, 80.0), **plain) == []
    for low, alike in ((374.0, 1), (376.0, 0)):  # geometric means: 1.5 times 500
        bounds = Expected({"E1": (500.0, 750.0 * 1000 / 500), "E2": (low, 500_000 / 375.0)})
        assert len(said(place.swapped, bounds, **plain)) == alike


def test_rises_of_a_view_are_those_about_the_centre():
    moved = np.outer([10.0, 12.0, 14.0, 1.0, 2.0], [0, 0, 1.0])
    view = View((field(0.1, moved),), Outline.circle(RADIUS), 0.8, False)
    assert view.rises.tolist() == [12.0]  # those within 25 mm
    far = View((field(0.1, moved[:4], POINTS[1:] * 3.0),), Outline.circle(RADIUS), 0.8, False)
    assert far.rises.tolist() == [11.0]  # no point there: of all
    assert view.apexes == () and view.rim is None and view.axes is None
    assert view.inner(field(0.1, moved, POINTS * 2.25)).tolist() == [True] * 4 + [False]
