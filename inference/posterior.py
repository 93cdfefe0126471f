"""The posterior of a fit: a normal distribution within linear inequalities, and draws from it.

Draws outside are drawn again as long as enough lie inside. Where hardly any does (the optimum lies
on bounds), every draw is the end of a walk inside, along random directions in the shape of what is
allowed and likely, to a place drawn on that line between its ends (hit and run)."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import quadprog
import scipy

from ..compilation import compiled
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .unknowns import Unknowns

MOST_DRAWS = 20  # draws a wanted one, before it is a walk
STEPS_A_DIMENSION, STEPS = 12, 50  # steps of a walk: some a dimension, and some in any case
#: Standard deviations inside that a walk begins, as far as there is room.
INSIDE = (0.5, 0.1, 0.02, 1e-3, 1e-6)
NEWTON, HALVINGS = 40, 30  # steps of Newton's method, and halvings of one
BEYOND = 8.0  # standard deviations beyond a point inside that no draw goes
NONE = 1e-14  # of the largest variance: less is none
#: In standard deviations: bounds closer than this leave no room between them; what lies outside by
#: less is inside.
CLOSE, ROUNDING = 1e-9, 1e-9
FAR = 1e6  # standard deviations from the mean beyond which a place is no longer drawn
TAIL = -30.0  # standard deviations; and the least probability above a place
LEAST_CHANCE = 1e-17
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
DRAWS = 1000  # of which bands are made


@dataclass(frozen=True, eq=False)
class TruncatedNormal:
    """A normal distribution of y within linear inequalities, in standard deviations z.

    Attributes
    ----------
    allowed : (n,) array
        A value of y that keeps the inequalities; z = 0 there.
    to_y : (n, k) array
        y = allowed + to_y @ z.
    rows, least : (m, k) and (m,) arrays
        The inequalities, rows @ z >= least.
    centre : (k,) array
        Mean of z, whose covariance without inequalities is the identity.
    """

    allowed: Array
    to_y: Array
    rows: Array
    least: Array
    centre: Array

    @classmethod
    def of(
        cls, mean: Array, covariance: Array, inequalities: tuple[Array, Array], allowed: Array
    ) -> TruncatedNormal:
        """Return the distribution of y given A y >= c.

        Parameters
        ----------
        mean : (n,) array
            It may lie outside.
        covariance : (n, n) array
        inequalities : A (m, n), c (m,)
        allowed : (n,) array
            A point that keeps them, up to rounding.
        """
        a, c = inequalities
        c = np.minimum(c, a @ allowed)
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        sigma[sigma == 0.0] = 1.0
        variance, axes = np.linalg.eigh(covariance / np.outer(sigma, sigma))
        some = variance > NONE * max(variance[-1], 0.0)
        variance = variance[some]
        axes = axes[:, some]
        turn = _turn_to_reference(axes)
        root = sigma[:, None] * ((axes * np.sqrt(variance)) @ turn)
        # In standard deviations z, seen from the allowed point: rows @ z >= least.
        rows = a @ root
        least = c - a @ allowed
        size = np.linalg.norm(rows, axis=1)
        real = size > NONE * size.max(initial=0.0)
        rows = rows[real] / size[real, None]
        least = least[real] / size[real]
        centre = turn.T @ ((axes.T @ ((mean - allowed) / sigma)) / np.sqrt(variance))
        rows, least, centre, back = _without_equalities(rows, least, centre)
        return cls(allowed, root @ back, rows, least, centre)

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Return `count` draws of z (count, k)."""
        if not len(self.centre):
            return np.zeros((count, 0))
        inside: list[Array] = []
        for _ in range(MOST_DRAWS):
            draws = self.centre + random.standard_normal((count, len(self.centre)))
            keep = (draws @ self.rows.T >= self.least - ROUNDING).all(axis=1)
            inside.append(draws[keep])
            if sum(map(len, inside)) >= count:
                break
        drawn = np.concatenate(inside)[:count]
        if len(drawn) < count:
            drawn = _walked(self.rows, self.least, self.centre, count, random)
        return drawn

    def y(self, z: Array) -> Array:
        """Return y (count, n) at z (count, k)."""
        return np.asarray(self.allowed + z @ self.to_y.T)

    def values(self, functionals: Array, z: Array) -> Array:
        """Return values (count, m) of functionals (m, n) @ y, as many as there are draws z.

        Given all that is independent of it, the value of a functional is a truncated normal number:
        from draw to draw one at another share of its probability, all shares evenly. Without bounds
        nearby the values are those of the normal distribution without any chance in them.
        """
        ways = functionals @ self.to_y
        sigma = np.linalg.norm(ways, axis=1)
        ways = ways / np.where(sigma > 0, sigma, 1.0)[:, None]
        room = np.maximum(z @ self.rows.T - self.least, 0.0)
        near = room.min(axis=0) < 2 * BEYOND
        place = z @ ways.T - self.centre @ ways.T
        # The order of the draws is that of chance, and so is that of the shares.
        shares = (np.arange(len(z)) + 0.5) / len(z)
        normal = scipy.special.ndtri(shares)
        slopes = np.ascontiguousarray(ways @ self.rows[near].T)
        _spread(place, np.ascontiguousarray(room[:, near]), slopes, shares, normal)
        middle = functionals @ self.allowed + (self.centre @ ways.T) * sigma
        return np.asarray(middle + place * sigma)


@compiled()
def _spread(place, room, slopes, shares, normal):  # type: ignore[no-untyped-def]
    """Replace places (draws, m) along m directions by those at `shares` (draws,) of the allowed.
    room : (draws, bounds), of standard deviations. slopes : (m, bounds) of the bounds along the
    directions. normal : (draws,) standard normal numbers of those shares."""
    for k in range(place.shape[1]):
        for d in range(len(place)):
            low = -FAR
            high = FAR
            for i in range(slopes.shape[1]):
                slope = slopes[k, i]
                if slope > NONE:
                    low = max(low, place[d, k] - room[d, i] / slope)
                elif slope < -NONE:
                    high = min(high, place[d, k] - room[d, i] / slope)
            if low < -BEYOND and high > BEYOND:
                place[d, k] = normal[d]
            else:
                place[d, k] = _between(low, high, shares[d])


def truncated_draws(
    mean: Array,
    covariance: Array,
    inequalities: tuple[Array, Array],
    allowed: Array,
    count: int,
    random: np.random.Generator,
) -> Array:
    """Return `count` draws (count, n) of a `TruncatedNormal`."""
    distribution = TruncatedNormal.of(mean, covariance, inequalities, allowed)
    return distribution.y(distribution.draw(count, random))


def _turn_to_reference(basis: Array) -> Array:
    """Return the rotation Q (k, k) that makes an orthonormal basis (n, k) one that only its space
    decides: eigenvectors come with any sign, those of equal eigenvalues in any direction, as the
    processor rounds, and the same draws would be other laws. Q maximises tr(R' basis Q) with a
    fixed R: it is the orthogonal factor of the polar decomposition of basis' R."""
    reference = np.random.default_rng(0).standard_normal(basis.shape)
    left, _, right = np.linalg.svd(basis.T @ reference)
    return np.asarray(left @ right)


def _without_equalities(
    rows: Array, least: Array, centre: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the same within the plane that pairs of opposite inequalities leave."""
    opposite = rows @ rows.T < -1 + CLOSE
    held = np.flatnonzero((opposite & (least[:, None] + least > -CLOSE)).any(axis=1))
    if not len(held):
        return rows, least, centre, np.eye(len(centre))
    _, size, right = np.linalg.svd(rows[held])
    free = right[int((size > 1e-6).sum()) :].T
    free = free @ _turn_to_reference(free)
    others = rows @ free
    some = np.linalg.norm(others, axis=1) > 1e-6
    return others[some], least[some], free.T @ centre, free


def _walked(
    rows: Array, least: Array, centre: Array, count: int, random: np.random.Generator
) -> Array:
    start, root = _start(rows, least, centre)
    # Most inequalities are so far away that no walk meets them.
    near = rows @ centre - least < np.linalg.norm(start - centre) + BEYOND
    rows = rows[near]
    least = least[near]
    steps = STEPS + STEPS_A_DIMENSION * len(centre)
    # A step of all walks has one direction, and each walk a place of its own on that line.
    ways = random.standard_normal((steps, len(centre))) @ root.T
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    slopes = ways @ rows.T
    slopes[np.abs(slopes) < NONE] = NONE
    away = np.tile(start - centre, (count, 1))
    room = np.minimum(least - rows @ start, 0.0)
    _walk(away, room, ways, slopes, 1.0 / slopes, random.random((count, steps)))
    return np.asarray(centre + away)


@compiled(fastmath=True)
def _walk(away, begin, ways, slopes, inverse, share):  # type: ignore[no-untyped-def]
    """Walk from `away` (count, n), in place, along ways (steps, n) of unit length.
    begin : (m,) least less rows @ place, at most zero. slopes : (steps, m) rows @ way, inverse
    1/slopes. share : (count, steps) between 0 and 1, of the probability on each line."""
    steps, n = ways.shape
    room = np.empty(len(begin))
    for d in range(len(away)):
        for i in range(len(begin)):
            room[i] = begin[i]
        for s in range(steps):
            ahead = FAR
            behind = -FAR
            for i in range(len(room)):
                reach = room[i] * inverse[s, i]
                ahead = min(ahead, reach if inverse[s, i] < 0.0 else FAR)
                behind = max(behind, reach if inverse[s, i] > 0.0 else -FAR)
            nearest = 0.0
            for j in range(n):
                nearest -= ways[s, j] * away[d, j]
            move = nearest + _between(behind - nearest, ahead - nearest, share[d, s])
            for j in range(n):
                away[d, j] += move * ways[s, j]
            for i in range(len(room)):
                room[i] = min(room[i] - move * slopes[s, i], 0.0)


@compiled()
def _between(low: float, high: float, share: float) -> float:
    """Return a standard normal number between two ends, at a share of the probability."""
    flip = low > 0.0  # the lower tail has the digits
    if flip:
        low, high = -high, -low
    if high < TAIL:
        # There the density is that of an exponential distribution.
        found = high - math.log(share + (1.0 - share) * math.exp((high - low) * high)) / high
    else:
        chance = (1.0 - share) * _below(low) + share * _below(high)
        found = _quantile(chance) if chance < 0.5 else -_quantile(max(1.0 - chance, LEAST_CHANCE))
    found = min(max(found, low), high)
    return -found if flip else found


@compiled()
def _below(x: float) -> float:
    return 0.5 * math.erfc(-x * math.sqrt(0.5))


@compiled()
def _quantile(chance: float) -> float:
    """Return x with the probability `chance`, at most a half, below it.
    Newton's method on its logarithm, which is concave, from a bound below the root."""
    x = -math.sqrt(max(-2.0 * math.log(2.0 * chance), 0.0))
    wanted = math.log(chance)
    for _ in range(NEWTON):
        below = _below(x)
        step = (wanted - math.log(below)) * below * ROOT_TWO_PI * math.exp(0.5 * x * x)
        x += step
        if abs(step) < 1e-9:
            break
    return x


def _start(rows: Array, least: Array, centre: Array) -> tuple[Array, Array]:
    """Return a point inside, and a root (n, n) of the shape of what is likely around it.
    It minimises |z - centre|^2 / 2 - sum log(rows z - least), whose inverse curvature is the shape.
    """
    place = np.zeros_like(centre)
    for way in INSIDE:  # the point nearest to the centre that is some way inside
        with suppress(ValueError):
            place = quadprog.solve_qp(np.eye(len(centre)), centre, rows.T, least + way)[0]
            break
    value, slope, factor = _barrier(rows, least, centre, place)
    for _ in range(NEWTON):
        root = _root(factor)
        step = -root @ (root.T @ slope)
        share = 1.0
        for _ in range(HALVINGS):
            trial = _barrier(rows, least, centre, place + share * step)
            if trial[0] < value:
                place = place + share * step
                value, slope, factor = trial
                break
            share /= 2
        else:
            break
    return place, _root(factor)


def _root(factor: Array) -> Array:
    """Return a root of the inverse of factor' factor, which would lose all digits if formed."""
    upper: Array = np.linalg.qr(factor).R
    upper *= np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]
    return np.asarray(scipy.linalg.solve_triangular(upper, np.eye(len(upper))))


def _barrier(rows: Array, least: Array, centre: Array, place: Array) -> tuple[float, Array, Array]:
    """Return value (infinite outside), slope, and a factor F of the curvature F' F."""
    away = place - centre
    room = rows @ place - least
    if (room <= 0).any():
        return np.inf, away, np.eye(len(away))
    by_room = rows / room[:, None]
    factor = np.vstack([np.eye(len(away)), by_room])
    return float(away @ away / 2 - np.log(room).sum()), away - by_room.sum(axis=0), factor


@dataclass(frozen=True, eq=False)
class Posterior:
    """The unknowns as the noise of the data leaves them.
    unknowns : their order, units, bounds and inequalities. best : (n,), keeps the inequalities.
    centre : (n,) without inequalities: where none binds, the best. covariance : (n, n) without
    them."""

    unknowns: Unknowns
    best: Array
    centre: Array
    covariance: Array

    @cached_property
    def coefficients(self) -> Array:
        """Return the covariance of the free coefficients, MPa, and of the nuisance in its units."""
        n = self.unknowns.count
        size = self.unknowns.size
        t = np.eye(n)
        t[:size, :size] = self.unknowns.to_coefficients
        return np.asarray(t @ self.covariance @ t.T)

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the rows of `coefficients`."""
        return (*self.unknowns.labels, *self.unknowns.nuisance.names)

    @property
    def correlations(self) -> Array:
        """Return the correlations that belong to `coefficients`."""
        sigma = np.sqrt(np.diag(self.coefficients))
        unit = np.where(sigma > 0, sigma, 1.0)
        return np.asarray(self.coefficients / unit / unit[:, None])

    def shifted(self, step: Array, centre: Array, share: float) -> Posterior:
        """Return the posterior about best + step and another centre.
        share : of the step, by which the other best is uncertain (one standard deviation)."""
        covariance = self.covariance + share**2 * np.outer(step, step)
        return Posterior(self.unknowns, self.best + step, centre, covariance)

    def with_information(self, more: Array) -> Posterior:
        """Return the posterior with independent data that agree with the best.

        Parameters
        ----------
        more : (size, size) array
            Fisher information of those data on the unknowns of the law.
        """
        size = self.unknowns.size
        count = self.unknowns.count
        values, axes = np.linalg.eigh(more)
        slopes = np.zeros((count, size))
        slopes[:size] = axes * np.sqrt(np.maximum(values, 0.0))
        gained = self.covariance @ slopes
        inner = np.eye(size) + slopes.T @ gained
        gain = np.linalg.solve(inner, gained.T).T
        covariance = self.covariance - gain @ gained.T
        centre = self.centre - gain @ (slopes.T @ (self.centre - self.best))
        covariance = 0.5 * (covariance + covariance.T)
        return Posterior(self.unknowns, self.best, np.asarray(centre), covariance)

    @cached_property
    def distribution(self) -> TruncatedNormal:
        """Return the distribution of the unknowns within bounds and inequalities."""
        pairs = zip(self.unknowns.inequalities, self.unknowns.work_rows(self.best), strict=True)
        a, c = (np.concatenate(pair) for pair in pairs)
        c = np.minimum(c, a @ self.best)  # steps of a fit keep off the bound of the work
        return TruncatedNormal.of(self.centre, self.covariance, (a, c), self.best)

    def sample(self, count: int, random: np.random.Generator) -> Array:
        """Return `count` draws of all unknowns (count, n), all of which keep the inequalities."""
        return self.distribution.y(self.distribution.draw(count, random))

    @cached_property
    def _draws(self) -> Array:
        """Return `DRAWS` draws, always the same ones, of the standardised unknowns."""
        return self.distribution.draw(DRAWS, np.random.default_rng(0))

    @property
    def law_draws(self) -> Array:
        """Return `DRAWS` draws of the law's unknowns, always the same ones."""
        return self.distribution.y(self._draws)[:, : self.unknowns.size]

    def moduli(self, name: str, strain: Array) -> Array:
        """Return a modulus (MPa) of the law's distribution at strains (n,): (DRAWS, n)."""
        unknowns = self.unknowns
        rows = np.zeros((len(strain), unknowns.count))
        rows[:, : unknowns.size] = unknowns.rows(name, strain) @ unknowns.to_coefficients
        return self.distribution.values(rows, self._draws)

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """Return `count` random laws that the data allow, all within the bounds."""
        return [self.unknowns.law(law, y) for y in self.sample(count, random)]
