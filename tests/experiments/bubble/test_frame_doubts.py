"""experiments/bubble/frame_doubts.py: order, repetition and reference of frames."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts, frame_doubts
from bubblefit.experiments.bubble.measured_view import MeasuredView

from ...builders.bubbles import CIRCLE, points_on
from .cases import FIVE_POINTS, assert_doubted, doubts_said, field_of


def test_centre_that_sinks_between_frames_is_doubted():
    fields = tuple(field_of(p, [0, 0, 1.0]) for p in (0.01, 0.02, 0.03, 0.04))
    for rises, words in (
        ([10.0, 9.01, 50.0, 40.0], ["from 50 to 40 mm", "30 and 40 kPa"]),
        ([10.0, 8.99, 50.0, 50.0], ["from 10 to 8.99 mm between 10 and 20 kPa:"]),
    ):
        seen = {"fields": fields, "rises": np.array(rises)}
        assert_doubted(doubts.frame_order, 1, "frame-order", True, *words, **seen)
    assert (
        doubts_said(doubts.frame_order, fields=fields, rises=np.array([10.0, 9.0, 50.0, 49.0]))
        == []
    )


def test_frame_given_twice_is_doubted():
    moved = [field_of(p, [0, 0, 5.0]) for p in (0.01, 0.02)]
    other = [field_of(p, [0, 0, 6.0]) for p in (0.03, 0.04)]
    still = [field_of(p, 0.0) for p in (0.001, 0.002)]
    for fields, words in (((*still, *moved), "10 and 20 kPa"), ((*moved, *other), "1 more pairs")):
        assert_doubted(doubts.repeated_frame, 1, "repeated-frame", True, words, fields=fields)
    for rise, count in ((5.0, 1), (5.06, 1), (5.08, 0), (6.0, 0)):  # 0.1 of 0.2 ln(2) is 0.07 of 5
        high = field_of(0.02, [0, 0, rise], FIVE_POINTS[:4])
        words = ["5 mm at 10 kPa", f"{rise:.4g} mm at 20 kPa", "about 0.74 mm"]
        assert_doubted(
            doubts.same_states, count, "repeated-frame", True, *words, fields=(moved[0], high)
        )


@pytest.mark.parametrize(
    ("pressure", "rise", "words"),
    [
        (0.0002, 0.009, "rises by 0.009 of 40 mm at 0.2 kPa, 0.50% of"),
        (0.01, 2.49, "at 10 kPa, 25.00% of"),
        (0.01, 2.51, ""),
        (0.0002, 19.9, ""),
        (0.0002, 20.1, "rises by 20 of 40 mm at 0.2 kPa"),
        (0.001, 20.1, ""),
    ],
)
def test_frame_at_rest_under_pressure_is_doubted_and_the_reverse(pressure, rise, words):
    """The apex rises by 40 mm at 40 kPa; the limits are a quarter of its share, and half of it."""
    fields = tuple(field_of(p, [0, 0, h]) for p, h in ((pressure, rise), (0.02, 30.0), (0.04, 40)))
    assert_doubted(doubts.states_at_rest, bool(words), "rest-frame", True, words, fields=fields)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ([1.1, 0.0, 0.5], "moves by 1.1, 0, 0.5 mm on average at 50 kPa"),
        ([0.0, -1.1, 0.5], "moves by 0, -1.1, 0.5 mm"),
        ([0.0, 0.0, 5.7], "moves by 0, 0, 5.7 mm"),
        ([0.8, 0.8, 4.0], ""),
    ],
)
def test_edge_that_moves_is_doubted(motion, words):
    """Doubt motions above 0.03 of the rise along the sheet, or 0.15 of it up."""
    points = points_on(CIRCLE)
    moved = motion + np.outer(1.0 - (points**2).sum(axis=1) / 1e4, [0.0, 0.0, 30.0])
    fields = field_of(0.02, 0.1 * moved, points), field_of(0.05, moved, points)
    found = list(doubts.moving_edge(MeasuredView(fields, CIRCLE, 0.8, False)))
    assert [(doubt.name, doubt.sure) for doubt in found] == [("moving-edge", False)] * bool(words)
    assert all(words in doubt.text for doubt in found), found


@pytest.mark.parametrize(
    ("bump", "is_flat", "is_doubted"),
    [(0.39, True, False), (0.41, True, True), (9.0, False, False)],
)
def test_sheet_that_is_taken_for_flat_and_is_not_is_doubted(bump, is_flat, is_doubted):
    """Doubt a saddle in a tilted plane from 0.004 of the radius on."""
    points = points_on(CIRCLE)
    x, y = points.T / 97.0
    saddle = (x**2 - y**2) / np.abs(x**2 - y**2).max()
    field = field_of(0.1, [0, 0, 30.0], points, z=600.0 + 5.0 * x - 3.0 * y + bump * saddle)
    words = f"up to {bump:.2g} mm off a plane"
    seen = {"fields": (field,), "is_flat": is_flat}
    assert_doubted(doubts.first_shape, is_doubted, "flat-sheet", False, words, **seen)


@pytest.mark.parametrize(
    ("dome", "rise", "words"),
    [
        (10.0, 10.0, ["stands 10 mm above its rim", "about 1.3 kPa by its height"]),
        (5.1, 5.1, ["stands 5.1 mm", "about 1.3 kPa"]),
        (4.9, 4.9, []),
        (-10.0, 10.0, []),
        (10.0, -10.0, []),
    ],
)
def test_dome_of_the_reference_picture_gives_its_pressure(dome, rise, words):
    """It is doubted from a twentieth of the radius; an eighth of 10.003 kPa is just above 1.25."""
    points = points_on(CIRCLE)
    z = dome * (np.hypot(*points.T) < 50.0)
    seen = {"fields": (field_of(0.010003, [0, 0, rise], points, z=600.0 + z),)}
    count = bool(words)
    assert_doubted(doubts.loaded_reference, count, "loaded-reference", False, *words, **seen)


@pytest.mark.parametrize(
    ("slack", "loaded", "estimate"),
    [(-0.15, 2.0, 2.0), (-0.15, 0.1, 0.2), (-0.2, 15.0, 10.0), (-0.14, 2.0, None)],
)
def test_pressure_of_a_loaded_reference_follows_from_the_rises(slack, loaded, estimate):
    """Heights grow with the cube root; from a hundredth to half of the lowest pressure, kPa."""
    pressures = np.array([0.02, 0.1, 0.2])
    sheet = SimpleNamespace(reference_frame=None, moving_rim=False)
    test = SimpleNamespace(
        sheet=sheet, displacement_offset=False, match_by="points", rising=3, pressures=pressures,
        outline=CIRCLE,
    )  # fmt: skip
    rises = 60.0 * (np.cbrt(pressures) - np.cbrt(1e-3 * loaded))
    prepared = SimpleNamespace(
        test=test,
        known=None,
        sheet=SimpleNamespace(surface=None),
        view=SimpleNamespace(rises=rises),
    )
    found = frame_doubts.loaded_alternative(prepared, {"slack_warp": slack, "slack_fill": 0.1})
    if estimate is None:
        assert found is None
    else:
        assert (found.estimate, found.largest) == pytest.approx((estimate, 18.0))


UP = np.array([1.0, 4.0, 9.0, 2.0, 7.0])


@pytest.mark.parametrize(("share", "doubt"), [(0.49, 0), (0.51, 1), (1.0, 1), (-1.0, 0)])
def test_places_that_follow_the_motion_are_doubted(share, doubt):
    check, name = doubts.deformed_coordinates, "deformed-coordinates"
    one = field_of(0.2, np.outer(UP, [0, 0, 1.0]), z=share * UP + 600.0)
    assert_doubted(check, doubt, name, True, f"z follows dz by {share:.0%}", fields=(one,))
    assert doubts_said(check, fields=(one,), is_registered=True) == []
    assert (
        doubts_said(check, fields=(one,), counts_from_pressure=True) == []
    )  # a dome that pressure has raised
    moved = np.column_stack([UP, -UP, 0 * UP])
    low, high = (
        field_of(0.1, 2 * moved),
        field_of(0.2, 3 * moved, FIVE_POINTS + share * moved[:, :2]),
    )
    fields = (field_of(0.05, [0, 0, 1.0], FIVE_POINTS[:3]), low, high)
    assert_doubted(check, doubt, name, True, f"{share:.0%} of dx and dy", fields=fields)


def test_weak_correlation_of_places_and_motion_is_no_doubt():
    """A correlation of 0.9 is alike, a smaller one is chance."""
    moved = np.array([[3.0], [-3.0], [0.0], [0.0]])
    for across, alike in ((1.45, 1.0), (1.46, 0.0)):  # 1 / sqrt(1 + (1.45 / 3)^2) = 0.9003
        assert (
            frame_doubts._followed_share(np.array([[3.0], [-3.0], [across], [-across]]), moved)
            == alike
        )
    assert frame_doubts._followed_share(moved, 0 * moved) == 0.0
