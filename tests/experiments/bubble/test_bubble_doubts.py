"""Traps made from one good bubble test are named; good tests of many kinds raise no doubt."""

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts, frame_doubts
from bubblefit.experiments.bubble.apex import Apex, apex_of
from bubblefit.experiments.bubble.column_consistency import CentreMotion
from bubblefit.experiments.bubble.doubts import doubts_of
from bubblefit.experiments.bubble.measured_view import View
from bubblefit.experiments.bubble.registration import (
    RegistrationOptions,
    clamp_radius,
    register_fields,
)
from bubblefit.experiments.bubble.symmetry import mirrored
from bubblefit.experiments.doubts import Expected
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import elliptic_disk_mesh
from bubblefit.meshes.outline import Outline
from bubblefit.readers.fields import DisplacementField
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

from ...support.refusals import complaint_with

CIRCLE, THICKNESS = Outline.circle(100.0), 0.81
PRESSURES = (0.02, 0.06, 0.15, 0.3)
FABRIC = Expected({"E1": (250.0, 1500.0), "E2": (50.0, 500.0), "G12": (7.0, 70.0)})
LAW = HypoelasticLaw.linear(700.0, 300.0, 15.0)


def points_on(outline):
    line = np.linspace(-1, 1, 29)[1:-1] + 0.01
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    return outline.places(points[np.hypot(*points.T) < 0.97])


def inflated(law, outline=CIRCLE, thickness=THICKNESS, pressures=PRESSURES):
    mesh = elliptic_disk_mesh(outline, 192, "quarter" if outline.round else "full")
    history = MembraneSolver().run(BubbleModel(mesh, thickness, pressures), law)
    points, fields = points_on(outline), []
    for pressure, moved in zip(pressures, history.displacement, strict=True):
        whole = DisplacementField(pressure, mesh.points[:, :2], moved)
        whole = mirrored(whole) if outline.round else whole
        at = CloughTocher2DInterpolator(whole.points, whole.displacement)(points)
        fields.append(DisplacementField(pressure, points, at, z=np.zeros(len(points))))
    return tuple(fields)


def clamped(fields, out=118.0):
    angle, radius = np.meshgrid(np.arange(0.0, 2 * np.pi, 0.1), np.arange(101.0, out, 4.0))
    ring = np.stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()], axis=1)
    z, still = np.zeros(len(ring)), np.zeros((len(ring), 3))
    return tuple(
        replace(f, points=np.vstack([f.points, ring]), z=np.append(f.z, z),
                displacement=np.vstack([f.displacement, still]))
        for f in fields
    )  # fmt: skip


@pytest.fixture(scope="module")
def good():
    return inflated(LAW)


def names(fields, expected=FABRIC, outline=CIRCLE, thickness=THICKNESS):
    found = doubts_of(View(tuple(fields), outline, thickness, False), expected)
    return {doubt.name: doubt for doubt in found}


@pytest.mark.parametrize("angle", [0.0, 90.0, 30.0])
def test_an_elliptic_sheet_raises_no_doubt_where_it_is_said_to_lie(angle):
    outline, off = (Outline(120.0, 80.0, a) for a in (angle, angle - 12.0))
    fields = noisy(inflated(LAW, outline), 0.02)
    assert not names(fields, outline=outline)
    (turned,) = names(fields, outline=off).values()
    assert turned.name == "turned" and f"not {off.angle:.3g}:" in turned.text
    assert f"{angle:.3g} degrees from x" in turned.text or angle in (0.0, 90.0)
    assert [*names(columns(1 / 25.4)(fields), outline=outline)] == ["length-unit"]


def each(change, *args):
    return lambda fields: tuple(change(field, *args) for field in fields)


def pressed(field, by):
    return replace(field, pressure=field.pressure * by)


def zeros(field, by):
    places, moved = field.points.copy(), field.displacement.copy()
    places[200:206], moved[200:206] = by * places[200:206], 0.0
    return replace(field, points=places, displacement=moved)


def swap(field):
    moved = field.displacement[:, [1, 0, 2]]
    return replace(field, points=field.points[:, ::-1].copy(), displacement=moved)


def deformed(field, z):
    places, height = field.points + field.displacement[:, :2], field.displacement[:, 2]
    return replace(field, points=places, z=height if z else None)


def exchanged(fields):
    first, two, three, last = fields
    return first, replace(three, pressure=two.pressure), replace(two, pressure=three.pressure), last


def columns(points: float = 1.0, moved=(1.0, 1.0, 1.0)):
    return each(lambda f: replace(f, points=f.points * points, displacement=f.displacement * moved))


def in_camera(turn: Rotation, shift=(0.0, 0.0, 0.0)):
    def seen(field):
        places = turn.apply(np.column_stack([field.points, np.zeros(len(field.points))])) + shift
        moved = turn.apply(field.displacement)
        return replace(field, points=places[:, :2], z=places[:, 2], displacement=moved)

    return each(seen)


TURN = partial(Rotation.from_euler, degrees=True)
#: Doubts that tests of their own provoke, and whether they are errors.
OF_OWN_TESTS = {
    "frame-numbers": False,
    "outliers": False,
    "radius": True,
    "flat-sheet": False,
    "height-flipped": False,
}
TRAPS = {
    "places in m": (columns(0.001), "length-unit", True, "radii from the centre"),
    "displacements in m": (columns(1.0, (0.001,) * 3), "length-unit", True, "mm beside m"),
    "bar read as kPa": (each(pressed, 0.01), "pressure-unit", True, "kPa"),
    "kPa read as bar": (each(pressed, 100), "pressure-unit", True, "bar"),
    "z flipped": (columns(1.0, (1.0, 1.0, -1.0)), "z-flipped", True, "z is flipped"),
    "y flipped in places only": (columns((1.0, -1.0)), "axis-flipped", True, "y and dy"),
    "x flipped in displacements only": (
        columns(1.0, (-1.0, 1.0, 1.0)), "axis-flipped", True, "x and dx",
    ),
    "x and y exchanged in places only": (
        each(lambda f: replace(f, points=f.points[:, ::-1].copy())), "exchanged", True,
        "calls for about 0.054: dx and dy are exchanged",
    ),
    "dx and dy in cm": (columns(1.0, (0.1, 0.1, 1.0)), "strain-rise", True, "in one unit"),
    "warp and fill swapped": (each(swap), "swapped", False, "swapped"),
    "deformed coordinates": (each(deformed, True), "deformed-coordinates", True, "height z"),
    "deformed coordinates without z": (
        each(deformed, False), "deformed-coordinates", True, "from frame to frame",
    ),
    "rejected points do not move": (each(zeros, 1.0), "zero-points", True, "5 of 500 points"),
    "rejected points at the origin": (each(zeros, 0.0), "zero-points", True, "x = y = 0"),
    "a frame repeated": (
        lambda f: (*f[:2], replace(f[1], pressure=f[2].pressure), f[3]), "repeated-frame", True,
        "60 and 150 kPa",
    ),
    "frames out of order": (exchanged, "frame-order", True, "between 60 and 150 kPa"),
    "turned by 12 degrees": (in_camera(TURN("z", 12.0)), "turned", False, "degrees from x"),
    "tilted by 3 degrees": (in_camera(TURN("x", 3.0)), "tilted", False, "3 degrees from z"),
    "5 mm off the centre": (
        in_camera(TURN("z", 0.0), (3.0, 4.0, 0.0)), "off-centre", False, "x = 3, y = 3.99 mm",
    ),
    "in the camera's heights": (
        in_camera(TURN("z", 0.0), (0.0, 0.0, 600.0)), "camera-frame", False, "z = 600",
    ),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_named_and_raises_no_other_sure_doubt(good, trap):
    change, name, sure, words = TRAPS[trap]
    found = names(change(good))
    assert found[name].sure == sure and words in found[name].text, found
    assert {doubt.name for doubt in found.values() if doubt.sure} <= {name}


GOOD = {
    "soft in shear": (HypoelasticLaw.linear(700.0, 300.0, 3.0), {}),
    "stiff": (HypoelasticLaw.linear(1400.0, 450.0, 60.0), {}),
    "balanced": (HypoelasticLaw.linear(400.0, 400.0, 20.0), {}),
    "fill a little stiffer": (HypoelasticLaw.linear(380.0, 420.0, 20.0), {}),
    "small": (LAW, {"outline": Outline.circle(30.0), "pressures": (0.05, 0.2, 0.6)}),
    "large": (LAW, {"outline": Outline.circle(400.0), "pressures": (0.005, 0.02, 0.08)}),
    "thin": (LAW, {"thickness": 0.2, "pressures": (0.005, 0.02, 0.07)}),
    "low pressures": (LAW, {"pressures": (0.004, 0.01, 0.02)}),
    "one pressure": (LAW, {"pressures": (0.2,)}),
}


def noisy(fields, size):
    rng = np.random.default_rng(7)
    noise = [size * rng.standard_normal(f.displacement.shape) for f in fields]
    every = zip(fields, noise, strict=True)
    return tuple(replace(f, displacement=f.displacement + n) for f, n in every)


@pytest.mark.parametrize("kind", GOOD)
def test_good_tests_raise_no_doubt(kind):
    law, other = GOOD[kind]
    fields = noisy(inflated(law, **other), 0.02)
    assert not names(fields, **{k: v for k, v in other.items() if k != "pressures"})


def test_the_good_test_raises_no_doubt(good):
    half = [
        replace(f, points=f.points[::2], displacement=f.displacement[::2], z=None) for f in good
    ]
    x, y = good[-1].points.T
    seen = (np.hypot(x, y) < 60.0) | (y < 0.0)  # the rim is lost on one side as it rises
    lost = replace(good[-1], points=good[-1].points[seen], z=None,
                   displacement=good[-1].displacement[seen])  # fmt: skip
    one_sided = [*good[:-1], lost]
    for fields in (good, half, one_sided, noisy(good, 0.05), [replace(f, z=None) for f in good]):
        assert not names(fields)


def test_equilibrium_of_the_apex_gives_the_stress_of_the_model(good):
    """The mean of the two membrane forces, within the little that they differ: 3 %."""
    law = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2.48)  # isotropic: both forces are the same
    last = inflated(law)[-1]
    top = apex_of(last, 100.0)
    strain = 0.5 * sum(top.strain)
    assert top.force / THICKNESS == pytest.approx(400.0 / (1 - 0.24) * strain, rel=0.03)
    assert top.height == pytest.approx(last.displacement[:, 2].max(), rel=0.01)
    noise = [apex_of(noisy(good, s)[-1], 100.0) for s in (0.05, 0.1)]
    assert 0 < noise[0].error < 0.05 * noise[0].force
    assert noise[1].error == pytest.approx(2 * noise[0].error, rel=0.2)


POINTS = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 20.0], [-30.0, 0.0], [0.0, -40.0]])


def field(pressure, moved, points=POINTS, z=None):
    moved = np.broadcast_to(np.asarray(moved, dtype=float), (len(points), 3))
    return DisplacementField(pressure, np.asarray(points, dtype=float), moved, z=z)


def said(check, expected=FABRIC, **seen):
    whole = View(seen.pop("fields", (field(0.2, [0, 0, 30.0]),)), CIRCLE, 0.8, False)
    names = "outline highest_pressure last fields thickness registered inner rises flat mean_motion"
    if len(seen.get("centre_motions", ())) > 1:
        seen["fields"] = whole.fields * 2
    of_view = {name: getattr(whole, name) for name in names.split()}
    view = SimpleNamespace(clamp=None, **(of_view | seen))
    return [(doubt.name, doubt.sure, doubt.text) for doubt in check(view, expected)]


def finds(check, count, name, sure, *words, **seen):
    found = said(check, **seen)
    assert [one[:2] for one in found] == [(name, sure)] * count
    assert all(word in one[2] for one in found for word in words), found


def apex(*strain, force=20.0):
    return Apex(0.2, 30.0, 0.01, force, 0.1, strain)


def motion(xx, yy, xy=0.0, yx=0.0, *, rise=30.0, error=1e-4):
    gradient = np.array([[xx, xy], [yx, yy], [0.0, 0.0]])
    return CentreMotion(np.array([0.0, 0.0, rise]), gradient, error)


def rim(**other):
    usual = {"x": 0.0, "y": 0.0, "error": 0.1, "angle": 0.0, "turn_error": 0.1}
    return SimpleNamespace(**(usual | other))


def zero_points(zeros, origin):
    points, moved = np.vstack([POINTS, [[91.0, 0.0], [89.0, 0.0]]]), np.ones((7, 3))
    moved[zeros] = 0.0
    points[6] *= not origin
    return (field(0.2, moved, points),)


def heights(height):
    return (field(0.2, [0, 0, 30.0], z=height + np.array([0, 0, 0, -50.0, 50.0])),)


def force(modulus):
    return modulus / 0.75 * 0.8 * 0.04


AXES = partial(SimpleNamespace, error=0.1, clear=0.7)
ELLIPSE = Outline(120.0, 80.0, 30.0)
#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
LIMITS = [
    *((doubts.length_unit, "length-unit", int(bool(words)), True, words,
       {"fields": (field(0.2, [0, 0, 30.0], [[0.0, 0.0], [far, 0.0]]),),
        "rises": np.array([0.0, rise])})
      for far, rise, words in (
          (10.0, 30.0, ["0.1 radii", "x and y"]), (10.1, 30.0, []), (1999.0, 30.0, []),
          (2000.0, 30.0, ["20 radii"]), (50.0, 0.4, ["0.004 radii at 200 kPa", "displacements"]),
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
     {"fields": (field(140.0, [0, 0, 30.0]),), "apexes": ()}),
    *((doubts.pressure_unit, "pressure-unit", count, True, [], {"apexes": apexes} | other)
      for apexes, count, other in (
          ((apex(0.002, 0.002, force=1e9),), 1, {}), ((), 0, {}),
          ((apex(0.001, 0.0029, force=1e9),), 0, {}), ((apex(0.1, 0.1, force=np.inf),), 0, {}),
          ((apex(0.1, 0.1, force=1e9),), 0, {"expected": Expected({})}))),
    *((doubts.rejected_at_zero, "zero-points", int(bool(words)), True, words,
       {"fields": zero_points(zeros, origin)})
      for zeros, origin, words in (
          ([5], False, []), ([5, 6], False, ["1 of 6 points"]), ([], True, ["2 points lie"]),
          ([5, 6], True, ["1 of 6 points", "2 points lie at exactly x = y = 0", "200 kPa"]))),
    # 2/3 (30 / 100)^2 is 0.06; ratios from 0.15 to 6 are possible, from 0.4 to 3 usual.
    *((doubts.strain_and_rise, name, int(bool(words)), sure, words, {"centre_motions": motions})
      for motions, name, sure, words in (
          ((None, None), "", True, []),
          ((motion(0.05, 0.07),), "", True, []), ((motion(0.05, 0.0239),), "", True, []),
          ((motion(0.05, 0.0236),), "strain-rise", False, ["about 0.06: are dx, dy and dz"]),
          ((motion(0.05, 0.0088),), "strain-rise", True, ["a rise of 30 mm calls for"]),
          ((motion(0.05, 0.0088, error=0.016),), "", True, []),
          ((motion(0.165, 0.05),), "", True, []),
          ((motion(0.168, 0.05),), "strain-rise", False, ["0.18"]),
          ((motion(0.35, 0.05),), "strain-rise", True, ["0.41"]),
          ((motion(-0.05, 0.07),), "axis-flipped", True, ["x and dx have"]),
          ((motion(0.05, -0.07),), "axis-flipped", True, ["y and dy have"]),
          ((motion(-0.05, -0.07),), "axis-flipped", True, ["x and dx have", "y and dy have"]),
          ((motion(0, 0, 0.07, 0.05),), "exchanged", True, ["take dy for dx and dx for dy"]),
          ((motion(0, 0, 0.07, -0.05),), "exchanged", True, ["minus dy for dx and dx for dy"]),
          ((motion(0, 0, -0.07, 0.05),), "exchanged", True, ["take dy for dx and minus dx for dy"]),
          # What a slack sheet lacks is in both frames; a frame nearly as high cancels nothing.
          ((motion(-0.02, -0.01, rise=20.0), motion(0.01, 0.02)), "", True, []),
          ((motion(0.0, 0.0, rise=20.0), motion(0.0, 0.0)), "strain-rise", True,
           ["from 20 to 30 mm", "about 0.033"]),
          ((motion(0.045, 0.045, rise=25.0), motion(0.06, 0.06)), "", True, []))),
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
       {"axes": AXES(off=off, error=error, clear=clear), "rim": rim()})
      for off, error, clear, count in (
          (4.99, 0.1, 0.7, 0), (5.0, 0.1, 0.7, 1), (-5.0, 0.1, 0.6, 1), (5.0, 0.1, 0.59, 0),
          (12.0, 3.0, 0.7, 1), (11.9, 3.0, 0.7, 0))),
    *((doubts.axes_turned, "turned", 0, False, [], seen)
      for seen in ({"axes": AXES(off=12.0), "rim": None}, {"axes": None, "rim": rim()})),
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


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), LIMITS)
def test_where_a_check_begins_to_speak(check, name, count, sure, words, seen):
    finds(check, count, name, sure, *words, **seen)


def test_a_centre_that_goes_down_or_sinks_between_two_frames():
    down = doubts.upside_down
    assert said(down, rises=np.array([-3.0, 0.0])) == []
    finds(down, 1, "z-flipped", True, "-2.5 mm", "200 kPa", rises=np.array([3.0, -2.5]))
    fields = tuple(field(p, [0, 0, 1.0]) for p in (0.01, 0.02, 0.03, 0.04))
    for rises, words in (
        ([10.0, 9.01, 50.0, 40.0], ["from 50 to 40 mm", "30 and 40 kPa"]),
        ([10.0, 8.99, 50.0, 50.0], ["from 10 to 8.99 mm between 10 and 20 kPa:"]),
    ):
        seen = {"fields": fields, "rises": np.array(rises)}
        finds(doubts.frame_order, 1, "frame-order", True, *words, **seen)
    assert said(doubts.frame_order, fields=fields, rises=np.array([10.0, 9.0, 50.0, 49.0])) == []


def test_a_frame_given_twice():
    moved = [field(p, [0, 0, 5.0]) for p in (0.01, 0.02)]
    other = [field(p, [0, 0, 6.0]) for p in (0.03, 0.04)]
    still = [field(p, 0.0) for p in (0.001, 0.002)]
    for fields, words in (((*still, *moved), "10 and 20 kPa"), ((*moved, *other), "1 more pairs")):
        finds(doubts.repeated_frame, 1, "repeated-frame", True, words, fields=fields)
    for rise, count in ((5.0, 1), (5.06, 1), (5.08, 0), (6.0, 0)):  # 0.1 of 0.2 ln(2) is 0.07 of 5
        high = field(0.02, [0, 0, rise], POINTS[:4])
        words = ["5 mm at 10 kPa", f"{rise:.4g} mm at 20 kPa", "about 0.74 mm"]
        finds(doubts.same_states, count, "repeated-frame", True, *words, fields=(moved[0], high))


UP = np.array([1.0, 4.0, 9.0, 2.0, 7.0])


@pytest.mark.parametrize(("share", "doubt"), [(0.49, 0), (0.51, 1), (1.0, 1), (-1.0, 0)])
def test_places_and_heights_that_follow_the_motion(share, doubt):
    check, name = doubts.deformed_coordinates, "deformed-coordinates"
    one = field(0.2, np.outer(UP, [0, 0, 1.0]), z=share * UP + 600.0)
    finds(check, doubt, name, True, f"z follows dz by {share:.0%}", fields=(one,))
    assert said(check, fields=(one,), registered=True) == []
    moved = np.column_stack([UP, -UP, 0 * UP])
    low, high = field(0.1, 2 * moved), field(0.2, 3 * moved, POINTS + share * moved[:, :2])
    fields = (field(0.05, [0, 0, 1.0], POINTS[:3]), low, high)
    finds(check, doubt, name, True, f"{share:.0%} of dx and dy", fields=fields)


def test_places_that_are_only_a_little_like_the_motion():
    """A correlation of 0.9 is alike, a smaller one is chance."""
    moved = np.array([[3.0], [-3.0], [0.0], [0.0]])
    for across, alike in ((1.45, 1.0), (1.46, 0.0)):  # 1 / sqrt(1 + (1.45 / 3)^2) = 0.9003
        assert (
            frame_doubts._followed_share(np.array([[3.0], [-3.0], [across], [-across]]), moved)
            == alike
        )
    assert frame_doubts._followed_share(moved, 0 * moved) == 0.0


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
        finds(doubts.rise_tilted, bool(doubt), "tilted", doubt == 2, words, fields=frames)
    one_side = (field(0.2, moved, np.abs(POINTS) + 20.0),)
    finds(doubts.rise_tilted, bool(doubt), "tilted", doubt == 2, words, fields=one_side)
    for unknown in (field(0.2, [9.0, 0, 0]), field(0.2, [9.0, 0, 1], POINTS[:1] + 95.0)):
        assert said(doubts.rise_tilted, fields=(unknown,)) == []


def test_strains_that_say_nothing_of_warp_and_fill():
    check, plain = doubts.yarns_swapped, {"apexes": (apex(0.09, 0.05),)}
    assert len(said(check, **plain)) == 1
    for apexes in ((), (apex(0.02, 0.0),), (apex(0.02, -0.01),)):
        assert said(check, apexes=apexes) == []
    assert said(check, Expected({}), **plain) == []
    assert said(check, outline=Outline(120.0, 80.0), **plain) == []
    for low, alike in ((374.0, 1), (376.0, 0)):  # geometric means: 1.5 times 500
        bounds = Expected({"E1": (500.0, 750.0 * 1000 / 500), "E2": (low, 500_000 / 375.0)})
        assert len(said(check, bounds, **plain)) == alike


def test_rises_of_a_view_are_those_about_the_centre():
    moved = np.outer([10.0, 12.0, 14.0, 1.0, 2.0], [0, 0, 1.0])
    view = View((field(0.1, moved),), CIRCLE, 0.8, False)
    assert view.rises.tolist() == [12.0]  # those within 25 mm
    far = View((field(0.1, moved[:4], POINTS[1:] * 3.0),), CIRCLE, 0.8, False)
    assert far.rises.tolist() == [11.0]  # no point there: of all
    assert view.apexes == () and view.rim is None and view.axes is None
    assert view.inner(field(0.1, moved, POINTS * 2.25)).tolist() == [True] * 4 + [False]


@pytest.mark.parametrize(
    ("radius", "sure"), [(85.0, True), (96.0, False), (100.0, None), (104.0, False), (110.0, True)]
)
@pytest.mark.parametrize("off", [0.0, 2.0])
def test_the_edge_of_a_clamp_that_stands_still(good, radius, sure, off):
    """Its own circle is found within 1 mm of 100, its centre within 0.1."""
    fields = in_camera(TURN("z", 0.0), (off, 0.0, 0.0))(noisy(clamped(good), 0.02))
    view = View(fields, Outline.circle(radius), THICKNESS, False)
    assert view.clamp.scale * radius == pytest.approx(100.0, abs=1.0)
    assert (view.clamp.x, view.clamp.y) == pytest.approx((off, 0.0), abs=0.1)
    found = names(fields, outline=Outline.circle(radius))
    assert found["radius"].sure == sure if sure is not None else "radius" not in found
    if sure is not None:
        assert f"says radius {radius:.3g} mm" in found["radius"].text
    if not sure:
        assert ("off-centre" in found) == (off > 0)


@pytest.mark.parametrize("off", [0.0, 2.0])
def test_the_radius_of_the_clamp_needs_no_first_guess(good, off):
    """Within 0.3 % of the true one, which changes moduli by some 1 %; in camera coordinates too."""
    fields = noisy(clamped(good), 0.02)
    radius, edge = clamp_radius(in_camera(TURN("z", 0.0), (off, 0.0, 0.0))(fields))
    assert radius == pytest.approx(100.0, rel=3e-3) and edge.still > 200
    seen = in_camera(TURN("x", 12.0), (30.0, 20.0, 500.0))(fields)
    assert clamp_radius(seen, RegistrationOptions())[0] == pytest.approx(radius, rel=1e-4)
    # Points of the clamp just beyond the rim, on one side, do not draw its centre there.
    near = np.hypot(*fields[0].points.T) > 100.0
    kept = ~near | (fields[0].points[:, 1] < 0.0) | (np.hypot(*fields[0].points.T) > 102.0)
    some = tuple(
        replace(f, points=f.points[kept], z=f.z[kept], displacement=f.displacement[kept])
        for f in fields
    )
    seen = in_camera(TURN("z", 0.0), (3.0, -4.0, 600.0))(some)
    _, found = register_fields(seen, CIRCLE, RegistrationOptions())
    assert np.abs(found.rim.error) < 0.05
    assert found.placement.origin[:2] == pytest.approx((3.0, -4.0), abs=0.1)
    complaint_with(["radius", "stand still"], clamp_radius, good)


@pytest.mark.parametrize(("off", "doubt"), [(1.0, False), (2.0, True)])
def test_a_sheet_a_little_off_the_centre_without_its_clamp(good, off, doubt):
    fields = noisy(in_camera(TURN("z", 0.0), (0.0, off, 0.0))(good), 0.02)
    assert [*names(fields)] == ["off-centre"] * doubt


def test_a_state_recorded_twice(good):
    """Alike but for the noise, which may let the centre sink a little."""
    for seed in range(3):
        again = noisy(good, 0.02 + 0.01 * seed)[1]
        fields = (*good[:2], replace(again, pressure=good[2].pressure), good[3])
        (doubt,) = names(fields).values()
        assert (doubt.name, doubt.sure) == ("repeated-frame", True)
        assert "60 kPa" in doubt.text and "150 kPa" in doubt.text


@pytest.mark.parametrize(("share", "size"), [(0.0, 0.0), (0.02, 5.0), (0.02, 40.0), (0.002, 5.0)])
def test_gross_outliers(good, share, size):
    rng, fields = np.random.default_rng(3), noisy(good, 0.03)
    count = round(share * len(good[0].points))
    for field in fields:
        some = rng.choice(np.flatnonzero(np.hypot(*field.points.T) < 90), count, replace=False)
        field.displacement[some, 2] += size * rng.choice([-1.0, 1.0], count)
    found = names(fields)
    assert [*found] == ["outliers"] * (count > 0)
    if count:
        assert f"{count} of " in found["outliers"].text and not found["outliers"].sure
        most = re.search(r"up to (\S+) mm", found["outliers"].text)[1]
        assert float(most) == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize(("height", "doubt"), [(0.0, False), (0.5, False), (4.0, True)])
def test_measured_heights_that_are_taken_for_flat(good, height, doubt):
    """A dome on a sheet that is tilted and far from the camera's zero: the plane is no shape."""
    z = height * (1 - (good[0].points ** 2).sum(axis=1) / 1e4) + 0.01 * good[0].points[:, 0]
    fields = each(lambda f: replace(f, z=z))(noisy(good, 0.02))
    for flat in (True, False):
        found = doubts_of(View(fields, CIRCLE, THICKNESS, False, flat), FABRIC)
        assert [one.name for one in found] == ["flat-sheet"] * (doubt and flat)


@pytest.mark.parametrize("after", [False, True])
def test_frames_that_lost_parts_of_the_rim_are_compared_by_places(good, after):
    """Two with equally many points, of which row by row few are the same."""
    angle = np.arctan2(*good[0].points.T[::-1])
    rim = np.hypot(*good[0].points.T) > 70
    high, low = (np.flatnonzero(rim & (sign * angle > 0.6))[:90] for sign in (1, -1))
    every = np.arange(len(rim))
    kept = [every, *(np.setdiff1d(every, own) for own in (high, low, high))]
    fields = [
        replace(f, points=f.points[own], displacement=f.displacement[own], z=None)
        for f, own in zip(noisy(good, 0.01), kept, strict=True)
    ]
    assert len(fields[2].points) == len(fields[3].points) < 0.9 * len(rim)
    found = names(each(deformed, False)(fields) if after else fields)
    assert ("deformed-coordinates" in found) == after
    assert not after or "100% of dx and dy" in found["deformed-coordinates"].text


def test_bar_given_as_mpa_in_python_is_a_doubt_with_its_factor(good):
    """Within the bounds of coated fabrics by less than four times, and no pressure is absurd."""
    points = [field.frame.points for field in good]
    displacements = [field.displacement for field in good]
    pressures = [10 * field.pressure for field in good]
    bubble = bf.Bubble(points, displacements, pressures, radius=100.0)
    project = bf.Project.of([bubble], bf.Law("constant"), fabric=bf.Fabric("made", THICKNESS))
    (judgement,) = bf.check(project).judgements
    (doubt,) = [doubt for doubt in judgement.doubts if doubt.name == "pressure-unit"]
    assert not doubt.sure and "divided by 10 (bar given as MPa)" in doubt.text
