"""Fit spheres to measured points (Eq. A.6), to check a camera on a ball of known radius."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import Array, Frame

#: Fewest points of a fit: a sphere has four unknowns, and few points do not show how well it fits.
MIN_POINTS = 10
#: Median of |normal deviate|.
MEDIAN_DEVIATE = 0.6744897501960817


@dataclass(frozen=True)
class SphereSearch:
    """Settings of a robust fit of a sphere.

    Attributes
    ----------
    flatness : float
        Thickness of the points over their extent up to which they count as lying in a plane.
    max_radius : float
        Largest radius over the extent of the points; beyond, points lie in a plane but for noise.
    max_deviation : float
        Number of robust standard deviations beyond which a point is left out.
    max_rounds : int
        Largest number of rounds of fitting and leaving points out.
    trials, trial_points : int
        Number of spheres that are tried as a start, and of the random points of each.
    judging_points : int
        Number of random points by which the trial spheres are compared.
    """

    flatness: float = 1e-9
    max_radius: float = 100.0
    max_deviation: float = 4.0
    max_rounds: int = 20
    trials: int = 200
    trial_points: int = 8
    judging_points: int = 2000


@dataclass(frozen=True, eq=False)
class Sphere:
    """The sphere through some points.

    Attributes
    ----------
    centre : (3,) array, mm
    radius : float, mm
    centre_error : (3,) array, mm
        One standard deviation.
    radius_error : float, mm
    deviation : (n,) array, mm
        Distance of each point from the sphere, positive outside.
    is_used : (n,) array of bool
        Mask of the points that are not left out as outliers.
    points : (n, 3) array, mm
        All points.
    path : Path or None
        File of the points.
    """

    centre: Array
    radius: float
    centre_error: Array
    radius_error: float
    deviation: Array
    is_used: NDArray[np.bool_]
    points: Array
    path: Path | None = None

    @property
    def rms(self) -> float:
        """Return the RMS deviation of the points used, mm."""
        return float(np.sqrt(np.mean(self.deviation[self.is_used] ** 2)))

    @property
    def left_out(self) -> int:
        """Return the number of points too far off to be used."""
        return int((~self.is_used).sum())


def points_of(frame: Frame) -> Array:
    """Return the points (n, 3) mm of a frame, displaced if the frame has displacements."""
    is_displaced = np.isfinite(frame.displacement).any()
    positions = frame.points + frame.displacement if is_displaced else frame.points
    return positions[np.isfinite(positions).all(axis=1)]


def fit_sphere(
    points: Array, path: Path | None = None, search: SphereSearch = SphereSearch()
) -> Sphere:
    """Fit a sphere to points by least squares of distance, without outliers.

    Parameters
    ----------
    points : (n, 3) array, mm
    path : Path, optional
        File, for messages.
    search : SphereSearch

    Raises
    ------
    InputError
        The points are too few, or lie in a plane.
    """
    if len(points) < MIN_POINTS:
        raise InputError(path, "", f"expected {MIN_POINTS} points or more, got {len(points)}")
    spans = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spans[2] <= search.flatness * spans[0]:
        raise InputError(path, "", "the points lie in a plane, or on a line: no sphere is told")
    is_used = _is_near(points, *_start(points, search), search)
    for _ in range(search.max_rounds):
        centre, radius = _fit_distances(points[is_used], search, path)
        is_near = _is_near(points, centre, radius, search)
        if (is_near == is_used).all():
            break
        is_used = is_near
    deviation = np.linalg.norm(points - centre, axis=1) - radius
    jacobian = _jacobian(points[is_used], centre)
    variance = np.sum(deviation[is_used] ** 2) / (is_used.sum() - 4)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    return Sphere(
        centre,
        radius,
        centre_error=errors[:3],
        radius_error=float(errors[3]),
        deviation=deviation,
        is_used=is_used,
        points=points,
        path=path,
    )


def _start(points: Array, search: SphereSearch) -> tuple[Array, float]:
    """Return centre and radius to start from: the best sphere through a few random points each.

    A sphere through all points would be spoilt by outliers.
    """
    draw = np.random.default_rng(0)
    judges = points[draw.permutation(len(points))[: search.judging_points]]
    spheres = []
    for _ in range(search.trials):
        chosen = draw.choice(len(points), search.trial_points, replace=False)
        spheres.append(_fit_algebraic(points[chosen]))
    spheres.append(_fit_algebraic(points))
    medians = [
        np.median(np.abs(np.linalg.norm(judges - centre, axis=1) - radius))
        for centre, radius in spheres
    ]
    return spheres[np.argmin(medians)]


def _is_near(
    points: Array,
    centre: Array,
    radius: float,
    search: SphereSearch,
) -> NDArray[np.bool_]:
    """Return the mask (n,) of points that are not too far off a sphere.

    Parameters
    ----------
    points, centre : (n, 3) and (3,) arrays, mm
    radius : float, mm
    search : SphereSearch
    """
    distance = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
    deviation = search.max_deviation * np.median(distance) / MEDIAN_DEVIATE
    # Points without noise are off by rounding: none of them is astray.
    return distance <= max(deviation, 1e-9 * radius)


def _fit_algebraic(points: Array) -> tuple[Array, float]:
    """Solve Eq. A.6, about the mean of the points so that it is well conditioned."""
    mean = points.mean(axis=0)
    x = points - mean
    matrix = np.column_stack([2 * x, np.ones(len(x))])
    solution = np.linalg.lstsq(matrix, np.sum(x**2, axis=1), rcond=None)[0]
    centre = solution[:3]
    return mean + centre, np.sqrt(max(solution[3] + centre @ centre, 0.0))


def _jacobian(points: Array, centre: Array) -> Array:
    """Return (n, 4) d distance / d (centre, radius).

    Parameters
    ----------
    points, centre : (n, 3) and (3,) arrays
        In one unit of length.
    """
    radii = points - centre
    lengths = np.linalg.norm(radii, axis=1)
    return np.column_stack([-radii / lengths[:, None], -np.ones(len(points))])


def _fit_distances(points: Array, search: SphereSearch, path: Path | None) -> tuple[Array, float]:
    """Return centre and radius of least squares of distance, by Gauss-Newton steps.

    Parameters
    ----------
    points : (n, 3) array
        In any unit of length.
    """
    centre, radius = _fit_algebraic(points)
    for _ in range(100):
        distance = np.linalg.norm(points - centre, axis=1) - radius
        step = np.linalg.lstsq(_jacobian(points, centre), -distance, rcond=None)[0]
        centre = centre + step[:3]
        radius += float(step[3])
        if np.linalg.norm(step) <= 1e-12 * max(abs(radius), 1.0):
            break
    if not 0 < radius < search.max_radius * np.ptp(points, axis=0).max():
        problem = "the points are so nearly in a plane that no sphere is told by them"
        raise InputError(path, "", problem)
    return centre, radius
