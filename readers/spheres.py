"""A sphere through measured points: whether a camera sees lengths as they are.

The start is the linear least squares of the thesis (Appendix A, Eqs. A.1 to A.6); Newton's steps
then make the distances of the points from the sphere least, which the linear fit does not: it takes
points of a cap with noise for a smaller ball.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import Frame

Array = NDArray[np.float64]

#: A sphere has four unknowns; points fewer than so many say nothing of how well it fits.
LEAST_POINTS = 10
#: Points farther off than so many robust standard deviations are left out, at most so many times.
SIGMAS, ROUNDS = 4.0, 20
#: So many spheres, through so many points each, are tried for a start, and judged by so many.
TRIES, FEW, JUDGES = 200, 8, 2000
#: Median of |normal deviate|.
MEDIAN = 0.6744897501960817
#: Of the points in the plane across their thinnest direction: below, they are flat for any noise.
FLAT = 1e-9
#: A radius larger than so many times the points' extent is noise of points in a plane.
LARGEST = 100.0


@dataclass(frozen=True, eq=False)
class Sphere:
    """The sphere through the points of one frame.

    centre : (3,) mm. radius : mm. centre_error, radius_error : mm, standard errors, as if the
    errors of the points were independent; those of neighbours in image correlation are not.
    deviation : (n,) mm, distance of each point beyond the sphere. kept : (n,) whether it was used.
    points : (n, 3) mm.
    """

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
    """Fit the sphere with the least sum of squared distances from points (n, 3) in mm.

    Points farther off than four robust standard deviations are left out, until those kept stay the
    same.

    Raises InputError: too few points, points in a plane.
    """
    _check(points, path)
    centre, radius = _start(points)
    kept = _inside(points, centre, radius)
    for _ in range(ROUNDS):
        centre, radius = _distances_least(points[kept], *_linear(points[kept]), path)
        inside = _inside(points, centre, radius)
        if (inside == kept).all():
            break
        kept = inside
    deviation = np.linalg.norm(points - centre, axis=1) - radius
    slopes = _slopes(points[kept], centre)
    freedom = int(kept.sum()) - 4
    variance = float(np.sum(deviation[kept] ** 2)) / freedom
    errors = np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
    return Sphere(centre, radius, errors[:3], float(errors[3]), deviation, kept, points, path)


def _check(points: Array, path: Path | None) -> None:
    if len(points) < LEAST_POINTS:
        problem = f"expected {LEAST_POINTS} points or more, got {len(points)}"
        raise InputError(path, "", problem)
    spans = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spans[2] <= FLAT * spans[0]:
        raise InputError(path, "", "the points lie in a plane, or on a line: no sphere is told")


def _start(points: Array) -> tuple[Array, float]:
    """Return the best of spheres through a few points each, by the median distance.

    A point far astray, such as one at the camera, would carry the fit through all of them away.
    """
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
        slopes = _slopes(points, centre)
        off = np.linalg.norm(points - centre, axis=1) - radius
        step = np.linalg.lstsq(slopes, -off, rcond=None)[0]
        centre, radius = centre + step[:3], radius + float(step[3])
        if np.linalg.norm(step) <= 1e-12 * max(abs(radius), 1.0):
            break
    extent = float(np.ptp(points, axis=0).max())
    if not 0 < radius < LARGEST * extent:
        problem = "the points are so nearly in a plane that no sphere is told by them"
        raise InputError(path, "", problem)
    return centre, radius
