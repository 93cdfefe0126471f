"""experiments/bubble/symmetry.py: axes of symmetry, folding and mirroring of fields."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.placement import (
    NO_MOTION,
    clamp_motion,
    line_angle,
    without_motion,
)
from bubblefit.experiments.bubble.registration import RegistrationOptions, register
from bubblefit.experiments.bubble.symmetry import Axes, folded, mirrored, symmetry_axes
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.frames import Frame
from bubblefit.solvers.membrane.solver import MembraneSolver
from hypothesis import given
from hypothesis import strategies as st

from .cases import BUBBLE_FRAMES, CLAMP_RADIUS, FRAMES_BEYOND_CLAMP, rotation_by, seen_by_camera


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
