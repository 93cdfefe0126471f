"""experiments/bubble/field_shape.py: apex, smooth polynomials and axes of symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.field_shape import (
    RADII,
    Axes,
    SmoothField,
    apex_of,
    apex_shape,
    folded,
    harmonics,
    mirrored,
    smooth_strains,
    symmetry_axes,
    tilt_rotation,
)
from bubblefit.experiments.bubble.placement import (
    NO_MOTION,
    clamp_motion,
    line_angle,
    without_motion,
)
from bubblefit.experiments.bubble.registration import RegistrationOptions, register
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.frames import Frame
from bubblefit.solvers.membrane.solver import MembraneSolver
from hypothesis import given
from hypothesis import strategies as st

from ...builders.bubbles import THICKNESS, inflated_bubble, noisy
from ...support.refusals import complaint
from .cases import BUBBLE_FRAMES, CLAMP_RADIUS, FRAMES_BEYOND_CLAMP, rotation_by, seen_by_camera

DOME_RADIUS, DOME_PRESSURE = 80.0, 0.05
#: 1/mm, of the paraboloid along x and y; mm, its top; stretch of the sheet along x and y.
CURVED, TOP, STRETCH = (0.004, 0.006), 12.0, (1.02, 1.05)


def paraboloid_field(
    noise=0.0, seed=0, count=400, stretch=STRETCH, sign=(1, 1, 1)
) -> DisplacementField:
    draw = np.random.default_rng(seed)
    places = DOME_RADIUS * draw.uniform(-0.35, 0.35, (count, 2))
    after = places * stretch
    height = TOP - 0.5 * after**2 @ CURVED + noise * draw.standard_normal(count)
    moved = np.column_stack([after - places, height - 3.0])
    return DisplacementField(DOME_PRESSURE, places, moved * sign, z=np.full(count, 3.0))


def test_apex_of_a_paraboloid_in_closed_form():
    found = apex_of(paraboloid_field(), DOME_RADIUS)
    assert (found.pressure, found.height) == (DOME_PRESSURE, pytest.approx(TOP - 3.0))
    assert found.curvature == pytest.approx(sum(CURVED))
    assert found.force == pytest.approx(DOME_PRESSURE / sum(CURVED))  # 5 N/mm
    assert found.strain == pytest.approx(np.log(STRETCH))
    assert found.stiffness == pytest.approx(5.0 / np.mean(np.log(STRETCH)))
    assert found.error == pytest.approx(0.0, abs=1e-9)
    found = apex_of(replace(paraboloid_field(sign=(1, 1, -1)), z=None), DOME_RADIUS)
    assert found.curvature == pytest.approx(-sum(CURVED))
    assert found.force == found.error == np.inf
    still = apex_of(replace(paraboloid_field(sign=(0, 0, 1)), z=None), DOME_RADIUS)
    assert still.strain == pytest.approx((0.0, 0.0), abs=1e-12)
    assert (
        apex_of(replace(paraboloid_field(sign=(-1, -1, 1)), z=None), DOME_RADIUS).stiffness
        == np.inf
    )


def test_standard_error_of_the_apex_is_scatter_of_repetitions():
    """Compute it for a sheet that is hardly stretched, whose thinning is left out."""
    found = [
        apex_of(paraboloid_field(0.02, seed, stretch=(1.0, 1.001)), DOME_RADIUS)
        for seed in range(200)
    ]
    scatter = np.std([apex.force for apex in found])
    # 200 repetitions know a standard deviation to 5 %.
    assert np.mean([apex.error for apex in found]) == pytest.approx(scatter, rel=0.15)


def test_apex_needs_enough_points_about_the_centre():
    """Thirty: twice as many as a surface of degree four has coefficients; none beyond half way."""
    good = paraboloid_field(count=30)
    apex_of(good, DOME_RADIUS)
    for points in (good.points[1:], np.vstack([good.points[1:], [[0.5 * DOME_RADIUS, 0.0]]])):
        moved = np.zeros((len(points), 3))
        few = complaint(apex_of, DisplacementField(DOME_PRESSURE, points, moved), DOME_RADIUS)
        assert few == "expected 30 points about the centre, got 29"
    values = np.full((31, 1), 2.0)
    values[30] = np.nan
    shape = apex_shape(np.vstack([good.points, [[0.0, 0.0]]]), values, DOME_RADIUS)
    assert shape.is_fitted.tolist() == [True] * 30 + [False]
    # x^3 y / 7: its one derivative that is not zero at the centre is 6 / 7.
    x, y = good.points.T
    cubic = apex_shape(good.points, (x**3 * y / 7)[:, None], DOME_RADIUS)
    assert cubic.at_centre(3, 1) == pytest.approx([6 / 7])
    assert cubic.at_centre(1, 1) == pytest.approx([0.0], abs=1e-6)


def test_force_at_the_apex_is_that_of_the_model(clean_bubble):
    """The mean of the two membrane forces, within the little that they differ: 3 %."""
    law = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2.48)  # isotropic: both forces are the same
    last = inflated_bubble(law)[-1]
    top = apex_of(last, 100.0)
    strain = 0.5 * sum(top.strain)
    assert top.force / THICKNESS == pytest.approx(400.0 / (1 - 0.24) * strain, rel=0.03)
    assert top.height == pytest.approx(last.displacement[:, 2].max(), rel=0.01)
    noise = [apex_of(noisy(clean_bubble, s)[-1], 100.0) for s in (0.05, 0.1)]
    assert 0 < noise[0].error < 0.05 * noise[0].force
    assert noise[1].error == pytest.approx(2 * noise[0].error, rel=0.2)


POSITIONS = np.random.default_rng(3).uniform(-80.0, 80.0, (600, 2))


def cubic_field(positions):
    x, y = positions.T / 80.0
    return np.column_stack([x**3 - x * y, y**2 + 0.5 * x, 3 - x**2 * y])


def test_polynomials_of_the_degree_are_recovered():
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    places = np.array([[0.0, 0.0], [30.0, -50.0], [-70.0, 10.0]])
    fitted = field.shapes(places) @ field.amplitudes
    np.testing.assert_allclose(fitted, cubic_field(places), atol=1e-10)


def test_growth_is_the_change_from_shifted_positions():
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    shift = np.array([2.0, -1.0])
    change = cubic_field(POSITIONS) - cubic_field(POSITIONS - shift)
    np.testing.assert_allclose(field.growth(shift), change, atol=1e-10)
    np.testing.assert_allclose(field.growth(np.zeros(2)), 0.0, atol=1e-12)


@pytest.mark.parametrize("shift", [np.zeros(2), np.array([2.0, -1.0])])
def test_slopes_are_derivatives_at_shifted_positions(shift):
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    step = 1e-3
    for slope, along in zip(field.slopes(shift), step * np.eye(2), strict=True):
        ahead, behind = (cubic_field(POSITIONS - shift + s * along) for s in (1, -1))
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-6)


@pytest.mark.parametrize(("count", "terms"), [(600, 81), (100, 25), (12, 4), (5, 4)])
def test_degree_is_lower_where_there_are_few_points(count, terms):
    field = SmoothField.through(POSITIONS[:count], cubic_field(POSITIONS[:count]))
    assert field.amplitudes.shape == (terms, 3)


def test_tilt_is_a_rotation_with_exact_derivatives():
    degrees, step = np.array([1.5, -2.0]), 1e-4
    rotation, slopes = tilt_rotation(degrees)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    for slope, along in zip(slopes, step * np.eye(2), strict=True):
        ahead, behind = (tilt_rotation(degrees + s * along)[0] for s in (1, -1))
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-9)


def test_tilt_turns_about_x_then_stays_in_the_plane_of_y_and_z():
    rotation, _ = tilt_rotation(np.array([90.0, 0.0]))
    np.testing.assert_allclose(rotation @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    rotation, _ = tilt_rotation(np.array([0.0, 90.0]))
    np.testing.assert_allclose(rotation @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], atol=1e-15)


def test_strain_of_an_inclined_sheet_follows_its_yarns():
    """A plane sheet that rises along x is stretched along its warp and sheared in its plane."""
    x, y = POSITIONS.T
    along_warp = np.array([0.8, 0.0, 0.6])
    rest = np.column_stack([x, y, 0.75 * x])
    offset = np.array([1.0, 2.0, 3.0])
    stretch = 0.1 * (rest @ along_warp)[:, None] * along_warp + offset
    shear = 0.2 * y[:, None] * along_warp
    pulled, sheared = smooth_strains(POSITIONS, rest[:, 2], [stretch, shear])
    np.testing.assert_allclose(pulled, np.tile([np.log(1.1), 0, 0], (len(x), 1)), atol=1e-9)
    gradient = np.array([[1.0, 0.2], [0.0, 1.0]])
    values, axes = np.linalg.eigh(gradient.T @ gradient)
    strain = axes @ np.diag(0.5 * np.log(values)) @ axes.T
    closed_form = [strain[0, 0], strain[1, 1], 2 * strain[0, 1]]
    np.testing.assert_allclose(sheared, np.tile(closed_form, (len(x), 1)), atol=1e-9)


def test_strain_is_counted_along_a_turned_warp():
    x, y = POSITIONS.T
    pulled = 0.1 * np.column_stack([x, 0 * y, 0 * x])
    (strain,) = smooth_strains(POSITIONS, 0 * x, [pulled], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(strain, np.tile([0, np.log(1.1), 0], (len(x), 1)), atol=1e-9)


def test_harmonics_of_polynomial_fields_in_closed_form():
    """The field is (4 + 3 x + 8 x^2, 2 - 5 y, 6 x y + 4 x^3), x and y in radii."""
    points = BUBBLE_FRAMES[0].points
    x, y = points[:, :2].T / CLAMP_RADIUS
    moved = np.column_stack([4 + 3 * x + 8 * x**2, 2 - 5 * y, 6 * x * y + 4 * x**3])
    r, zero = RADII, np.zeros((2, len(RADII)))
    expected = [
        [
            [-r, 0 * r],
            [4 + 6 * r**2, 2 + 0 * r],
            [4 * r, 0 * r],
            [2 * r**2, 0 * r],
            zero,
        ],
        [zero, [2 + 0 * r, -4 - 2 * r**2], [0 * r, -4 * r], [0 * r, -2 * r**2], zero],
        [zero, [3 * r**3, 0 * r], [0 * r, 3 * r**2], [r**3, 0 * r], zero],
    ]
    found = harmonics(Frame(points, moved), CLAMP_RADIUS)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_axes_do_not_depend_on_fields_constant_in_pressure():
    x, y = BUBBLE_FRAMES[0].points[:, :2].T / CLAMP_RADIUS
    first = np.zeros_like(BUBBLE_FRAMES[0].points)
    first[:, 2] = 2.0 * (1 - x**2 - y**2) * (x * y + 0.3 * x)
    with_it = [Frame(f.points, f.displacement + first) for f in BUBBLE_FRAMES]
    assert symmetry_axes(with_it, CLAMP_RADIUS).angle % 90.0 == pytest.approx(0.0, abs=0.1)
    frame = FRAMES_BEYOND_CLAMP[-1]
    one_side = (frame.points[:, 0] > 103) & (frame.points[:, 1] > 0)
    assert clamp_motion(frame, one_side) is NO_MOTION
    still = without_motion(frame, NO_MOTION)
    np.testing.assert_allclose(still.displacement, frame.displacement, atol=1e-12)
    stiff = register(BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS))[1]
    soft = register(
        BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), RegistrationOptions(warp_is_stiff=False)
    )[1]
    assert stiff.warp is not None and stiff.warp_angle == pytest.approx(0.0, abs=0.2)
    assert abs(stiff.warp_angle - soft.warp_angle) == pytest.approx(90.0, abs=0.2)


@pytest.mark.parametrize(("ridge", "most"), [(0.0, 0.2), (3.0, 0.6)])
def test_error_of_the_axes_includes_asymmetry_of_the_sheet(ridge, most):
    disk = disk_mesh(CLAMP_RADIUS, 300, "full")
    x, y = disk.points[:, :2].T / CLAMP_RADIUS
    across = 0.87 * y - 0.5 * x  # the ridge is 30 degrees from the warp
    height = (ridge * np.exp(-((across / 0.2) ** 2)) - 3.0) * (1 - x**2 - y**2)
    points = disk.points + np.outer(height, [0, 0, 1])
    mesh, pressures = Mesh(points, disk.quads, disk.node_sets), tuple(np.linspace(0.01, 0.25, 8))
    law = HypoelasticLaw.linear(600.0, 250.0, 15.0)
    history = MembraneSolver().run(BubbleModel(mesh, 0.81, pressures), law)
    frames = [
        seen_by_camera(Frame(points, u), rotation_by("z", 8.0), np.zeros(3))
        for u in history.displacement
    ]
    axes = symmetry_axes(frames, CLAMP_RADIUS)
    # Angles are tried every 0.05 degrees; with the ridge the axes are 0.3 degrees off.
    assert abs(axes.angle - 8.0) < axes.error + 0.051 < most


@given(st.integers(-720, 720))
def test_line_and_two_axes_have_one_angle_each(degrees):
    line, axes = line_angle(degrees), Axes(degrees, 0.0, 0.0).misalignment
    assert -90 <= line < 90 and (line - degrees) % 180 == 0
    assert -45 <= axes < 45 and (axes - degrees) % 90 == 0


POINTS = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [5.0, 6.0]])
MOVED = np.array([[0, 0, 9.0], [0.1, 0, 8.0], [0, 0.2, 7.0], [0.3, 0.4, 6.0]])


def quartic_field(points: np.ndarray) -> np.ndarray:
    x, y = points.T
    height = 1.0 - 0.6 * x**2 - 0.8 * y**2
    return np.stack([0.3 * x * height, -0.2 * y * height**2, height], axis=1)


def test_folded_field_is_turned():
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 2))
    assert {tuple(s) for s in np.sign(points)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    field = folded(DisplacementField(0.1, points, quartic_field(points)))
    assert (field.points == np.abs(points)).all()
    assert field.displacement == pytest.approx(quartic_field(np.abs(points)), abs=1e-15)


def test_mirrored_quarter_is_the_whole_and_folds_back():
    points = np.random.default_rng(2).uniform(0.0, 1.0, (10, 2))
    points[0], points[1] = (0.0, 0.5), (0.4, 0.0)  # on the axes once, not twice
    whole = mirrored(DisplacementField(0.1, points, quartic_field(points)))
    assert len(whole.points) == 4 * 8 + 2 * 2
    assert whole.displacement == pytest.approx(quartic_field(whole.points), abs=1e-15)
    again = folded(whole)
    assert again.displacement == pytest.approx(quartic_field(again.points), abs=1e-15)


def test_mirrored_points_keep_height_and_sigma():
    z, sigma = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.1, 0.2, 0.3, 0.4])
    whole = mirrored(DisplacementField(0.1, POINTS, MOVED, z=z, sigma=sigma))
    assert len(whole.points) == 1 + 2 + 2 + 4
    for point, height, error in zip(whole.points, whole.z, whole.sigma, strict=True):
        (which,) = np.flatnonzero((POINTS == np.abs(point)).all(axis=1))
        assert (height, error) == (z[which], sigma[which])
    back = folded(whole)
    np.testing.assert_array_equal(back.z, whole.z)
    assert (back.points >= 0).all() and (back.displacement >= 0).all()
    # A point beside the axis by rounding is on it; a whole field is not mirrored again.
    beside = DisplacementField(0.1, POINTS - [[0, 0], [0, 0], [1e-12, 0], [0, 0]], MOVED)
    assert len(mirrored(beside).points) == 1 + 2 + 2 + 4 and mirrored(beside).z is None
    whole = DisplacementField(0.1, POINTS * (-1, 1), MOVED * (-1, 1, 1))
    assert mirrored(whole) is whole
