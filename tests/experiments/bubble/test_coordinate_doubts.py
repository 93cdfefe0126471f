"""experiments/bubble/coordinate_doubts.py: units, origin, tilt and axes of coordinates."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts
from bubblefit.experiments.doubts import Expected
from bubblefit.meshes.disk import Outline

from .cases import FIVE_POINTS, apex, assert_doubted, doubts_said, field_of


def rim(**other):
    usual = {"x": 0.0, "y": 0.0, "error": 0.1, "angle": 0.0, "turn_error": 0.1}
    return SimpleNamespace(**(usual | other))


def heights(height):
    return (field_of(0.2, [0, 0, 30.0], z=height + np.array([0, 0, 0, -50.0, 50.0])),)


def force(modulus):
    return modulus / 0.75 * 0.8 * 0.04


AXES = partial(SimpleNamespace, error=0.1, clarity=0.7)
ELLIPSE = Outline(120.0, 80.0, 30.0)
#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
UNIT_LIMITS = [
    *((doubts.length_unit, "length-unit", int(bool(words)), True, words,
       {"fields": (field_of(0.2, [0, 0, 30.0], [[0.0, 0.0], [far, 0.0]]),),
        "rises": np.array([0.0, rise])})
      for far, rise, words in (
          (20.0, 30.0, ["0.2 radii", "x and y"]), (20.1, 30.0, []), (499.0, 30.0, []),
          (500.0, 30.0, ["5 radii"]), (50.0, 0.4, ["0.004 radii at 200 kPa", "displacements"]),
          (50.0, 0.41, []), (50.0, -0.41, []), (50.0, 149.0, []), (50.0, 150.0, ["1.5 radii"]),
          (50.0, -150.0, ["1.5 radii"]))),
    # Of bounds 50 to 1500 MPa, 1.1 times less and more, and four times.
    *((doubts.pressure_unit, "pressure-unit", int(bool(words)), sure,
       [f"{force(e):.3g} N/mm", "0.04", f"{e:.3g} MPa", "E1 and E2 are 50 to 1.5e+03", *words]
       if words else [],
       {"apexes": (apex(9, 9), apex(0.03, 0.05, force=force(e)))})
      for e, sure, words in (
          (12.4, True, ["multiplied by 10 (MPa given as bar) it would be 124 MPa"]),
          (12.6, False, ["it would be 126 MPa"]), (45.4, False, ["454"]), (45.6, False, []),
          (1640.0, False, []), (1660.0, False, ["divided by 10 (bar given as MPa)", "166"]),
          (5990.0, False, ["599"]), (6010.0, True, ["601"]),
          (1e5, True, ["divided by 1000 (kPa given as MPa, or Pa as kPa)"]))),
    (doubts.pressure_unit, "pressure-unit", 1, True, ["expected kPa, at most 5000", "by 1000"],
     {"fields": (field_of(140.0, [0, 0, 30.0]),), "apexes": ()}),
    *((doubts.pressure_unit, "pressure-unit", count, True, [], {"apexes": apexes} | other)
      for apexes, count, other in (
          ((apex(0.002, 0.002, force=1e9),), 1, {}), ((), 0, {}),
          ((apex(0.001, 0.0029, force=1e9),), 0, {}), ((apex(0.1, 0.1, force=np.inf),), 0, {}),
          ((apex(0.1, 0.1, force=1e9),), 0, {"expected": Expected({})}))),
]  # fmt: skip
#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
COORDINATE_LIMITS = [
    *((doubts.camera_height, "camera-frame", count, False, [f"z = {z:.4g} mm"],
       {"fields": heights(z)}) for z, count in ((9.99, 0), (10.0, 1), (-10.0, 1), (-9.99, 0))),
    (doubts.camera_height, "camera-frame", 0, False, [], {}),
    # 3.5 mm off is much, where it is four standard errors; 1.5, where 20; 15 mm is sure.
    *((doubts.off_centre, "off-centre", int(level > 0), level == 2,
       [f"x = {x:.3g}, y = {y:.3g} mm (+- {error:.2g})"], {"rim": rim(x=x, y=y, error=error)})
      for x, y, error, level in (
          (2.0, 2.8, 0.2, 0), (2.11, 2.8, 0.2, 1), (2.11, 2.8, 0.9, 0), (9.0, 12.0, 0.1, 1),
          (9.1, 12.0, 0.1, 2), (9.1, -12.0, 4.0, 0), (0.9, 1.19, 0.01, 0), (0.9, 1.21, 0.01, 1),
          (1.6, 1.2, 0.099, 1), (1.6, 1.2, 0.101, 0))),
    (doubts.off_centre, "off-centre", 0, False, [], {"rim": None}),
    *((doubts.axes_turned, "turned", count, False,
       [f"{off:.3g} degrees from x and y (+- {error:.2g})"],
       {"axes": AXES(misalignment=off, error=error, clarity=clear), "rim": rim()})
      for off, error, clear, count in (
          (4.99, 0.1, 0.7, 0), (5.0, 0.1, 0.7, 1), (-5.0, 0.1, 0.6, 1), (5.0, 0.1, 0.59, 0),
          (12.0, 3.0, 0.7, 1), (11.9, 3.0, 0.7, 0))),
    *((doubts.axes_turned, "turned", 0, False, [], seen)
      for seen in ({"axes": AXES(misalignment=12.0), "rim": None}, {"axes": None, "rim": rim()})),
    *((doubts.axes_turned, "turned", count, False,
       [f"{angle:.3g} degrees from x (+- {error:.2g})", "not 30"],
       {"outline": ELLIPSE, "rim": rim(angle=angle, turn_error=error)})
      for angle, error, count in (
          (34.9, 0.1, 0), (35.0, 0.1, 1), (25.0, 0.1, 1), (42.0, 3.0, 1), (41.9, 3.0, 0))),
    *((doubts.yarns_swapped, "swapped", count, False, [f"{warp:.3g} along the warp"],
       {"apexes": apexes})
      for warp, count in ((0.0549, 0), (0.0551, 1))
      for apexes in ((apex(0.01, 0.02), apex(0.9, 0.9), apex(warp + 0.01, 0.07)),
                     (apex(warp, 0.05),))),
]  # fmt: skip


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), UNIT_LIMITS)
def test_limits_of_unit_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), COORDINATE_LIMITS)
def test_limits_of_coordinate_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)


@pytest.mark.parametrize(("tilt", "doubt"), [(1.19, 0), (1.21, 1), (7.99, 1), (8.01, 2)])
def test_rise_that_is_not_along_z_is_doubted(tilt, doubt):
    turn = np.radians(tilt)
    moved = 30.0 * np.array([0.6 * np.sin(turn), -0.8 * np.sin(turn), np.cos(turn)])
    # What both frames share is the first one's, and points at the clamp do not count.
    points = np.vstack([FIVE_POINTS, [[95.0, 0.0]]])
    last = np.vstack([np.tile(moved + 7.0, (5, 1)), [[500.0, 0, 0]]])
    first = np.vstack([np.tile([7.0, 7.0, 7.0], (5, 1)), [[-500.0, 0, 0]]])
    fields = (field_of(0.1, first[::-1], points[::-1]), field_of(0.2, last, points))
    for frames in (fields, (field_of(0.2, moved),), (field_of(0.2, -moved),)):
        words = f"{tilt:.2g} degrees from z"
        assert_doubted(doubts.rise_tilted, bool(doubt), "tilted", doubt == 2, words, fields=frames)
    one_side = (field_of(0.2, moved, np.abs(FIVE_POINTS) + 20.0),)
    assert_doubted(doubts.rise_tilted, bool(doubt), "tilted", doubt == 2, words, fields=one_side)
    for unknown in (field_of(0.2, [9.0, 0, 0]), field_of(0.2, [9.0, 0, 1], FIVE_POINTS[:1] + 95.0)):
        assert doubts_said(doubts.rise_tilted, fields=(unknown,)) == []


def test_strains_without_a_stiffer_yarn_are_not_doubted():
    check, plain = doubts.yarns_swapped, {"apexes": (apex(0.09, 0.05),)}
    assert len(doubts_said(check, **plain)) == 1
    for apexes in ((), (apex(0.02, 0.0),), (apex(0.02, -0.01),)):
        assert doubts_said(check, apexes=apexes) == []
    assert doubts_said(check, Expected({}), **plain) == []
    assert doubts_said(check, outline=Outline(120.0, 80.0), **plain) == []
    for low, alike in ((374.0, 1), (376.0, 0)):  # geometric means: 1.5 times 500
        bounds = Expected({"E1": (500.0, 750.0 * 1000 / 500), "E2": (low, 500_000 / 375.0)})
        assert len(doubts_said(check, bounds, **plain)) == alike
