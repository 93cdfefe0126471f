"""Builders of the tests of bubbles: frames as a camera sees them."""

import numpy as np
from bubblefit.readers.frames import Frame
from scipy.spatial.transform import Rotation

CLAMP_RADIUS = 100.0


def rotation_by(axes: str, angles) -> np.ndarray:
    return Rotation.from_euler(axes, angles, degrees=True).as_matrix()


def camera_grid(step: float = 10.0, reach: float = 1.0) -> np.ndarray:
    line = np.arange(-reach * CLAMP_RADIUS, reach * CLAMP_RADIUS + step, step) + step / 3
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    near = np.hypot(x, y) < reach * CLAMP_RADIUS
    return np.stack([x[near], y[near], np.zeros(near.sum())], axis=1)


def orthotropic_shape(points: np.ndarray, rise: float) -> Frame:
    """An orthotropic shape: symmetric about x and y, still on the rim and beyond."""
    x, y = points[:, :2].T / CLAMP_RADIUS
    on = np.clip(1 - x**2 - y**2, 0.0, None)
    square = (rise / CLAMP_RADIUS) ** 2
    moved = np.stack(
        [
            CLAMP_RADIUS * square * on * x * (0.3 + 0.1 * y**2),
            CLAMP_RADIUS * square * on * y * (0.5 - 0.2 * x**2),
            rise * on * (1 - 0.1 * x**2 + 0.05 * y**2 + 0.1 * x**2 * y**2),
        ],
        axis=1,
    )
    return Frame(points, moved)


def seen_by_camera(frame: Frame, turn: np.ndarray, shift) -> Frame:
    return Frame(frame.points @ turn.T + np.asarray(shift), frame.displacement @ turn.T)


def noisy_frames(frames, sigma: float, rng) -> list[Frame]:
    noise = (sigma * rng.standard_normal(f.points.shape) for f in frames)
    return [Frame(f.points, f.displacement + one) for f, one in zip(frames, noise, strict=True)]


BUBBLE_FRAMES = [orthotropic_shape(camera_grid(), rise) for rise in (8.0, 20.0, 30.0)]
FRAMES_BEYOND_CLAMP = [
    orthotropic_shape(camera_grid(10.0, 1.2), rise) for rise in (8.0, 20.0, 30.0)
]


def elliptic_frames(angle: float, reach: float = 1.0) -> list[Frame]:
    """Frames of a sheet whose edge is an ellipse (100 by 70 mm) at an angle from its x, the warp.

    Its shape follows the edge and nothing else: it has no other axes.
    """
    points = camera_grid(7.0, reach)
    u, v = (points @ rotation_by("z", angle))[:, :2].T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    kept = (on > 0) | (reach > 1)
    frames = []
    for rise in (8.0, 20.0, 30.0):
        along = on * (0.1 * u + 0.05 * v)
        moved = np.stack([along, 0.1 * on * v, rise * on * (1 + 0.1 * u**2)], axis=1)
        frames.append(Frame(points[kept], moved[kept]))
    return frames
