"""experiments/bubble/doubts.py: columns exchanged or of another unit, points that failed."""

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import doubts
from bubblefit.experiments.bubble.doubts import (
    CentreMotion,
    doubts_of,
    strain_of_rise,
)
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.experiments.bubble.registration import RegistrationOptions, register_fields
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import elliptic_disk_mesh
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
from .cases import FIVE_POINTS, assert_doubted, doubts_said, field_of


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
