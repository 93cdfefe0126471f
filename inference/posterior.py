"""The posterior of a fit: a normal distribution of its unknowns within linear inequalities.

As long as enough draws of the normal distribution keep the inequalities, the others are rejected.
Where hardly any does (the optimum of a fit lies on bounds), every draw is the end of a random walk
within the inequalities. A step of it goes along a random direction, to a place that is drawn from
the distribution on that line (hit and run).

References
----------
R. L. Smith, Efficient Monte Carlo procedures for generating points uniformly distributed over
bounded regions, Oper. Res. 32 (1984) 1296.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import quadprog
import scipy

from ..compilation import compiled
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .unknowns import Unknowns

DRAWS = 1000  # number of draws from which bands are made


@dataclass(frozen=True, eq=False)
class Posterior:
    """The distribution of the unknowns that the data leave: normal within linear inequalities.

    Attributes
    ----------
    unknowns : Unknowns
        Order, units, bounds and inequalities of the n unknowns.
    best : (n,) array
        Unknowns of the reported law, which keep the inequalities.
    centre : (n,) array
        Mean of the normal distribution without its inequalities; it equals `best` unless one of
        them is active there.
    covariance : (n, n) array
        Covariance of the normal distribution without its inequalities.
    """

    unknowns: Unknowns
    best: Array
    centre: Array
    covariance: Array

    @cached_property
    def coefficient_covariance(self) -> Array:
        """Return the covariance (n, n) of the free coefficients, MPa, and nuisance parameters."""
        n = self.unknowns.count
        size = self.unknowns.size
        t = np.eye(n)
        t[:size, :size] = self.unknowns.to_coefficients
        return t @ self.covariance @ t.T

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the rows of `coefficient_covariance`."""
        return (*self.unknowns.labels, *self.unknowns.nuisance.names)

    @property
    def correlations(self) -> Array:
        """Return the correlation matrix (n, n) of the covariance `coefficient_covariance`."""
        sigma = np.sqrt(np.diag(self.coefficient_covariance))
        unit = np.where(sigma > 0, sigma, 1.0)
        return self.coefficient_covariance / unit / unit[:, None]

    def shifted(self, step: Array, centre: Array, share: float) -> Posterior:
        """Return the posterior about other unknowns, with an uncertainty of the step to them.

        Parameters
        ----------
        step : (n,) array
            Change from `best` to the best of the returned posterior.
        centre : (n,) array
            Centre of the returned posterior.
        share : float
            Standard deviation of the step, as a share of it.
        """
        covariance = self.covariance + share**2 * np.outer(step, step)
        best = self.best + step
        return replace(self, best=best, centre=centre, covariance=covariance)

    def with_information(self, information: Array) -> Posterior:
        """Return the posterior after further independent data that agree with the best.

        Parameters
        ----------
        information : (size, size) array
            Fisher information of those data on as many unknowns, from the first.
        """
        size = len(information)
        count = self.unknowns.count
        values, axes = np.linalg.eigh(information)
        slopes = np.zeros((count, size))
        slopes[:size] = axes * np.sqrt(np.maximum(values, 0.0))
        cross_covariance = self.covariance @ slopes
        data_covariance = np.eye(size) + slopes.T @ cross_covariance
        gain = np.linalg.solve(data_covariance, cross_covariance.T).T
        covariance = self.covariance - gain @ cross_covariance.T
        centre = self.centre - gain @ (slopes.T @ (self.centre - self.best))
        covariance = 0.5 * (covariance + covariance.T)
        return Posterior(self.unknowns, self.best, np.asarray(centre), covariance)

    @cached_property
    def distribution(self) -> TruncatedNormal:
        """Return the distribution of the unknowns within bounds and inequalities."""
        rows, limits = self.unknowns.inequalities
        work_rows, work_limits = self.unknowns.work_rows(self.best)
        a = np.concatenate([rows, work_rows])
        c = np.concatenate([limits, work_limits])
        c = np.minimum(c, a @ self.best)  # steps of a fit keep off the bound of the work
        return TruncatedNormal.of(self.centre, self.covariance, (a, c), self.best)

    def sample(self, count: int, random: np.random.Generator) -> Array:
        """Return draws of all unknowns, all of which keep the inequalities.

        Parameters
        ----------
        count : int
        random : Generator

        Returns
        -------
        (count, n) array
        """
        return self.distribution.y(self.distribution.draw(count, random))

    @cached_property
    def _draws(self) -> Array:
        """Return `DRAWS` draws, always the same ones, of the standardised unknowns."""
        return self.distribution.draw(DRAWS, np.random.default_rng(0))

    @property
    def law_draws(self) -> Array:
        """Return `DRAWS` draws of the law's unknowns, always the same ones."""
        return self.distribution.y(self._draws)[:, : self.unknowns.size]

    def modulus_samples(self, name: str, strain: Array) -> Array:
        """Return samples of a modulus from the distribution.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains.

        Returns
        -------
        (DRAWS, n) array, MPa
            Samples of the modulus at each strain, see `TruncatedNormal.values`.
        """
        rows = self.unknowns.modulus_rows(name, strain)
        return self.distribution.values(rows, self._draws)

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """Return random laws from the distribution, all within the bounds.

        Parameters
        ----------
        law : HypoelasticLaw
            Law from which all is taken that is no unknown of the fit.
        count : int
            Number of laws.
        random : Generator
        """
        return [self.unknowns.law(law, y) for y in self.sample(count, random)]


MAX_REJECTION_ROUNDS = 20  # rounds of as many draws as are wanted, before walks take over
MIN_WALK_STEPS = 50
WALK_STEPS_PER_DIMENSION = 12  # further steps
#: Margins, in standard deviations, by which the first point of a walk keeps the inequalities: the
#: largest for which there is room.
INNER_MARGINS = (0.5, 0.1, 0.02, 1e-3, 1e-6)
MAX_NEWTON_STEPS = 40
MAX_HALVINGS = 30  # of a Newton step
FARTHEST_DRAW = 8.0  # standard deviations from a point inside: no draw goes farther
NEGLIGIBLE = 1e-14  # a variance below this share of the largest, or a slope below it, is zero
MIN_ROOM = 1e-9  # standard deviations: bounds closer than this leave no room between them
TOLERATED_VIOLATION = 1e-9  # standard deviations: what lies outside by less is inside
FAR_AWAY = 1e6  # standard deviations from the mean beyond which a place is no longer drawn
TAIL = -30.0  # standard deviations: below, the density is taken for exponential
MIN_PROBABILITY = 1e-17  # above a place
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True, eq=False)
class TruncatedNormal:
    """A normal distribution of y within linear inequalities, in standardised variables z.

    Attributes
    ----------
    allowed : (n,) array
        A value of y that keeps the inequalities; z = 0 there.
    to_y : (n, k) array
        Matrix of y = allowed + to_y @ z.
    rows, limits : (m, k) and (m,) arrays
        The inequalities, rows @ z >= limits.
    centre : (k,) array
        Mean of z, whose covariance without inequalities is the identity.
    """

    allowed: Array
    to_y: Array
    rows: Array
    limits: Array
    centre: Array

    @classmethod
    def of(
        cls, mean: Array, covariance: Array, inequalities: tuple[Array, Array], allowed: Array
    ) -> TruncatedNormal:
        """Return the distribution of y given A y >= c.

        Parameters
        ----------
        mean : (n,) array
            Mean without the inequalities, which it need not keep.
        covariance : (n, n) array
            Covariance without the inequalities.
        inequalities : (A, c)
            Arrays (m, n) and (m,).
        allowed : (n,) array
            A point that keeps the inequalities, up to rounding.
        """
        a, c = inequalities
        c = np.minimum(c, a @ allowed)
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sigma[sigma == 0.0] = 1.0
        variance, axes = np.linalg.eigh(covariance / np.outer(sigma, sigma))
        varies = variance > NEGLIGIBLE * max(variance[-1], 0.0)
        variance = variance[varies]
        axes = axes[:, varies]
        rotation = _rotation_to_reference(axes)
        root = sigma[:, None] * ((axes * np.sqrt(variance)) @ rotation)
        # In standard deviations z, seen from the allowed point: rows @ z >= limits.
        rows = a @ root
        limits = c - a @ allowed
        size = np.linalg.norm(rows, axis=1)
        can_bind = size > NEGLIGIBLE * size.max(initial=0.0)
        rows = rows[can_bind] / size[can_bind, None]
        limits = limits[can_bind] / size[can_bind]
        standardised = (axes.T @ ((mean - allowed) / sigma)) / np.sqrt(variance)
        centre = rotation.T @ standardised
        rows, limits, centre, plane = _without_equalities(rows, limits, centre)
        return cls(allowed, root @ plane, rows, limits, centre)

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Return `count` draws of z (count, k)."""
        dimension = len(self.centre)
        if not dimension:
            return np.zeros((count, 0))
        inner_draws: list[Array] = []
        for _ in range(MAX_REJECTION_ROUNDS):
            draws = self.centre + random.standard_normal((count, dimension))
            is_inside = (draws @ self.rows.T >= self.limits - TOLERATED_VIOLATION).all(axis=1)
            inner_draws.append(draws[is_inside])
            if sum(map(len, inner_draws)) >= count:
                return np.concatenate(inner_draws)[:count]
        return _walk_ends(self.rows, self.limits, self.centre, count, random)

    def y(self, z: Array) -> Array:
        """Return y (count, n) at z (count, k)."""
        return self.allowed + z @ self.to_y.T

    def values(self, functionals: Array, z: Array) -> Array:
        """Return samples of linear functionals of y, with less scatter than the draws themselves.

        Given everything of a draw that is independent of it, a functional has a truncated normal
        distribution. Each draw takes the value of another quantile of this distribution, evenly
        spaced over all draws. Where no bound is near, the samples are thus evenly spaced quantiles
        of the normal distribution, without any randomness.

        Parameters
        ----------
        functionals : (m, n) array
            Their coefficients: the functionals are functionals @ y.
        z : (count, k) array
            Draws, as `draw` returns them.

        Returns
        -------
        (count, m) array
        """
        directions = functionals @ self.to_y
        sigma = np.linalg.norm(directions, axis=1)
        directions = directions / np.where(sigma > 0, sigma, 1.0)[:, None]
        room = np.maximum(self.rows @ z.T - self.limits[:, None], 0.0)
        may_bind = room.min(axis=1) < 2 * FARTHEST_DRAW
        place = directions @ (z - self.centre).T
        # As draws come in random order, increasing shares meet them at random.
        shares = (np.arange(len(z)) + 0.5) / len(z)
        normal = scipy.special.ndtri(shares)
        slopes = np.ascontiguousarray(directions @ self.rows[may_bind].T)
        _spread(place, room[may_bind], slopes, shares, normal)
        middle = functionals @ self.allowed + (directions @ self.centre) * sigma
        return middle + place.T * sigma


@compiled(fastmath=True)
def _spread(place, room, slopes, shares, normal):  # type: ignore[no-untyped-def]
    """Replace places (m, draws) along m directions by quantiles between the bounds on each line.

    Parameters
    ----------
    place : (m, draws) array
        Written.
    room : (bounds, draws) array
        By how much a draw keeps each bound, in standard deviations.
    slopes : (m, bounds) array
        Change of that room along each direction.
    shares : (draws,) array
        Probabilities of the quantiles.
    normal : (draws,) array
        Standard normal quantiles of them, for lines without a bound nearby.
    """
    low = np.empty(len(shares))
    high = np.empty(len(shares))
    for k in range(len(place)):
        low[:] = -FAR_AWAY
        high[:] = FAR_AWAY
        for i in range(len(room)):
            slope = slopes[k, i]
            if slope > NEGLIGIBLE:
                inverse = 1.0 / slope
                for d in range(len(shares)):
                    low[d] = max(low[d], place[k, d] - room[i, d] * inverse)
            elif slope < -NEGLIGIBLE:
                inverse = 1.0 / slope
                for d in range(len(shares)):
                    high[d] = min(high[d], place[k, d] - room[i, d] * inverse)
        for d in range(len(shares)):
            if low[d] < -FARTHEST_DRAW and high[d] > FARTHEST_DRAW:
                place[k, d] = normal[d]
            else:
                place[k, d] = _between(low[d], high[d], shares[d])


def _rotation_to_reference(basis: Array) -> Array:
    """Return the rotation Q (k, k) that makes an orthonormal basis (n, k) a reproducible one.

    Eigenvectors come with any sign, those of equal eigenvalues in any direction, as the processor
    rounds, and the same draws would be other laws; basis @ Q is decided by its space only. Q
    maximises tr(R' basis Q) with a fixed R: it is the orthogonal factor of the polar decomposition
    of basis' R.
    """
    reference = np.random.default_rng(0).standard_normal(basis.shape)
    left, _, right = np.linalg.svd(basis.T @ reference)
    return left @ right


def _without_equalities(
    rows: Array, limits: Array, centre: Array
) -> tuple[Array, Array, Array, Array]:
    """Replace pairs of opposite inequalities that leave no room by the plane between them.

    The plane passes through z = 0, for no limit is above zero. rows @ z >= limits holds of what is
    given and of what is returned; the last array (dimensions before, k) is P of
    z_before = P @ z_after, with k the dimension of the plane.

    Parameters
    ----------
    rows, limits : (m, n) and (m,) arrays
        Rows of unit length.
    centre : (n,) array
        Mean of z.
    """
    is_opposite = rows @ rows.T < -1 + MIN_ROOM
    leaves_no_room = limits[:, None] + limits > -MIN_ROOM
    equalities = np.flatnonzero((is_opposite & leaves_no_room).any(axis=1))
    if not len(equalities):
        return rows, limits, centre, np.eye(len(centre))
    _, size, right = np.linalg.svd(rows[equalities])
    plane = right[int((size > 1e-6).sum()) :].T
    plane = plane @ _rotation_to_reference(plane)
    plane_rows = rows @ plane
    can_bind = np.linalg.norm(plane_rows, axis=1) > 1e-6
    return plane_rows[can_bind], limits[can_bind], plane.T @ centre, plane


def _walk_ends(
    rows: Array, limits: Array, centre: Array, count: int, random: np.random.Generator
) -> Array:
    """Return the ends (count, k) of walks inside the inequalities.

    Parameters
    ----------
    rows, limits : (m, k) and (m,) arrays
        Of rows @ z >= limits.
    centre : (k,) array
        Mean of z without them.
    """
    start, root = _start(rows, limits, centre)
    # Most inequalities are so far away that no walk meets them.
    reach = np.linalg.norm(start - centre) + FARTHEST_DRAW
    may_bind = rows @ centre - limits < reach
    rows = rows[may_bind]
    limits = limits[may_bind]
    steps = MIN_WALK_STEPS + WALK_STEPS_PER_DIMENSION * len(centre)
    # A step of all walks has one direction, and each walk a place of its own on that line.
    directions = random.standard_normal((steps, len(centre))) @ root.T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    slopes = directions @ rows.T
    slopes[np.abs(slopes) < NEGLIGIBLE] = NEGLIGIBLE
    place = np.tile((start - centre)[:, None], count)
    room = np.tile(np.minimum(limits - rows @ start, 0.0)[:, None], count)
    shares = np.ascontiguousarray(random.random((count, steps)).T)
    _walk(place, room, directions, slopes, shares)
    return centre + place.T


@compiled(fastmath=True)
def _walk(place, room, directions, slopes, shares):  # type: ignore[no-untyped-def]
    """Walk from each place along the directions, in place.

    Parameters
    ----------
    place : (n, count) array
        Places less the centre; written.
    room : (m, count) array
        Limits less rows @ place, at most zero; written.
    directions : (steps, n) array
        Of unit length.
    slopes : (steps, m) array
        rows @ direction.
    shares : (steps, count) array
        Share of the probability on each line where the step ends, between 0 and 1.
    """
    count = shares.shape[1]
    ahead = np.empty(count)
    behind = np.empty(count)
    move = np.empty(count)
    for s in range(len(shares)):
        ahead[:] = FAR_AWAY
        behind[:] = -FAR_AWAY
        move[:] = 0.0
        for i in range(len(room)):
            inverse = 1.0 / slopes[s, i]
            if inverse < 0.0:
                for d in range(count):
                    ahead[d] = min(ahead[d], room[i, d] * inverse)
            else:
                for d in range(count):
                    behind[d] = max(behind[d], room[i, d] * inverse)
        for j in range(len(place)):
            for d in range(count):
                move[d] -= directions[s, j] * place[j, d]
        # From the place nearest to the centre.
        for d in range(count):
            move[d] += _between(behind[d] - move[d], ahead[d] - move[d], shares[s, d])
        for j in range(len(place)):
            for d in range(count):
                place[j, d] += move[d] * directions[s, j]
        for i in range(len(room)):
            for d in range(count):
                room[i, d] = min(room[i, d] - move[d] * slopes[s, i], 0.0)


@compiled()
def _between(low: float, high: float, share: float) -> float:
    """Return the quantile `share` of a standard normal number truncated to low .. high.

    Where low is above zero, the share is counted from above; a low end that only rounding puts
    there is at zero.
    """
    flip = low > MIN_ROOM  # the lower tail has the digits
    if flip:
        low, high = -high, -low
    if high < TAIL:
        # There the density is that of an exponential distribution.
        value = high - math.log(share + (1.0 - share) * math.exp((high - low) * high)) / high
    else:
        chance = (1.0 - share) * _probability_below(low) + share * _probability_below(high)
        if chance < 0.5:
            value = _quantile(chance)
        else:
            value = -_quantile(max(1.0 - chance, MIN_PROBABILITY))
    value = min(max(value, low), high)
    return -value if flip else value


@compiled()
def _probability_below(x: float) -> float:
    """Return the standard normal distribution function."""
    return 0.5 * math.erfc(-x * math.sqrt(0.5))


@compiled()
def _quantile(chance: float) -> float:
    """Return x with the probability `chance`, at most a half, below it.

    The approximation errs by less than 5e-4, and by 1e-8 after a step of Halley's method.

    References
    ----------
    M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions (1964), 26.2.23.
    """
    t = math.sqrt(max(-2.0 * math.log(chance), 0.0))
    rational = 2.515517 + t * (0.802853 + t * 0.010328)
    x = rational / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308))) - t
    newton_step = (chance - _probability_below(x)) * ROOT_TWO_PI * math.exp(0.5 * x * x)
    return x + newton_step / (1.0 - 0.5 * x * newton_step)


def _start(rows: Array, limits: Array, centre: Array) -> tuple[Array, Array]:
    """Return a point inside, and a root (n, n) of the shape of what is likely around it.

    The point minimises |z - centre|^2 / 2 - sum log(rows z - limits), whose inverse curvature is
    the shape.
    """
    place = _inner_point(rows, limits, centre)
    value, slope, factor = _barrier(rows, limits, centre, place)
    for _ in range(MAX_NEWTON_STEPS):
        root = _root(factor)
        step = -root @ (root.T @ slope)
        share = 1.0
        for _ in range(MAX_HALVINGS):
            trial = _barrier(rows, limits, centre, place + share * step)
            if trial[0] < value:
                place = place + share * step
                value, slope, factor = trial
                break
            share /= 2
        else:
            break
    return place, _root(factor)


def _inner_point(rows: Array, limits: Array, centre: Array) -> Array:
    """Return the point nearest to the centre that is inside by the largest possible margin.

    Parameters
    ----------
    rows, limits : (m, k) and (m,) arrays
        Of rows @ z >= limits.
    centre : (k,) array
        Mean of z without them.
    """
    for margin in INNER_MARGINS:
        with suppress(ValueError):
            solution = quadprog.solve_qp(np.eye(len(centre)), centre, rows.T, limits + margin)
            return solution[0]
    return np.zeros_like(centre)


def _root(factor: Array) -> Array:
    """Return a root of the inverse of factor' factor, which would lose all digits if formed."""
    upper: Array = np.linalg.qr(factor).R
    upper *= np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]
    return scipy.linalg.solve_triangular(upper, np.eye(len(upper)))


def _barrier(rows: Array, limits: Array, centre: Array, place: Array) -> tuple[float, Array, Array]:
    """Return value (infinite outside), slope (k,), and a factor F (., k) of the curvature F' F.

    Parameters
    ----------
    rows, limits : (m, k) and (m,) arrays
        Of rows @ z >= limits.
    centre : (k,) array
        Mean of z without them.
    place : (k,) array
        Where the barrier is evaluated.
    """
    deviation = place - centre
    room = rows @ place - limits
    if (room <= 0).any():
        return np.inf, deviation, np.eye(len(deviation))
    scaled_rows = rows / room[:, None]
    factor = np.vstack([np.eye(len(deviation)), scaled_rows])
    value = float(deviation @ deviation / 2 - np.log(room).sum())
    return value, deviation - scaled_rows.sum(axis=0), factor
