"""Registration: a test anywhere in the camera's view comes back into its own coordinates."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble.apex import centre_strain
from bubblefit.experiments.bubble.findings import registration_numbers
from bubblefit.experiments.bubble.placement import (
    UNKNOWN,
    Placement,
    clamp_motion,
    plane_through,
    rotation_about_z,
    without_motion,
)
from bubblefit.experiments.bubble.registration import RegistrationOptions, register
from bubblefit.experiments.bubble.rim import rim_of_motion
from bubblefit.experiments.bubble.symmetry import symmetry_axes
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.readers.frames import Frame
from bubblefit.solvers.membrane.solver import MembraneSolver
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ..support.refusals import complaint

RADIUS = 100.0


def rotation(axes: str, angles) -> np.ndarray:
    return Rotation.from_euler(axes, angles, degrees=True).as_matrix()


def grid(step: float = 10.0, reach: float = 1.0) -> np.ndarray:
    line = np.arange(-reach * RADIUS, reach * RADIUS + step, step) + step / 3
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    near = np.hypot(x, y) < reach * RADIUS
    return np.stack([x[near], y[near], np.zeros(near.sum())], axis=1)


def bubble(points: np.ndarray, rise: float) -> Frame:
    """An orthotropic shape: symmetric about x and y, still on the rim and beyond."""
    x, y = points[:, :2].T / RADIUS
    on = np.clip(1 - x**2 - y**2, 0.0, None)
    square = (rise / RADIUS) ** 2
    moved = np.stack(
        [
            RADIUS * square * on * x * (0.3 + 0.1 * y**2),
            RADIUS * square * on * y * (0.5 - 0.2 * x**2),
            rise * on * (1 - 0.1 * x**2 + 0.05 * y**2 + 0.1 * x**2 * y**2),
        ],
        axis=1,
    )
    return Frame(points, moved)


def seen(frame: Frame, turn: np.ndarray, shift) -> Frame:
    return Frame(frame.points @ turn.T + np.asarray(shift), frame.displacement @ turn.T)


def noisy(frames, sigma: float, rng) -> list[Frame]:
    noise = (sigma * rng.standard_normal(f.points.shape) for f in frames)
    return [Frame(f.points, f.displacement + one) for f, one in zip(frames, noise, strict=True)]


FRAMES = [bubble(grid(), rise) for rise in (8.0, 20.0, 30.0)]
BEYOND = [bubble(grid(10.0, 1.2), rise) for rise in (8.0, 20.0, 30.0)]


@settings(max_examples=5)
@given(
    warp=st.floats(-80, 80),
    tilt=st.floats(-25, 25),
    x=st.floats(-50, 50),
    y=st.floats(-50, 50),
    z=st.floats(-700, 700),
)
def test_a_test_anywhere_comes_back(warp, tilt, x, y, z):
    turn = rotation("zx", [warp, tilt])
    moved, found = register([seen(f, turn, (x, y, z)) for f in FRAMES], (RADIUS, RADIUS))
    for ours, true in zip(moved, FRAMES, strict=True):
        # Warp and fill have no sense: a half turn is the same test.
        sense = np.sign(found.placement.axes[0] @ turn[:, 0])
        flip = np.array([sense, sense, 1.0])
        np.testing.assert_allclose(ours.points * flip, true.points, atol=0.1)
        np.testing.assert_allclose(ours.displacement * flip, true.displacement, atol=0.03)
    assert found.placement.tilt == pytest.approx(abs(tilt), abs=1e-6)
    np.testing.assert_allclose(found.placement.origin, (x, y, z), atol=0.02)
    assert found.plane_of == "edge" and found.warp is not None and found.rim is not None
    assert found.warp.error < 0.1 and found.rim.error < 0.01


def test_a_sheet_that_rises_away_from_the_camera_is_turned_not_mirrored():
    turn = rotation("x", 180.0)
    frames = [seen(f, turn, (0.0, 0.0, 500.0)) for f in FRAMES]
    moved, found = register(frames, (RADIUS, RADIUS), RegistrationOptions(warp=0.0))
    np.testing.assert_allclose(moved[-1].displacement, FRAMES[-1].displacement, atol=0.02)
    assert found.placement.tilt == pytest.approx(180.0, abs=1e-6)
    assert np.linalg.det(found.placement.axes) == pytest.approx(1.0)


def test_the_plane_goes_through_the_clamp_where_it_was_seen_and_its_motion_is_removed():
    """A sheet that bulges by 4 mm before the test does not tilt the plane; the clamp moves."""
    first = BEYOND[0].points.copy()
    x, y = first[:, :2].T / RADIUS
    first[:, 2] = np.clip(1 - x**2 - y**2, 0, None) * (4.0 + 2.0 * x)
    frames = []
    for k, frame in enumerate(BEYOND):
        after = first + frame.displacement
        moved = after @ rotation("xyz", [0.2 * k, -0.1 * k, 0.3 * k]).T + (0.5 * k, -0.2, 0.7 * k)
        frames.append(Frame(first, moved - first))
    registered, found = register(frames, (RADIUS, RADIUS))
    assert found.plane_of == "clamp" and found.placement.tilt < 1e-4
    for ours, true in zip(registered, BEYOND, strict=True):
        np.testing.assert_allclose(ours.displacement, true.displacement, atol=0.02)
    np.testing.assert_allclose(registered[0].points[:, 2], first[:, 2], atol=1e-3)
    shift = [float(np.linalg.norm(m.shift)) for m in found.motions]
    assert shift[0] == pytest.approx(0.2, abs=1e-6) and found.motions[2].points > 100
    # The vector of the turn by xyz angles of 0.4, -0.2 and 0.6 degrees.
    assert found.motions[2].angle == pytest.approx(
        np.degrees(Rotation.from_euler("xyz", [0.4, -0.2, 0.6], degrees=True).magnitude()), abs=1e-3
    )
    numbers = registration_numbers(found)
    assert numbers["plane"] == {"of": "clamp", "deviation_mm": found.flatness}
    assert numbers["centre"] == {"error_mm": found.rim.error}
    assert numbers["warp"] == {"error_degrees": found.warp.error, "clear": found.warp.clear}
    turns = [motion.angle for motion in found.motions]
    told = {"removed": True, "shift_mm": pytest.approx(shift), "turn_degrees": turns}
    assert numbers["clamp_motion"] == told
    options = RegistrationOptions(remove_clamp_motion=False)
    left, found = register(frames, (RADIUS, RADIUS), options)
    assert np.abs(left[2].displacement - BEYOND[2].displacement).max() > 1.0
    assert found.motions[2].angle > 0.5
    assert not registration_numbers(found)["clamp_motion"]["removed"]


def test_what_is_given_is_taken():
    """The marks lie along 30 degrees, beyond which the shape itself has its axes at 0."""
    marks = ((0.0, 0.0, 0.0), (np.cos(np.pi / 6), 0.5, 0.0))
    options = RegistrationOptions(plane="camera", centre=(3.0, -2.0, 0.0), warp_points=marks)
    moved, found = register(FRAMES, (RADIUS, RADIUS), options)
    assert found.warp is None and found.rim is None and found.plane_of == "camera"
    assert found.warp_angle == pytest.approx(30.0)
    said = registration_numbers(found)
    assert (said["centre"], said["warp"]) == ("given", "given")
    expected = rotation_about_z(30.0).coordinates(FRAMES[0].points - (3.0, -2.0, 0.0))
    np.testing.assert_allclose(moved[0].points, expected, atol=1e-9)
    assert "not both" in complaint(RegistrationOptions, warp=1.0, warp_points=marks)
    back = replace(options, warp_points=((1.0, 1.0, 0.0), (0.0, 2.0, 0.0)))
    assert register(FRAMES, (RADIUS, RADIUS), back)[1].warp_angle == pytest.approx(-45.0)
    one = replace(options, warp_points=(marks[0], marks[0]))
    assert "two different points" in complaint(register, FRAMES, (RADIUS, RADIUS), one)


def test_noise_shows_in_the_errors_that_are_said():
    """Over eight draws of noise, the errors said are those made, within a factor of two."""
    rng, made, said = np.random.default_rng(4), [], []
    frames = [bubble(grid(7.0), rise) for rise in (8.0, 20.0, 30.0)]
    for _ in range(8):
        found = register(noisy(frames, 0.05, rng), (RADIUS, RADIUS))[1]
        made.append((found.warp_angle, np.linalg.norm(found.placement.origin[:2])))
        said.append((found.warp.error, found.rim.error))
    ratio = np.mean(said, axis=0) / np.sqrt(np.mean(np.square(made), axis=0))
    assert ((0.5 < ratio) & (ratio < 2.0)).all(), ratio


def test_points_that_tell_too_little_ask_for_it():
    points = grid()
    on = np.clip(1 - (points[:, :2] ** 2).sum(axis=1) / RADIUS**2, 0.0, None)
    moved = np.stack([on * points[:, 0] * 0.02, on * points[:, 1] * 0.02, 10.0 * on], axis=1)
    alike = [Frame(points, moved * [1, 1, rise]) for rise in (1, 2, 3)]
    half = [Frame(f.points[f.points[:, 0] > 0], f.displacement[f.points[:, 0] > 0]) for f in FRAMES]
    noise = noisy(FRAMES, 0.3, np.random.default_rng(1))
    both = {"rim_angle": 0.0, "centre": (0, 0, 0)}
    for frames, radii, options, words in (
        (noisy(alike, 0.02, np.random.default_rng(1)), (RADIUS, RADIUS), {}, "give the angle"),
        (half, (RADIUS, RADIUS), {}, "directions only; give the centre"),
        (FRAMES, (5.0, 5.0), {}, "length unit and the radius"),
        ([Frame(points, 0 * points)], (RADIUS, RADIUS), {}, "nothing moves"),
        (FRAMES, (RADIUS, RADIUS), {"plane": "clamp"}, "too few points beyond the rim"),
        (noise, (100.0, 99.9), {"rim_angle": 0.0}, "too round to tell the warp"),
        (elliptic(0.0), (100.0, 70.0), both, "expected the warp, too"),
    ):
        assert words in complaint(register, frames, radii, RegistrationOptions(**options))


def test_an_ellipse_is_found_with_its_direction():
    points = grid()[:, :2]
    u, v = ((points - (4.0, -3.0)) @ rotation("z", 35.0)[:2, :2]).T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    rise = 20.0 * on * (1 + 0.1 * u**2)
    rim = rim_of_motion([(points[on > 0], rise[on > 0])], (100.0, 70.0), (3.0, -2.0))
    assert (rim.x, rim.y) == pytest.approx((4.0, -3.0), abs=1e-3)
    assert rim.angle == pytest.approx(35.0, abs=1e-3)


def elliptic(angle: float, reach: float = 1.0) -> list[Frame]:
    """Frames of a sheet whose edge is an ellipse (100 by 70 mm) at an angle from its x, the warp.

    Its shape follows the edge and nothing else: it has no other axes.
    """
    points = grid(7.0, reach)
    u, v = (points @ rotation("z", angle))[:, :2].T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    kept = (on > 0) | (reach > 1)
    frames = []
    for rise in (8.0, 20.0, 30.0):
        along = on * (0.1 * u + 0.05 * v)
        moved = np.stack([along, 0.1 * on * v, rise * on * (1 + 0.1 * u**2)], axis=1)
        frames.append(Frame(points[kept], moved[kept]))
    return frames


@pytest.mark.parametrize(("reach", "within"), [(1.0, 0.05), (1.25, 0.6)])
def test_the_turn_of_an_elliptic_rim_tells_the_warp(reach, within):
    """Its major axis lies 25 degrees from the warp, and the camera sees the warp at 40."""
    frames = elliptic(25.0, reach)
    turn = rotation("zx", [40.0, 5.0])
    options = RegistrationOptions(rim_angle=25.0)
    seen_frames = [seen(f, turn, (6.0, -4.0, 500.0)) for f in frames]
    moved, found = register(seen_frames, (100.0, 70.0), options)
    sense = np.sign(found.placement.axes[0] @ turn[:, 0])
    flip = np.array([sense, sense, 1.0])
    np.testing.assert_allclose(moved[-1].points * flip, frames[-1].points, atol=within)
    assert found.warp is not None and found.rim is not None and found.warp.clear is None
    assert found.plane_of == ("edge" if reach == 1.0 else "clamp")
    assert found.rim.angle == pytest.approx(25.0, abs=0.02)
    # Given: by the angle, or by two marks on the fabric.
    marks = tuple(tuple(p) for p in np.array([[0.0, 0, 0], [30, 0, 0]]) @ turn.T)
    for known in ({"warp": found.warp_angle}, {"warp_points": marks}):
        fixed = register(seen_frames, (100.0, 70.0), RegistrationOptions(rim_angle=25.0, **known))
        np.testing.assert_allclose(fixed[0][-1].points * flip, frames[-1].points, atol=within)
        assert fixed[1].warp is None


def test_placements_follow_one_another():
    a = Placement(np.array([1.0, 2.0, 3.0]), rotation("xyz", [10, 20, 30]))
    b = Placement(np.array([-4.0, 0.5, 1.0]), rotation("zyx", [50, -20, 5]))
    points = np.random.default_rng(3).normal(size=(5, 3))
    two_steps = b.coordinates(a.coordinates(points))
    np.testing.assert_allclose(b.within(a).coordinates(points), two_steps)
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-100, 100, (200, 2)), rng.normal(0, 0.05, 200)])
    points[:20, 2] += 30.0
    placement, deviation = plane_through(points @ rotation("y", 10.0).T, np.array([0, 0, 1.0]))
    assert placement.tilt == pytest.approx(10.0, abs=0.05)
    assert deviation == pytest.approx(0.05, rel=0.3)
    with pytest.raises(InputError, match="line"):
        plane_through(np.column_stack([np.arange(9.0), np.zeros((9, 2))]), np.array([0, 0, 1.0]))
    gradient = np.array([[0.02, 0.01], [0.03, -0.01], [0.1, 0.05]])
    frame, tangents = Frame(grid(), grid()[:, :2] @ gradient.T), np.eye(3)[:2] + gradient.T
    expected = 0.5 * (tangents @ tangents.T - np.eye(2))
    np.testing.assert_allclose(centre_strain(frame, RADIUS), expected, atol=1e-12)


def test_the_axes_do_not_move_with_what_is_constant_in_pressure():
    x, y = FRAMES[0].points[:, :2].T / RADIUS
    first = np.zeros_like(FRAMES[0].points)
    first[:, 2] = 2.0 * (1 - x**2 - y**2) * (x * y + 0.3 * x)
    with_it = [Frame(f.points, f.displacement + first) for f in FRAMES]
    assert symmetry_axes(with_it, RADIUS).angle % 90.0 == pytest.approx(0.0, abs=0.1)
    frame = BEYOND[-1]
    one_side = (frame.points[:, 0] > 103) & (frame.points[:, 1] > 0)
    assert clamp_motion(frame, one_side) is UNKNOWN
    still = without_motion(frame, UNKNOWN)
    np.testing.assert_allclose(still.displacement, frame.displacement, atol=1e-12)
    stiff = register(FRAMES, (RADIUS, RADIUS))[1]
    soft = register(FRAMES, (RADIUS, RADIUS), RegistrationOptions(warp_is_stiff=False))[1]
    assert stiff.warp is not None and stiff.warp_angle == pytest.approx(0.0, abs=0.2)
    assert abs(stiff.warp_angle - soft.warp_angle) == pytest.approx(90.0, abs=0.2)


@pytest.mark.parametrize(("ridge", "most"), [(0.0, 0.2), (3.0, 0.6)])
def test_the_error_of_the_axes_knows_of_a_sheet_that_is_not_symmetric(ridge, most):
    disk = disk_mesh(RADIUS, 300, "full")
    x, y = disk.points[:, :2].T / RADIUS
    across = 0.87 * y - 0.5 * x  # the ridge is 30 degrees from the warp
    height = (ridge * np.exp(-((across / 0.2) ** 2)) - 3.0) * (1 - x**2 - y**2)
    points = disk.points + np.outer(height, [0, 0, 1])
    mesh, pressures = Mesh(points, disk.quads, disk.node_sets), tuple(np.linspace(0.01, 0.25, 8))
    law = HypoelasticLaw.linear(600.0, 250.0, 15.0)
    history = MembraneSolver().run(BubbleModel(mesh, 0.81, pressures), law)
    frames = [seen(Frame(points, u), rotation("z", 8.0), np.zeros(3)) for u in history.displacement]
    axes = symmetry_axes(frames, RADIUS)
    # Angles are tried every 0.05 degrees; with the ridge the axes are 0.3 degrees off.
    assert abs(axes.angle - 8.0) < axes.error + 0.051 < most
