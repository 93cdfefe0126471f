"""The clamped edge of a bubble, found where the sheet does not rise.

Of the rim the size is known: the rise is a polynomial times a factor that is zero there. Where
points of the clamp were measured, its edge is where they begin to stand still; its size is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from ...errors import InputError
from ...solvers.base import Array
from .placement import CLAMP_BEGINS, MIN_CLAMP_POINTS, in_all_quarters

#: Positions (n, 2) mm in the plane of the sheet, and rises (n,) mm.
RiseSurface = tuple[Array, Array]
SemiAxes = tuple[float, float]
#: Even and odd powers (of u, of v) of a shape beside the factor that vanishes at the rim.
EVEN = ((0, 0), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
ODD = ((1, 0), (0, 1), (3, 0), (2, 1), (1, 2), (0, 3))
#: Points that a surface needs: three for each of its terms, of which one is a shift.
MIN_POINTS = 3 * (len(EVEN) + len(ODD) + 1)


@dataclass(frozen=True)
class RimSearch:
    """Settings of the search for the rim. Lengths are shares of its radius."""

    max_frames: int = 4  # the highest ones
    max_points: int = 2000  # of a frame; of more, every so many
    disk: float = 1.02  # points up to here about the first guess are on the disk
    near_rim: float = 0.8  # points from here on tell where the rim is
    around_clamp: float = 1.6  # points further off tell nothing of the clamp's edge
    still: float = 0.01  # of the largest rise: points that move by less stand still
    sizes: tuple[float, ...] = tuple(np.arange(0.6, 1.55, 0.1).tolist())  # tried first


SEARCH = RimSearch()


@dataclass(frozen=True)
class Rim:
    """The clamped edge in the plane of the sheet.

    Attributes
    ----------
    x, y : float, mm
        The centre.
    angle : float, degrees
        Of the first semi-axis from x towards y, 0 for a circle.
    error : float, mm
        Standard error of the centre.
    turn_error : float, degrees
        Standard error of an angle that was found, 0 where it was not looked for.
    scale : float
        Semi-axes over those that are known.
    still : int
        Number of points beyond it that stand still, where it was found by these.
    """

    x: float
    y: float
    angle: float
    error: float
    turn_error: float = 0.0
    scale: float = 1.0
    still: int = 0


def rim_of_motion(
    surfaces: Sequence[RiseSurface],
    semi_axes: SemiAxes,
    start: tuple[float, float] = (0.0, 0.0),
    angle: float | None = None,
) -> Rim:
    """Find the rim of known size through which the sheet does not rise.

    The rise of every frame is a polynomial times a factor that is zero on the rim, about the centre
    that is looked for, and one constant, the frame's shift along z. Odd terms take what the sheet
    is not symmetric in: they cannot move the rim.

    Parameters
    ----------
    surfaces : sequence of ((n, 2) array, (n,) array), mm
        Positions in the plane and rises, by rising pressure: the last few are taken.
    semi_axes, start : (float, float), mm
        Of the rim; where the search for its centre starts.
    angle : float, degrees, or None
        Of the first semi-axis; found unless given where the axes differ.

    Raises
    ------
    InputError
        There are too few points, or none near the rim all around it.
    """
    is_turn_unknown = semi_axes[0] != semi_axes[1] and angle is None
    fixed_angle = 0.0 if angle is None else angle
    first_angle = _long_axis(*surfaces[-1], semi_axes) if is_turn_unknown else fixed_angle
    guess = np.array([*start, first_angle])
    on_disk = [_on_disk(*surface, guess, semi_axes) for surface in surfaces[-SEARCH.max_frames :]]
    terms = partial(_rim_terms, angle=fixed_angle, semi_axes=semi_axes)
    count = 3 if is_turn_unknown else 2
    steps = [semi_axes[0], semi_axes[0], 60.0][:count]
    anywhere = np.full(count, np.inf)
    best, covariance = _fit_outline(on_disk, terms, [guess[:count]], steps, anywhere)
    return Rim(
        x=float(best[0]),
        y=float(best[1]),
        angle=float(best[2]) % 180.0 if is_turn_unknown else fixed_angle,
        error=float(np.sqrt(np.trace(covariance[:2, :2]))),
        turn_error=float(np.sqrt(covariance[2, 2])) if is_turn_unknown else 0.0,
    )


def clamp_of_motion(
    surfaces: Sequence[RiseSurface], semi_axes: SemiAxes, angle: float = 0.0
) -> Rim | None:
    """Find the edge beyond which points stand still.

    The rise of every frame is a polynomial times a factor that is zero from the edge on, whose
    centre and size are looked for.

    Parameters
    ----------
    surfaces, semi_axes, angle
        As those of `rim_of_motion`, about the centre of the rim.

    Returns
    -------
    Rim or None
        None where too few points around the disk stand still.
    """
    scaled = []
    for surface in surfaces[-SEARCH.max_frames :]:
        points, rise = _around_clamp(*surface, semi_axes, angle)
        if len(rise) < MIN_POINTS or not np.abs(rise).max() > 0:
            return None
        scaled.append((points, rise / np.abs(rise).max()))
    # Too large a circle hides in the points that stand still: the best of several is the start.
    starts = [np.array([0.0, 0.0, size]) for size in SEARCH.sizes]
    reach = np.array([0.5 * semi_axes[1], 0.5 * semi_axes[1], 0.2])
    terms = partial(_clamp_terms, angle=angle, semi_axes=semi_axes)
    steps = [semi_axes[0], semi_axes[0], 1.0]
    best, covariance = _fit_outline(scaled, terms, starts, steps, reach)
    points, rise = scaled[-1]
    local = _in_sized_axes(points, best, angle, semi_axes)
    is_on_clamp = np.hypot(*local) > CLAMP_BEGINS
    if is_on_clamp.sum() < MIN_CLAMP_POINTS or not in_all_quarters(local[:, is_on_clamp].T):
        return None
    # What does not stand still is no clamp.
    level = np.median(rise[is_on_clamp])
    if np.median(np.abs(rise[is_on_clamp] - level)) > SEARCH.still:
        return None
    error = float(np.sqrt(np.trace(covariance[:2, :2])))
    x, y, size = map(float, best)
    return Rim(x, y, angle, error, scale=size, still=int(is_on_clamp.sum()))


def _around_clamp(points: Array, rise: Array, semi_axes: SemiAxes, angle: float) -> RiseSurface:
    """Return some of the points of a surface that can tell of the clamp, and their rises."""
    local = _in_semi_axes(points, np.array([0.0, 0.0, angle]), semi_axes)
    is_around = np.hypot(*local) < SEARCH.around_clamp
    rows = _thinned(int(is_around.sum()))
    return points[is_around][rows], rise[is_around][rows]


def _thinned(count: int) -> slice:
    """Return evenly spread rows of so many points: at most those of the search."""
    return slice(None, None, max(1, -(-count // SEARCH.max_points)))


def _fit_outline(
    surfaces: Sequence[RiseSurface],
    terms: Callable[[Array, Array], Array],
    starts: Sequence[Array],
    steps: Sequence[float],
    reach: Array,
) -> tuple[Array, Array]:
    """Return the outline whose terms follow the rises best, and its covariance.

    Parameters
    ----------
    surfaces : sequence of RiseSurface
    terms : callable
        Returns the terms (n, k) of the points (n, 2) for an outline (unknowns,).
    starts : sequence of (unknowns,) array
        Of which the best is taken.
    steps : sequence of float
        Typical changes of the unknowns.
    reach : (unknowns,) array
        How far from the start they may go.
    """
    residual = partial(_outline_residual, surfaces=surfaces, terms=terms)
    start = min(starts, key=lambda outline: np.linalg.norm(residual(outline)))
    bounds = start - reach, start + reach
    best = scipy.optimize.least_squares(residual, start, x_scale=steps, bounds=bounds)
    variance = 2 * best.cost / max(len(best.fun) - len(best.x), 1)
    return best.x, variance * np.linalg.pinv(best.jac.T @ best.jac)


def _outline_residual(
    outline: Array, surfaces: Sequence[RiseSurface], terms: Callable[[Array, Array], Array]
) -> Array:
    """Return the rises that the terms of an outline leave, over their best amplitudes."""
    residuals = []
    for points, rise in surfaces:
        orthogonal, _ = np.linalg.qr(terms(points, outline))
        residuals.append(rise - orthogonal @ (orthogonal.T @ rise))
    return np.concatenate(residuals)


def _rim_terms(points: Array, outline: Array, angle: float, semi_axes: SemiAxes) -> Array:
    """Return the terms of a rim (x, y) or (x, y, angle), its angle as given unless unknown."""
    return _terms(_in_semi_axes(points, np.append(outline, angle)[:3], semi_axes))


def _clamp_terms(points: Array, outline: Array, angle: float, semi_axes: SemiAxes) -> Array:
    """Return the terms of a clamp (x, y, size): they are zero from its edge on."""
    return _terms(_in_sized_axes(points, outline, angle, semi_axes), is_clamped=True)


def _terms(local: Array, is_clamped: bool = False) -> Array:
    """Return shapes (n, k) that vanish at the rim, and a shift, at coordinates (2, n)."""
    u, v = local
    factor = 1.0 - u**2 - v**2
    if is_clamped:
        factor = factor.clip(min=0.0)
    shapes = [factor * u**i * v**j for i, j in (*EVEN, *ODD)]
    return np.stack([*shapes, np.ones_like(u)], axis=1)


def _in_semi_axes(points: Array, outline: Array, semi_axes: SemiAxes) -> Array:
    """Return coordinates (2, n) about a centre x, y, turned by degrees, in semi-axes."""
    c = np.cos(np.radians(outline[2]))
    s = np.sin(np.radians(outline[2]))
    x, y = (points - outline[:2]).T
    u = (c * x + s * y) / semi_axes[0]
    v = (c * y - s * x) / semi_axes[1]
    return np.stack([u, v])


def _in_sized_axes(points: Array, outline: Array, angle: float, semi_axes: SemiAxes) -> Array:
    """Return coordinates (2, n) about the centre of an outline (x, y, size), in its semi-axes."""
    x, y, size = outline
    return _in_semi_axes(points, np.array([x, y, angle]), semi_axes) / size


def _long_axis(points: Array, rise: Array, semi_axes: SemiAxes) -> float:
    """Guess the turn of the first semi-axis, degrees: the rise spreads along the longer one."""
    weight = np.clip(rise, 0.0, None)
    centre = (weight[:, None] * points).sum(axis=0) / weight.sum()
    x, y = (points - centre).T
    xx = float((weight * (x * x)).sum())
    yy = float((weight * (y * y)).sum())
    xy = float((weight * (x * y)).sum())
    angle = np.degrees(0.5 * np.arctan2(2 * xy, xx - yy))
    return float(angle if semi_axes[0] > semi_axes[1] else angle + 90.0)


def _on_disk(points: Array, rise: Array, outline: Array, semi_axes: SemiAxes) -> RiseSurface:
    """Return some of the points within the rim, and their rises over the largest of them."""
    local = _in_semi_axes(points, outline, semi_axes)
    is_on_disk = np.hypot(*local) < SEARCH.disk
    if is_on_disk.sum() < MIN_POINTS:
        problem = f"expected at least {MIN_POINTS} points on the disk, got {int(is_on_disk.sum())}"
        raise InputError(None, "centre", f"{problem}; are the length unit and the radius right?")
    u, v = local[:, is_on_disk & (np.hypot(*local) > SEARCH.near_rim)]
    octant = np.arctan2(v, u) // (np.pi / 4)
    octants = np.unique(octant.astype(int))
    if len(octants) < 8:
        share = f"{1 - SEARCH.near_rim:.0%}"
        problem = f"points come within {share} of the rim in {len(octants)} of 8 directions"
        raise InputError(None, "centre", f"{problem} only; give the centre")
    rows = _thinned(int(is_on_disk.sum()))
    rise = rise[is_on_disk][rows]
    return points[is_on_disk][rows], rise / np.abs(rise).max()
