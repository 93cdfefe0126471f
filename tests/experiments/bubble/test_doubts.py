"""experiments/bubble/doubts.py: coordinates, units, exchanged columns, points that failed."""

from dataclasses import replace
from functools import partial
from itertools import permutations, product
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import doubts
from bubblefit.experiments.bubble.doubts import CentreMotion, doubts_of, strain_of_rise
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.experiments.bubble.registration import RegistrationOptions, register_fields
from bubblefit.experiments.doubts import Expected
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.check import expected_of
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

from ...builders.bubbles import CIRCLE, FABRIC, THICKNESS, points_on
from ...support.needs import measured_data
from ...support.paths import ROOT
from .cases import FIVE_POINTS, apex, assert_doubted, doubts_said, field_of


def motion(xx, yy, xy=0.0, yx=0.0, *, rise=30.0, error=1e-4):
    gradient = np.array([[xx, xy], [yx, yy], [0.0, 0.0]])
    return CentreMotion(np.array([0.0, 0.0, rise]), gradient, error)


#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
COLUMN_LIMITS = [
    # 2/3 (30 / 100)^2 is 0.06; ratios from 0.15 to 6 are possible, from 0.4 to 3 usual.
    *((doubts.strain_unlike_rise, name, int(bool(words)), sure, words, {"centre_motions": motions})
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
]  # fmt: skip


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), COLUMN_LIMITS)
def test_limits_of_column_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)


def test_strains_due_to_a_rise_are_those_along_the_axes_of_the_rim():
    """2/3 (30 / 120)^2 along the long semi-axis of an ellipse, 2/3 (30 / 80)^2 along the short."""
    seen = strain_of_rise(None, motion(0.02, 0.09), Outline(80.0, 120.0))
    assert seen.expected == pytest.approx((0.041667, 0.09375), rel=1e-4)
    strains = 0.02 + 0.02**2 / 2, 0.09 + 0.09**2 / 2
    assert seen.ratios == pytest.approx((strains[0] / 0.041667, strains[1] / 0.09375), rel=1e-4)
    less = strain_of_rise(motion(0.01, 0.03, rise=10.0), motion(0.02, 0.09), Outline(80.0, 120.0))
    assert less.expected == pytest.approx((8 / 9 * 0.041667, 8 / 9 * 0.09375), rel=1e-4)
    assert less.rise == (30.0, 10.0) and less.is_comparable


def test_rise_from_a_loaded_frame_bounds_the_strain_from_below_only():
    check, seen = doubts.strain_unlike_rise, {"counts_from_pressure": True}
    assert doubts_said(check, centre_motions=(motion(0.5, 0.5),), **seen) == []
    few = {"centre_motions": (motion(0.5, 0.0088),)}
    assert_doubted(check, 1, "strain-rise", True, "a rise of 30 mm", **few, **seen)
    flipped = {"centre_motions": (motion(-0.5, 0.5),)}
    assert_doubted(check, 1, "axis-flipped", True, "x and dx have", **flipped, **seen)


def test_centre_that_goes_down_is_doubted():
    down = doubts.upside_down
    assert doubts_said(down, rises=np.array([-3.0, 0.0])) == []
    assert_doubted(down, 1, "z-flipped", True, "-2.5 mm", "200 kPa", rises=np.array([3.0, -2.5]))


LAW = HypoelasticLaw.linear(700.0, 220.0, 15.0)
PRESSURES = (0.01, 0.1, 0.3)
#: mm, of every coordinate and displacement.
NOISE = 0.03
PERMUTATIONS = [
    (columns, signs) for columns in permutations(range(3)) for signs in product((1, -1), repeat=3)
]
IDENTITY = ((0, 1, 2), (1, 1, 1))
#: z of the places with the other sign: a sheet that is flat and taut is the same then, so that
#: nothing can tell and nothing is wrong. All other 47 of each triple change the experiment. Those
#: of x and y that a rotation of the sheet undoes do so only together with dx and dy.
Z_REVERSED = ((0, 1, 2), (1, 1, -1))


def bumps(points):
    """Heights (n,) mm of a first shape that is neither plane nor symmetric."""
    x, y = points.T / 100.0
    return 3.0 * (1 - x**2 - y**2) * (x * (1 - 3 * y**2) + 0.5 * y - 0.3)


def measured_sheet_fields(height, cut=-70.0):
    """Fields with noise on points of which those beyond a line are lost (mm from the centre)."""
    mesh = elliptic_disk_mesh(CIRCLE, 300, "full")
    flat = mesh.points[:, :2].copy()
    mesh.points[:, 2] = height(flat)
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, PRESSURES), LAW)
    points = points_on(CIRCLE)
    points = points[points @ (0.9, 0.3) > cut]
    random = np.random.default_rng(3)
    fields = []
    for pressure, displacement in zip(PRESSURES, history.displacement, strict=True):
        values = CloughTocher2DInterpolator(flat, displacement)(points)
        values += NOISE * random.standard_normal(values.shape)
        z = height(points) + NOISE * random.standard_normal(len(points))
        fields.append(DisplacementField(pressure, points, values, z=z))
    return tuple(fields)


@pytest.fixture(scope="module")
def two_sheets():
    return {
        "flat": measured_sheet_fields(lambda points: np.zeros(len(points))),
        "bumps": measured_sheet_fields(bumps),
    }


@pytest.fixture(scope="module")
def whole_sheet():
    return measured_sheet_fields(lambda points: np.zeros(len(points)), cut=-200.0)


def permuted(values, permutation):
    columns, signs = permutation
    return values[:, columns] * signs


def with_places(field, permutation):
    places = permuted(field.frame.points, permutation)
    return replace(field, points=places[:, :2].copy(), z=places[:, 2].copy())


def with_displacements(field, permutation):
    return replace(field, displacement=permuted(field.displacement, permutation))


def seen_by(camera, field):
    places = camera.apply(field.frame.points)
    displacement = camera.apply(field.displacement)
    return replace(
        field, points=places[:, :2].copy(), z=places[:, 2].copy(), displacement=displacement
    )


def doubts_about(fields):
    flat = np.ptp(fields[0].z) < 1.0
    return doubts_of(MeasuredView(tuple(fields), CIRCLE, THICKNESS, False, flat, expected=FABRIC))


@pytest.mark.parametrize("sheet", ["flat", "bumps"])
def test_columns_in_their_places_raise_no_doubt(two_sheets, sheet):
    assert not doubts_about(two_sheets[sheet])


def expected_name(permutation, change, sheet):
    columns, (first, second, third) = permutation
    if columns[2] != 2:
        return "exchanged"
    if change is with_displacements and third < 0:
        return "z-flipped"
    if columns[0] != 0:
        return "exchanged"
    if first < 0 or second < 0:
        return "axis-flipped"
    return "height-flipped" if third < 0 and sheet == "bumps" else None


@pytest.mark.parametrize("permutation", PERMUTATIONS, ids=str)
@pytest.mark.parametrize("sheet", ["flat", "bumps"])
@pytest.mark.parametrize("change", [with_places, with_displacements])
def test_permuted_columns_are_refused_or_doubted(two_sheets, sheet, change, permutation):
    doubts = doubts_about([change(field, permutation) for field in two_sheets[sheet]])
    name = expected_name(permutation, change, sheet)
    if name is None:
        assert permutation == IDENTITY or (permutation, change) == (Z_REVERSED, with_places)
        assert not doubts
    else:
        (doubt,) = doubts
        assert doubt.name == name and doubt.sure == (name != "height-flipped")


@pytest.mark.parametrize("permutation", PERMUTATIONS, ids=str)
def test_registration_hides_no_permutation(whole_sheet, permutation):
    """With dz alone of the other sign the sheet is its mirror image, tilted the other way."""
    camera = Rotation.from_euler("zx", (20.0, 3.0), degrees=True)
    seen = [with_displacements(seen_by(camera, field), permutation) for field in whole_sheet]
    try:
        fields, _ = register_fields(seen, CIRCLE, RegistrationOptions(warp=20.0))
    except InputError as error:
        assert error.field == "centre" and permutation[0][2] != 2
        return
    doubts = doubts_of(MeasuredView(tuple(fields), CIRCLE, THICKNESS, True, True, expected=FABRIC))
    assert bool(doubts) == (permutation != IDENTITY)
    assert any(doubt.sure for doubt in doubts) == (permutation not in (IDENTITY, Z_REVERSED))


@pytest.mark.parametrize(("number", "names"), [(1, []), (2, ["tilted", "turned"]), (3, [])])
def test_measured_bubbles_have_consistent_columns(number, names):
    """Their sheets were slack and not flat: strains are 0.96 to 1.4 times what the rises ask."""
    path = ROOT / "examples" / "bubble-valmex7318" / f"test{number}-linear.toml"
    project = read_project(path, measured_data() / "bubble")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    view = setup.tests[0].view
    assert [doubt.name for doubt in setup.tests[0].doubts(expected_of(setup))] == names
    first, last = view.centre_motions
    smaller, larger = strain_of_rise(first, last, CIRCLE).ratios
    assert 0.9 < smaller < larger < 1.5


def zeros(field, by):
    places, moved = field.points.copy(), field.displacement.copy()
    places[200:206], moved[200:206] = by * places[200:206], 0.0
    return replace(field, points=places, displacement=moved)


def zero_points(zeros, origin):
    points, moved = np.vstack([FIVE_POINTS, [[91.0, 0.0], [89.0, 0.0]]]), np.ones((7, 3))
    moved[zeros] = 0.0
    points[6] *= not origin
    return (field_of(0.2, moved, points),)


#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
POINT_LIMITS = [
    *((doubts.rejected_at_zero, "zero-points", int(bool(words)), True, words,
       {"fields": zero_points(zeros, origin)})
      for zeros, origin, words in (
          ([5], False, []), ([5, 6], False, ["1 of 6 points"]), ([], True, ["2 points lie"]),
          ([5, 6], True, ["1 of 6 points", "2 points lie at exactly x = y = 0", "200 kPa"]))),
]  # fmt: skip


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), POINT_LIMITS)
def test_limits_of_point_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)


def test_repeated_rows_are_no_zero_points():
    points = np.vstack([FIVE_POINTS, FIVE_POINTS])
    view = {"fields": (field_of(0.2, np.ones((10, 3)), points),)}
    assert_doubted(doubts.rejected_at_zero, 0, "zero-points", True, **view)
    assert_doubted(doubts.repeated_points, 1, "repeated-points", False, "5 of 10 moving", **view)


def rim(**other):
    usual = {"x": 0.0, "y": 0.0, "error": 0.1, "angle": 0.0, "turn_error": 0.1}
    return SimpleNamespace(**(usual | other))


def heights(height):
    return (field_of(0.2, [0, 0, 30.0], z=height + np.array([0, 0, 0, -50.0, 50.0])),)


def force(modulus):
    return modulus / 0.75 * 0.8 * 0.04


AXES = partial(SimpleNamespace, error=0.1, clarity=0.7)
ELLIPSE = Outline(120.0, 80.0, 30.0)


def test_slope_of_rises_over_bumps_leaves_out_planes_and_symmetric_terms():
    """The sheet's bumps of odd degree are pulled flat by a third; what else it is has no say."""
    points = points_on(CIRCLE)[::2] * [0.9, 0.7] + [3.0, -5.0]
    x, y = points.T / 100.0
    bumps = 3.0 * (x**3 - 2.0 * x * y**2 + 4.0 * x**2 * y**3)
    smooth = np.stack(
        [x**i * y**j for i, j in product(range(5), repeat=2) if i + j in (0, 1, 2, 4)]
    )
    others = np.random.default_rng(2).uniform(-5.0, 5.0, (2, len(smooth))) @ smooth
    moved = np.column_stack([0 * x, 0 * x, -bumps / 3 + others[0]])
    field = field_of(0.2, moved, points, z=bumps + others[1])
    assert doubts.slope_of_rise_over_bumps(field, CIRCLE) == pytest.approx(-1 / 3, rel=1e-9)


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


@pytest.mark.parametrize(
    ("scale", "sure"), [(0.93, True), (0.95, False), (1.05, False), (1.07, True)]
)
def test_edge_far_from_the_radius_is_a_sure_doubt(scale, sure):
    clamp = SimpleNamespace(scale=scale, still_count=9)
    view = SimpleNamespace(clamp=clamp, outline=Outline.circle(100.0))
    (doubt,) = doubts.clamped_elsewhere(view)
    assert doubt.sure is sure and f"beyond an edge of radius {100 * scale:.3g} mm" in doubt.text


@pytest.mark.parametrize(("dome", "axis"), [((8.0, 1.0, 1.5), "dx"), ((1.0, 8.0, 1.5), "dy")])
def test_dome_along_the_sheet_is_named_where_dz_has_a_fifth_of_it(dome, axis):
    def doubts_at(*motion):
        motions = [SimpleNamespace(dome=np.array(motion))]
        outline = Outline.circle(100.0)
        view = SimpleNamespace(centre_motions=motions, outline=outline, highest_pressure=90.0)
        return list(doubts.rise_exchanged(view))

    (doubt,) = doubts_at(*dome)
    assert doubt.sure and f"exchange {axis} and dz" in doubt.text
    assert doubts_at(*dome[:2], 1.7) == [] == doubts_at(0.3, 0.2, 0.0)


@pytest.mark.parametrize(("scatter", "count"), [(0.99, 0), (1.01, 1)])
def test_scatter_of_a_twentieth_of_the_rise_is_a_sure_doubt(scatter, count):
    frame = SimpleNamespace(count=0, scatter=scatter, field=SimpleNamespace(pressure=0.09))
    rises = np.array([10.0, 20.0])
    view = SimpleNamespace(fields=[None], rises=rises, gross_outliers=lambda field: frame)
    found = list(doubts.outliers(view))
    assert len(found) == count
    assert all(doubt.sure and "dz scatters by 1 mm" in doubt.text for doubt in found)
