"""experiments/bubble/registration.py: a test anywhere in view comes into its coordinates."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.findings import registration_numbers
from bubblefit.experiments.bubble.placement import rotation_about_z
from bubblefit.experiments.bubble.registration import RegistrationOptions, register
from bubblefit.readers.frames import Frame
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ...support.refusals import complaint
from .cases import (
    BUBBLE_FRAMES,
    CLAMP_RADIUS,
    FRAMES_BEYOND_CLAMP,
    camera_grid,
    elliptic_frames,
    noisy_frames,
    orthotropic_shape,
    rotation_by,
    seen_by_camera,
)


@settings(max_examples=5)
@given(
    warp=st.floats(-80, 80),
    tilt=st.floats(-25, 25),
    x=st.floats(-50, 50),
    y=st.floats(-50, 50),
    z=st.floats(-700, 700),
)
def test_test_anywhere_in_view_is_registered(warp, tilt, x, y, z):
    turn = rotation_by("zx", [warp, tilt])
    moved, found = register(
        [seen_by_camera(f, turn, (x, y, z)) for f in BUBBLE_FRAMES], (CLAMP_RADIUS, CLAMP_RADIUS)
    )
    for ours, true in zip(moved, BUBBLE_FRAMES, strict=True):
        # Warp and fill have no sense: a half turn is the same test.
        sense = np.sign(found.placement.axes[0] @ turn[:, 0])
        flip = np.array([sense, sense, 1.0])
        np.testing.assert_allclose(ours.points * flip, true.points, atol=0.1)
        np.testing.assert_allclose(ours.displacement * flip, true.displacement, atol=0.03)
    assert found.placement.tilt == pytest.approx(abs(tilt), abs=1e-6)
    np.testing.assert_allclose(found.placement.origin, (x, y, z), atol=0.02)
    assert found.plane_of == "edge" and found.warp is not None and found.rim is not None
    assert found.warp.error < 0.1 and found.rim.error < 0.01


def test_sheet_rising_away_from_the_camera_is_turned_not_mirrored():
    turn = rotation_by("x", 180.0)
    frames = [seen_by_camera(f, turn, (0.0, 0.0, 500.0)) for f in BUBBLE_FRAMES]
    moved, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS), RegistrationOptions(warp=0.0))
    np.testing.assert_allclose(moved[-1].displacement, BUBBLE_FRAMES[-1].displacement, atol=0.02)
    assert found.placement.tilt == pytest.approx(180.0, abs=1e-6)
    assert np.linalg.det(found.placement.axes) == pytest.approx(1.0)


def test_plane_is_that_of_the_clamp_and_its_motion_is_removed():
    """A sheet that bulges by 4 mm before the test does not tilt the plane; the clamp moves."""
    first = FRAMES_BEYOND_CLAMP[0].points.copy()
    x, y = first[:, :2].T / CLAMP_RADIUS
    first[:, 2] = np.clip(1 - x**2 - y**2, 0, None) * (4.0 + 2.0 * x)
    frames = []
    for k, frame in enumerate(FRAMES_BEYOND_CLAMP):
        after = first + frame.displacement
        moved = after @ rotation_by("xyz", [0.2 * k, -0.1 * k, 0.3 * k]).T + (
            0.5 * k,
            -0.2,
            0.7 * k,
        )
        frames.append(Frame(first, moved - first))
    registered, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS))
    assert found.plane_of == "clamp" and found.placement.tilt < 1e-4
    for ours, true in zip(registered, FRAMES_BEYOND_CLAMP, strict=True):
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
    left, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    assert np.abs(left[2].displacement - FRAMES_BEYOND_CLAMP[2].displacement).max() > 1.0
    assert found.motions[2].angle > 0.5
    assert not registration_numbers(found)["clamp_motion"]["removed"]


def test_given_plane_centre_and_axes_are_taken():
    """The marks lie along 30 degrees, beyond which the shape itself has its axes at 0."""
    marks = ((0.0, 0.0, 0.0), (np.cos(np.pi / 6), 0.5, 0.0))
    options = RegistrationOptions(plane="camera", centre=(3.0, -2.0, 0.0), warp_points=marks)
    moved, found = register(BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    assert found.warp is None and found.rim is None and found.plane_of == "camera"
    assert found.warp_angle == pytest.approx(30.0)
    said = registration_numbers(found)
    assert (said["centre"], said["warp"]) == ("given", "given")
    expected = rotation_about_z(30.0).coordinates(BUBBLE_FRAMES[0].points - (3.0, -2.0, 0.0))
    np.testing.assert_allclose(moved[0].points, expected, atol=1e-9)
    assert "not both" in complaint(RegistrationOptions, warp=1.0, warp_points=marks)
    back = replace(options, warp_points=((1.0, 1.0, 0.0), (0.0, 2.0, 0.0)))
    assert register(BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), back)[
        1
    ].warp_angle == pytest.approx(-45.0)
    one = replace(options, warp_points=(marks[0], marks[0]))
    assert "two different points" in complaint(
        register, BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), one
    )


def test_registration_errors_reflect_noise():
    """Over eight draws of noise, the errors said are those made, within a factor of two."""
    rng, made, said = np.random.default_rng(4), [], []
    frames = [orthotropic_shape(camera_grid(7.0), rise) for rise in (8.0, 20.0, 30.0)]
    for _ in range(8):
        found = register(noisy_frames(frames, 0.05, rng), (CLAMP_RADIUS, CLAMP_RADIUS))[1]
        made.append((found.warp_angle, np.linalg.norm(found.placement.origin[:2])))
        said.append((found.warp.error, found.rim.error))
    ratio = np.mean(said, axis=0) / np.sqrt(np.mean(np.square(made), axis=0))
    assert ((0.5 < ratio) & (ratio < 2.0)).all(), ratio


def test_undetermined_registration_asks_for_input():
    points = camera_grid()
    on = np.clip(1 - (points[:, :2] ** 2).sum(axis=1) / CLAMP_RADIUS**2, 0.0, None)
    moved = np.stack([on * points[:, 0] * 0.02, on * points[:, 1] * 0.02, 10.0 * on], axis=1)
    alike = [Frame(points, moved * [1, 1, rise]) for rise in (1, 2, 3)]
    half = [
        Frame(f.points[f.points[:, 0] > 0], f.displacement[f.points[:, 0] > 0])
        for f in BUBBLE_FRAMES
    ]
    noise = noisy_frames(BUBBLE_FRAMES, 0.3, np.random.default_rng(1))
    both = {"rim_angle": 0.0, "centre": (0, 0, 0)}
    for frames, radii, options, words in (
        (
            noisy_frames(alike, 0.02, np.random.default_rng(1)),
            (CLAMP_RADIUS, CLAMP_RADIUS),
            {},
            "give the angle",
        ),
        (half, (CLAMP_RADIUS, CLAMP_RADIUS), {}, "directions only; give the centre"),
        (BUBBLE_FRAMES, (5.0, 5.0), {}, "length unit and the radius"),
        ([Frame(points, 0 * points)], (CLAMP_RADIUS, CLAMP_RADIUS), {}, "nothing moves"),
        (
            BUBBLE_FRAMES,
            (CLAMP_RADIUS, CLAMP_RADIUS),
            {"plane": "clamp"},
            "too few points beyond the rim",
        ),
        (noise, (100.0, 99.9), {"rim_angle": 0.0}, "too round to tell the warp"),
        (elliptic_frames(0.0), (100.0, 70.0), both, "expected the warp, too"),
    ):
        assert words in complaint(register, frames, radii, RegistrationOptions(**options))


@pytest.mark.parametrize(("reach", "within"), [(1.0, 0.05), (1.25, 0.6)])
def test_direction_of_an_elliptic_rim_gives_the_warp(reach, within):
    """Its major axis lies 25 degrees from the warp, and the camera sees the warp at 40."""
    frames = elliptic_frames(25.0, reach)
    turn = rotation_by("zx", [40.0, 5.0])
    options = RegistrationOptions(rim_angle=25.0)
    seen_frames = [seen_by_camera(f, turn, (6.0, -4.0, 500.0)) for f in frames]
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
