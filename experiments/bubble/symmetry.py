"""Symmetry of the displacement field of an inflated disk: its axes, and folding onto a quarter.

The field is symmetric about warp and fill. In polar coordinates about the centre, with the angle
counted from the warp, the Fourier series of the radial displacement u_r and of the rise u_z have
cosines only, that of the tangential displacement u_theta has sines only. The shape of the sheet
before the test, which need not be symmetric, changes displacements much alike at every pressure:
the lowest image is subtracted from high ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...light_dataclasses import dataclass
from ...readers.fields import DisplacementField
from ...readers.frames import Frame
from ...solvers.base import Array
from .placement import correlated_points

#: Harmonics of the angle about the centre; those by which the axes of symmetry are found.
HARMONICS = (0, 1, 2, 3, 4)
TELLING_HARMONICS = (2, 4)
#: Radii (shares of the rim's) at which amplitudes are compared; angles of axes that are tried.
RADII = np.linspace(0.1, 0.9, 9)
ANGLES = np.radians(np.arange(0.0, 90.0, 0.05))


@dataclass(frozen=True)
class SymmetrySettings:
    """Which images and points determine the axes, and how many parts show their scatter."""

    low_share: float = 0.7  # images that rise by more than this share of the last one are used
    max_frames: int = 6  # largest number of images used, those of the highest pressures
    max_parts: int = 4  # largest number of parts of the points whose axes are compared
    min_points_of_part: int = 120  # fewest points of a part, about four for each fitted term


SETTINGS = SymmetrySettings()


@dataclass(frozen=True)
class Axes:
    """Two perpendicular axes of symmetry of a displacement field.

    Attributes
    ----------
    angle : float, degrees
        Angle of one of the axes from x towards y, 0 to 90.
    error : float, degrees
        Standard error of the angle: its scatter between images and between parts of the points
        together, or, if larger, its scatter between the components of the displacement.
    clarity : float
        How clearly the axes stand out: 1 - (asymmetry about these axes) / (asymmetry about the
        worst axes). 1 where the field is symmetric about these axes, 0 where no axes are better
        than others.
    """

    angle: float
    error: float
    clarity: float

    @property
    def misalignment(self) -> float:
        """Return the smallest angle (degrees) by which the axes are turned from x and y.

        It is from -45 to below 45, positive from x towards y.
        """
        return (self.angle + 45.0) % 90.0 - 45.0


def symmetry_axes(frames: Sequence[Frame], radius: float) -> Axes:
    """Find the axes about which the displacement fields of images are most symmetric.

    Parameters
    ----------
    frames : sequence of Frame
        Images with the rim's centre as origin, by rising pressure.
    radius : float, mm
        Radius of the rim.

    Returns
    -------
    Axes
    """
    asymmetries = _asymmetries(frames, radius)
    total = asymmetries.sum(axis=(0, 1))
    best = float(ANGLES[np.argmin(total)])
    # All images share the noise of the one that is subtracted, so their scatter does not show it;
    # the scatter between parts of the points does.
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
    clarity = 1.0 - float(total.min()) / largest if largest > 0 else 0.0
    return Axes(float(np.degrees(best)), error, clarity)


def _asymmetries(frames: Sequence[Frame], radius: float, rows: slice = slice(None)) -> Array:
    """Return asymmetries (images, 3, angles), mm^2, of the high images less the lowest one.

    They are those of u_r, u_theta and u_z about axes at each of `ANGLES`.

    Parameters
    ----------
    rows : slice
        The points used.
    """
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
    """Return the standard error (degrees) of the angle of the axes, from its scatter.

    Parameters
    ----------
    asymmetries : (samples, angles) array
        Each with the asymmetry about axes at `ANGLES`.
    best : float
        Angle of all samples together, radians. Angles that differ by 90 degrees are equal.
    """
    angles = ANGLES[np.argmin(asymmetries, axis=1)]
    count = len(angles)
    if count < 2:
        return 0.0
    deviation = np.angle(np.exp(4j * (angles - best))) / 4
    return float(np.degrees(np.sqrt((deviation**2).sum() / (count - 1) / count)))


def harmonics(frame: Frame, radius: float) -> Array:
    """Return the Fourier amplitudes of an image's displacements around the centre.

    Parameters
    ----------
    frame : Frame
        Image with the rim's centre as origin.
    radius : float, mm
        Radius of the rim.

    Returns
    -------
    (3, 5, 2, 9) array, mm
        Amplitudes by component (u_r, u_theta, u_z), harmonic (`HARMONICS`), cosine or sine, and
        radius (`RADII`).
    """
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
    """Return the three lowest powers (3, n) of the radius r that a smooth field has in harmonic k.

    Parameters
    ----------
    r : (n,) array
        Distances from the centre over the rim's radius.
    is_planar : bool
        Whether the component is u_r or u_theta, whose powers are others than those of u_z.
    """
    lowest = abs(k - 1) if is_planar and k else k + (1 if is_planar else 0)
    return np.stack([r ** (lowest + 2 * i) for i in range(3)])


def _asymmetry(profile: Array) -> Array:
    """Return how far u_r, u_theta, u_z are asymmetric about axes at `ANGLES`: (3, angles), mm^2.

    It is the sum over radii and harmonics of the squared amplitudes of the wrong kind (sines of u_r
    and u_z, cosines of u_theta), weighted by the radius.

    Parameters
    ----------
    profile : array
        Amplitudes as of `harmonics`.
    """
    total = np.zeros((3, len(ANGLES)))
    for k in TELLING_HARMONICS:
        cosine = np.cos(k * ANGLES)[:, None]
        sine = np.sin(k * ANGLES)[:, None]
        for quantity in range(3):
            a, b = profile[quantity, k]
            odd = b * cosine - a * sine if quantity != 1 else a * cosine + b * sine
            total[quantity] += (RADII * odd**2).sum(axis=1)
    return total


def folded(field: DisplacementField) -> DisplacementField:
    """Return a field of the full disk with all its points mirrored into the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    displacement = field.displacement.copy()
    displacement[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=displacement)


def mirrored(field: DisplacementField) -> DisplacementField:
    """Return a field of the quarter x, y >= 0 mirrored to the full disk.

    A field with points outside of this quarter is returned as it is.
    """
    if (field.points < -1e-9).any():
        return field
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    points = np.concatenate([field.points * (sx, sy) for sx, sy in signs])
    displacement = np.concatenate([field.displacement * (sx, sy, 1) for sx, sy in signs])
    _, rows = np.unique(np.round(points, 6), axis=0, return_index=True)
    return replace(
        field,
        points=points[rows],
        displacement=displacement[rows],
        z=None if field.z is None else np.tile(field.z, 4)[rows],
        sigma=None if field.sigma is None else np.tile(field.sigma, 4)[rows],
    )
