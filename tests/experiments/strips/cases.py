"""Builders of the tests of strips: frames of a stretched strip."""

import numpy as np
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.readers.frames import Frame


def strip_grid(spacing: float = 1.0, jitter: float = 0.0, seed: int = 0) -> np.ndarray:
    """Reference points (m, 3) on a 25 x 60 mm strip that is not quite flat."""
    x, y = np.meshgrid(np.arange(0, 25.1, spacing), np.arange(0, 60.1, spacing))
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    flat += jitter * spacing * np.random.default_rng(seed).uniform(-1, 1, flat.shape)
    return np.column_stack([flat, 0.02 * flat[:, 1] + 1.0])


def stretched_frame(points: np.ndarray, stretch: float, angle: float, shift=(3.0, -7.0, 2.0)):
    """Stretch along the strip, turn about x (out of the camera's plane), slip in the grips."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    moved = (points * [0.9, stretch, stretch]) @ turn.T + shift
    return Frame(points, moved - points)


LOWER, UPPER = (12.3, 20.1), (12.3, 40.122)


def gauge_of_three_frames():
    points = strip_grid()
    frames = [stretched_frame(points, stretch, 0.0) for stretch in (1.0, 1.1, 1.2)]
    frames[1] = Frame(points[points[:, 1] < 38], frames[1].displacement[points[:, 1] < 38])
    return virtual_strain_gauge(frames, LOWER, UPPER)


def square_with_hole(spacing: float = 1.0, without: tuple[float, float] | None = None) -> Frame:
    x, y = (part.ravel() for part in np.meshgrid(*2 * [spacing * np.arange(11.0)]))
    points = np.column_stack([x, y, 0 * x])
    if without is not None:
        points = points[np.hypot(x - without[0], y - without[1]) > 0.1]
    return Frame(points, np.zeros_like(points))
