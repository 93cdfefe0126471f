"""Axes of symmetry of an inflated disk of orthotropic fabric.

It moves symmetrically about warp and fill: in polar components u_r and u_z have only cosines of
the angle from the warp, u_theta only sines. The sheet's first shape adds much the same at every
pressure: the lowest frame is subtracted from high ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...readers.frames import Frame
from ...solvers.base import Array
from .placement import correlated_points

#: Harmonics around the centre; the even ones above zero tell the axes.
HARMONICS = (0, 1, 2, 3, 4)
TELLING_HARMONICS = (2, 4)
#: Radii, of the rim's, at which profiles are compared, and the angles that are tried.
RADII = np.linspace(0.1, 0.9, 9)
ANGLES = np.radians(np.arange(0.0, 90.0, 0.05))


@dataclass(frozen=True)
class SymmetrySettings:
    """Which frames and points tell the axes, and by how many their scatter is judged."""

    low_share: float = 0.7  # of the highest frame's rise: below, a frame is subtracted from others
    max_frames: int = 6  # the highest ones
    max_parts: int = 4  # of the points
    min_points_of_part: int = 120  # four for each of its terms


SETTINGS = SymmetrySettings()


@dataclass(frozen=True)
class Axes:
    """Two axes of symmetry at right angles.

    Attributes
    ----------
    angle : float, degrees
        Of one of them, 0 to 90, from x towards y.
    error : float, degrees
        Standard error, from frame to frame and between parts of the points, or between the
        components of the displacement.
    clear : float
        1 where the field is wholly symmetric about these axes, 0 where no axes are better.
    """

    angle: float
    error: float
    clear: float

    @property
    def off(self) -> float:
        """Return the turn from x and y, degrees, which repeats after 90: from -45 to below 45."""
        return (self.angle + 45.0) % 90.0 - 45.0


def symmetry_axes(frames: Sequence[Frame], radius: float) -> Axes:
    """Return the axes of symmetry of frames.

    Parameters
    ----------
    frames : sequence of Frame
        About the rim's centre, by rising pressure.
    radius : float, mm
    """
    asymmetries = _asymmetries(frames, radius)
    total = asymmetries.sum(axis=(0, 1))
    best = float(ANGLES[np.argmin(total)])
    # Frames share the noise of the one that is subtracted; parts of the points do not.
    error = _scatter(asymmetries.sum(axis=1), best)
    fewest_points = min(len(frame.points) for frame in frames)
    count = min(SETTINGS.max_parts, fewest_points // SETTINGS.min_points_of_part)
    if count > 1:
        parts = [_asymmetries(frames, radius, slice(k, None, count)) for k in range(count)]
        by_part = np.array([part.sum(axis=(0, 1)) for part in parts])
        error = float(np.hypot(error, _scatter(by_part, best)))
    # A sheet that is not symmetric, say ridged, turns the axes of u_r, u_theta and u_z apart.
    error = max(error, _scatter(asymmetries.sum(axis=0), best))
    largest = float(total.max())
    clear = 1.0 - float(total.min()) / largest if largest > 0 else 0.0
    return Axes(float(np.degrees(best)), error, clear)


def _asymmetries(frames: Sequence[Frame], radius: float, rows: slice = slice(None)) -> Array:
    """Return asymmetries (frames, 3, angles) of some points of each high frame less the lowest."""
    frames = [
        replace(frame, points=frame.points[rows], displacement=frame.displacement[rows])
        for frame in frames
    ]
    rises = [float(np.nanmax(frame.displacement[:, 2])) for frame in frames]
    highest_low = SETTINGS.low_share * rises[-1]
    low = [frame for frame, rise in zip(frames, rises, strict=True) if rise <= highest_low]
    high = [frame for frame, rise in zip(frames, rises, strict=True) if rise > highest_low]
    reference = harmonics(low[0], radius) if low else 0.0
    high = high[-SETTINGS.max_frames :]
    return np.array([_asymmetry(harmonics(frame, radius) - reference) for frame in high])


def _scatter(asymmetries: Array, best: float) -> float:
    """Return the standard error of the mean angle, degrees; axes repeat after 90 degrees."""
    angles = ANGLES[np.argmin(asymmetries, axis=1)]
    count = len(angles)
    if count < 2:
        return 0.0
    deviation = np.angle(np.exp(4j * (angles - best))) / 4
    return float(np.degrees(np.sqrt((deviation**2).sum() / (count - 1) / count)))


def harmonics(frame: Frame, radius: float) -> Array:
    """Return amplitudes (3, 5, 2, 9) mm of u_r, u_theta, u_z, by harmonic, cosine/sine, radius."""
    points, displacement = correlated_points(frame)
    x, y = points[:, :2].T / radius
    r = np.hypot(x, y)
    angle = np.arctan2(y, x)
    is_on_disk = (r > 1e-6) & (r < 1.0)
    r = r[is_on_disk]
    angle = angle[is_on_disk]
    u_x, u_y, u_z = displacement[is_on_disk].T
    c = np.cos(angle)
    s = np.sin(angle)
    polar = np.stack([c * u_x + s * u_y, c * u_y - s * u_x])
    amplitudes = np.empty((3, len(HARMONICS), 2, len(RADII)))
    around = [wave(k * angle) for k in HARMONICS for wave in (np.cos, np.sin)]
    for quantity, values in enumerate([*polar, u_z]):
        is_planar = quantity < 2
        radial = np.concatenate([_radial(r, k, is_planar) for k in HARMONICS for _ in range(2)])
        radial = radial.reshape(len(around), 3, -1)
        terms = (radial * np.array(around)[:, None]).reshape(-1, len(r))
        solution, *_ = np.linalg.lstsq(terms.T, values, rcond=1e-10)
        coefficients = solution.reshape(len(HARMONICS), 2, 3)
        for k in HARMONICS:
            amplitudes[quantity, k] = coefficients[k] @ _radial(RADII, k, is_planar)
    return amplitudes


def _radial(r: Array, k: int, is_planar: bool) -> Array:
    """Return the powers of the radius that a smooth field's harmonic k has: (3, n)."""
    lowest = abs(k - 1) if is_planar and k else k + (1 if is_planar else 0)
    return np.stack([r ** (lowest + 2 * i) for i in range(3)])


def _asymmetry(profile: Array) -> Array:
    """Return the parts of u_r, u_theta, u_z not symmetric about axes at the angles, (3, n) mm^2."""
    total = np.zeros((3, len(ANGLES)))
    for k in TELLING_HARMONICS:
        cosine = np.cos(k * ANGLES)[:, None]
        sine = np.sin(k * ANGLES)[:, None]
        for quantity in range(3):
            a, b = profile[quantity, k]
            odd = b * cosine - a * sine if quantity != 1 else a * cosine + b * sine
            total[quantity] += (RADII * odd**2).sum(axis=1)
    return total
