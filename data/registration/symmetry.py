"""The two axes about which a displacement field is symmetric: warp and fill, whatever the law.

A disk of orthotropic fabric moves symmetrically about warp and fill. In polar components about the
centre, u_r and u_z then have only cosines of the angle from the warp, u_theta only sines. What the
sheet's first shape adds is much the same at every pressure: two frames are subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..frames import Frame
from .directions import axes_angle

Array = NDArray[np.float64]

#: Harmonics around the centre; the even ones above zero tell the axes.
HARMONICS = (0, 1, 2, 3, 4)
TELLING = (2, 4)
RADII = np.linspace(0.1, 0.9, 9)
ANGLES = np.radians(np.arange(0.0, 90.0, 0.05))
#: Share of the highest frame's rise that the frame subtracted from others may have at most.
LOW = 0.7
#: Parts of the points that tell how sure the axes are, and the most frames that are looked at.
PARTS, FRAMES = 4, 6
#: Points that a part needs: four for each of its terms.
ENOUGH = 120


@dataclass(frozen=True)
class Axes:
    """angle : degrees from x towards y of one axis, 0 to 90; the other is 90 degrees from it.

    error : standard error, degrees, from frame to frame and between parts of the points.
    clear : 1 where the field is wholly symmetric about the axes, 0 where no axes are better.
    """

    angle: float
    error: float
    clear: float

    @property
    def off(self) -> float:
        """How far they are turned from x and y, degrees, from -45 to below 45."""
        return axes_angle(self.angle)


def symmetry_axes(frames: Sequence[Frame], radius: float) -> Axes:
    """The axes of the frames' even part.

    Parameters
    ----------
    frames : about the rim's centre, in its plane, by rising pressure.
    radius : mm.
    """
    costs = _costs(frames, radius)
    together = costs.sum(axis=0)
    best = float(ANGLES[np.argmin(together)])
    # Frames share the noise of the one that is subtracted; parts of the points do not.
    error = _scatter(costs, best)
    count = min(PARTS, min(len(frame.points) for frame in frames) // ENOUGH)
    if count > 1:
        parts = [[_part(frame, k, count) for frame in frames] for k in range(count)]
        by_part = np.array([_costs(part, radius).sum(axis=0) for part in parts])
        error = float(np.hypot(error, _scatter(by_part, best)))
    total = float(together.max())
    clear = 1.0 - float(together.min()) / total if total > 0 else 0.0
    return Axes(float(np.degrees(best)), error, clear)


def _costs(frames: Sequence[Frame], radius: float) -> Array:
    """What is not symmetric (frames, angles), of each high frame less the lowest."""
    rise = [float(np.nanmax(frame.displacement[:, 2])) for frame in frames]
    low = [f for f, r in zip(frames, rise, strict=True) if r <= LOW * rise[-1]]
    high = [f for f, r in zip(frames, rise, strict=True) if r > LOW * rise[-1]]
    first = harmonics(low[0], radius) if low else 0.0
    return np.array([_asymmetry(harmonics(frame, radius) - first) for frame in high[-FRAMES:]])


def _part(frame: Frame, number: int, count: int) -> Frame:
    every = slice(number, None, count)
    return replace(frame, points=frame.points[every], displacement=frame.displacement[every])


def _scatter(costs: Array, best: float) -> float:
    """Standard error of the mean angle, degrees; axes repeat after 90 degrees."""
    each = ANGLES[np.argmin(costs, axis=1)]
    if len(each) < 2:
        return 0.0
    apart = np.angle(np.exp(4j * (each - best))) / 4
    return float(np.degrees(np.sqrt((apart**2).sum() / (len(each) - 1) / len(each))))


def harmonics(frame: Frame, radius: float) -> Array:
    """Amplitudes (3, 5, 2, 9) mm: of u_r, u_theta, u_z, by harmonic, cosine and sine, radius."""
    whole = np.isfinite(frame.displacement).all(axis=1) & np.isfinite(frame.points).all(axis=1)
    x, y = frame.points[whole, :2].T / radius
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    on = (r > 1e-6) & (r < 1.0)
    r, angle, moved = r[on], angle[on], frame.displacement[whole][on]
    c, s = np.cos(angle), np.sin(angle)
    polar = np.stack([c * moved[:, 0] + s * moved[:, 1], c * moved[:, 1] - s * moved[:, 0]])
    result = np.empty((3, len(HARMONICS), 2, len(RADII)))
    for quantity, values in enumerate([*polar, moved[:, 2]]):
        planar = quantity < 2
        radial = np.concatenate([_radial(r, k, planar) for k in HARMONICS for _ in range(2)])
        around = [f(k * angle) for k in HARMONICS for f in (np.cos, np.sin)]
        terms = (radial.reshape(len(around), 3, -1) * np.array(around)[:, None]).reshape(-1, len(r))
        solution, *_ = np.linalg.lstsq(terms.T, values, rcond=1e-10)
        of_term = solution.reshape(len(HARMONICS), 2, 3)
        for k in HARMONICS:
            result[quantity, k] = of_term[k] @ _radial(RADII, k, planar)
    return result


def _radial(r: Array, k: int, planar: bool) -> Array:
    """Powers of the radius that a smooth field's harmonic k has: (3, n)."""
    lowest = abs(k - 1) if planar and k else k + (1 if planar else 0)
    return np.stack([r ** (lowest + 2 * i) for i in range(3)])


def _asymmetry(profile: Array) -> Array:
    """What is not symmetric about an axis at each of the angles, mm^2."""
    total = np.zeros(len(ANGLES))
    for k in TELLING:
        cosine, sine = np.cos(k * ANGLES)[:, None], np.sin(k * ANGLES)[:, None]
        for quantity in range(3):
            a, b = profile[quantity, k]
            odd = b * cosine - a * sine if quantity != 1 else a * cosine + b * sine
            total += (RADII * odd**2).sum(axis=1)
    return total
