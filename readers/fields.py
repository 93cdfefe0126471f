"""Displacement fields of a bubble, and surfaces through points: Eq. 4.4, spheres of Eq. A.6."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import pandas as pd
from .frames import LOST, Array, Frame, FrameOptions, FrameSource, read_frames

#: What a file must hold: reference place and displacement; the names in the file may differ. The
#: height z of the reference state is read where it is there.
QUANTITIES = ("x", "y", "dx", "dy", "dz")
PLAIN = FrameOptions(QUANTITIES)


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements measured (or computed) at one pressure (MPa); sigma : as `Frame.sigma`.

    points : (n, 2) mm, x is warp, y fill, in the reference state; z : (n,) height there, or None.
    """

    pressure: float
    points: Array
    displacement: Array
    dropped: Mapping[str, int] = field(default_factory=dict)
    z: Array | None = None
    sigma: Array | None = None
    path: Path | None = None
    source: FrameSource = field(default_factory=FrameSource)

    @property
    def frame(self) -> Frame:
        """Return the field as a frame; z is 0 where the height was not measured."""
        z = np.zeros(len(self.points)) if self.z is None else self.z
        return Frame(np.column_stack([self.points, z]), self.displacement, self.path)


def read_fields(
    files: Sequence[Path | str],
    pressures: Sequence[float],
    options: FrameOptions = PLAIN,
    format: str | None = None,
    frames: Sequence[int] | None = None,
) -> tuple[DisplacementField, ...]:
    """Read a frame a pressure (MPa), without a first unmoved one too many in one file."""
    if len(files) > len(pressures) and frames is None:
        problem = f"expected one file a pressure, got {len(files)} for {len(pressures)} pressures"
        raise InputError(None, "files", problem)
    read = read_frames(files, options, format)
    if frames is not None:
        read = tuple(read[number] for number in frames)
    elif len(read) == len(pressures) + 1 and len(files) == 1:
        moved = read[0].displacement[np.isfinite(read[0].displacement)]
        read = read[1:] if moved.size and not moved.any() else read
    if len(read) != len(pressures):
        problem = f"expected one frame for each of {len(pressures)} pressures, found {len(read)}"
        raise InputError(None, "files", problem)
    return tuple(_field_of(*one) for one in zip(read, map(float, pressures), strict=True))


def _field_of(frame: Frame, pressure: float) -> DisplacementField:
    """Return the field of a frame, at a pressure in MPa, without points of lost correlation."""
    z = frame.points[:, 2]
    # A height that no row has was not measured; one that some rows lack was lost there.
    measured = bool(np.isfinite(z).any())
    values = np.concatenate([frame.points[:, : 2 + measured], frame.displacement], axis=1)
    whole = np.isfinite(values).all(axis=1)
    dropped = dict(frame.dropped)
    if not whole.all():
        dropped[LOST] = dropped.get(LOST, 0) + int((~whole).sum())
    if not whole.any():
        why = ", ".join(f"{count} {reason}" for reason, count in dropped.items())
        raise InputError(frame.path, "", f"no row is left to use: {why or 'there are none'}")
    return DisplacementField(
        pressure,
        frame.points[whole, :2],
        frame.displacement[whole],
        dropped,
        z[whole] if measured else None,
        None if frame.sigma is None else frame.sigma[whole],
        frame.path,
        frame.source,
    )


def powers(points: Array, degree: int) -> Array:
    """Return terms (n, (degree + 1)^2) of Eq. 4.4 at points (n, 2), highest powers first."""
    x = np.vander(points[:, 0], degree + 1)
    y = np.vander(points[:, 1], degree + 1)
    return (y[:, :, None] * x[:, None, :]).reshape(len(points), -1)


MAX_DEGREE = 12  # beyond, powers of double precision coordinates tell nothing apart
LEADING = ("pressure_MPa", "direction", "R2", "degree", "scale_mm")  # of surfaces.csv


@dataclass(frozen=True, eq=False)
class DisplacementSurface:
    """Three polynomials F(x, y), one a direction of displacement, at one pressure (MPa).

    coefficients : (3, (degree + 1)^2) mm, of x / scale and y / scale, ordered as in Eq. 4.4.
    """

    pressure: float
    degree: int
    coefficients: Array
    scale: float
    r_squared: Array

    def evaluate(self, points: Array) -> Array:
        """Return displacement (n, 3) mm at reference points (n, 2) mm."""
        return powers(np.asarray(points) / self.scale, self.degree) @ self.coefficients.T

    @property
    def physical(self) -> Array:
        """Return coefficients (3, (degree + 1)^2) of Eq. 4.4 with x and y in mm."""
        falling = np.arange(self.degree, -1, -1)
        return self.coefficients / self.scale ** (falling[:, None] + falling).ravel()


def fit_surface(field: DisplacementField, degree: int) -> DisplacementSurface:
    """Fit Eq. 4.4, of any degree, to a displacement field by least squares."""
    if not 0 <= degree <= MAX_DEGREE:
        raise InputError(None, "degree", f"expected 0 to {MAX_DEGREE}, got {degree}")
    terms = (degree + 1) ** 2
    count = len(field.points)
    at = f"surface of degree {degree} at {field.pressure * 1e3:g} kPa"
    if count < terms:
        problem = f"{terms} coefficients need as many points, there are {count}; lower the degree"
        raise InputError(None, at, problem)
    scale = float(np.abs(field.points).max()) or 1.0
    term = powers(field.points / scale, degree)
    # Columns of length one: x^8 y^8 is at most 1/256 on a disk, and no less a term for that.
    length = np.linalg.norm(term, axis=0)
    length[length == 0] = 1.0
    solution, _, rank, _ = np.linalg.lstsq(term / length, field.displacement, rcond=1e-13)
    if rank < terms:
        lie = f"the {count} points lie so that they settle only {rank} of {terms} coefficients"
        raise InputError(None, at, f"{lie} (on too few lines?); lower the degree")
    coefficients = (solution / length[:, None]).T
    value = field.displacement
    left = field.displacement - term @ coefficients.T
    about_mean = ((value - value.mean(axis=0)) ** 2).sum(axis=0)
    remaining = (left**2).sum(axis=0)
    # A constant direction (a clamped one, all zeros) has nothing to explain.
    nothing = about_mean <= 1e-24 * (value**2).sum(axis=0)
    share = np.divide(remaining, about_mean, out=np.zeros_like(remaining), where=~nothing)
    return DisplacementSurface(field.pressure, degree, coefficients, scale, 1.0 - share)


def surface_table(surfaces: Sequence[DisplacementSurface]) -> pd.DataFrame:
    """Return a row a surface and direction: R^2, degree, scale, C0 ... of Eq. 4.4, in mm."""
    rows = [
        dict(zip(LEADING, (s.pressure, direction, r_squared, s.degree, s.scale), strict=True))
        | {f"C{i}": value for i, value in enumerate(coefficients)}
        for s in surfaces
        for direction, r_squared, coefficients in zip("xyz", s.r_squared, s.physical, strict=True)
    ]
    return pd.DataFrame(rows)


#: A sphere has four unknowns; points fewer than so many say nothing of how well it fits.
LEAST_POINTS = 10
#: Of the points in the plane across their thinnest direction: below, they are flat for any noise. A
#: radius larger than so many times the points' extent is noise of points in a plane.
FLAT, LARGEST = 1e-9, 100.0
#: Points farther off than so many robust standard deviations are left out, at most so many times.
SIGMAS, ROUNDS = 4.0, 20
#: So many spheres, through so many points each, are tried for a start, and judged by so many.
TRIES, FEW, JUDGES = 200, 8, 2000
#: Median of |normal deviate|.
MEDIAN = 0.6744897501960817


@dataclass(frozen=True, eq=False)
class Sphere:
    """The sphere through points (n, 3) mm, deviation (n,) mm beyond it, kept (n,) where used."""

    centre: Array
    radius: float
    centre_error: Array
    radius_error: float
    deviation: Array
    kept: NDArray[np.bool_]
    points: Array
    path: Path | None = None

    @property
    def rms(self) -> float:
        """Return the RMS deviation of the points used, mm."""
        return float(np.sqrt(np.mean(self.deviation[self.kept] ** 2)))

    @property
    def left_out(self) -> int:
        """Return the number of points too far off to be used."""
        return int((~self.kept).sum())


def points_of(frame: Frame) -> Array:
    """Return the surface (n, 3) mm in this frame: reference places, moved where known."""
    moved = np.isfinite(frame.displacement).any()
    places = frame.points + frame.displacement if moved else frame.points
    return np.asarray(places[np.isfinite(places).all(axis=1)])


def fit_sphere(points: Array, path: Path | None = None) -> Sphere:
    """Fit a sphere to points (n, 3) mm by least squares of distance, but for those 4 sigma off."""
    if len(points) < LEAST_POINTS:
        raise InputError(path, "", f"expected {LEAST_POINTS} points or more, got {len(points)}")
    spans = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spans[2] <= FLAT * spans[0]:
        raise InputError(path, "", "the points lie in a plane, or on a line: no sphere is told")
    kept = _inside(points, *_start(points))
    for _ in range(ROUNDS):
        centre, radius = _distances_least(points[kept], *_linear(points[kept]), path)
        inside = _inside(points, centre, radius)
        if (inside == kept).all():
            break
        kept = inside
    deviation = np.linalg.norm(points - centre, axis=1) - radius
    slopes = _slopes(points[kept], centre)
    variance = float(np.sum(deviation[kept] ** 2)) / (int(kept.sum()) - 4)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
    return Sphere(centre, radius, errors[:3], float(errors[3]), deviation, kept, points, path)


def _start(points: Array) -> tuple[Array, float]:
    """Return the best of spheres through a few points each: stray points spoil that of all."""
    draw = np.random.default_rng(0)
    some = points[draw.permutation(len(points))[:JUDGES]]
    found = [_linear(points[draw.choice(len(points), FEW, replace=False)]) for _ in range(TRIES)]
    found.append(_linear(points))
    off = [np.median(np.abs(np.linalg.norm(some - c, axis=1) - r)) for c, r in found]
    return found[int(np.argmin(off))]


def _inside(points: Array, centre: Array, radius: float) -> NDArray[np.bool_]:
    """Return the mask (n,) of points that are not too far off."""
    off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
    # Points without noise are off by rounding: none of them is astray.
    return np.asarray(off <= max(SIGMAS * float(np.median(off)) / MEDIAN, 1e-9 * radius))


def _linear(points: Array) -> tuple[Array, float]:
    """Solve Eq. A.6, about the mean of the points so that it is well conditioned."""
    middle = points.mean(axis=0)
    near = points - middle
    matrix = np.column_stack([2 * near, np.ones(len(near))])
    found = np.linalg.lstsq(matrix, np.sum(near**2, axis=1), rcond=None)[0]
    centre = found[:3]
    return middle + centre, float(np.sqrt(max(found[3] + centre @ centre, 0.0)))


def _slopes(points: Array, centre: Array) -> Array:
    """Return (n, 4) d distance / d (centre, radius)."""
    arms = points - centre
    lengths = np.linalg.norm(arms, axis=1)
    return np.column_stack([-arms / lengths[:, None], -np.ones(len(points))])


def _distances_least(
    points: Array, centre: Array, radius: float, path: Path | None
) -> tuple[Array, float]:
    for _ in range(100):
        off = np.linalg.norm(points - centre, axis=1) - radius
        step = np.linalg.lstsq(_slopes(points, centre), -off, rcond=None)[0]
        centre = centre + step[:3]
        radius = radius + float(step[3])
        if np.linalg.norm(step) <= 1e-12 * max(abs(radius), 1.0):
            break
    if not 0 < radius < LARGEST * float(np.ptp(points, axis=0).max()):
        problem = "the points are so nearly in a plane that no sphere is told by them"
        raise InputError(path, "", problem)
    return centre, radius
