"""Polynomials of load over elongation, P(u) (thesis section 3.2 and Figure 3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .curves import LoadCurve
from .registry import read_file

Array = NDArray[np.float64]

MAX_ORDER = 12  # beyond, the powers of one elongation tell nothing apart


@dataclass(frozen=True, eq=False)
class LoadPolynomial:
    """A polynomial P(u) = c0 + c1 u + c2 u^2 + ...

    coefficients : (order + 1,) N, N/mm, N/mm^2 ..., lowest power first; c0 is there, 0 when the
    polynomial goes through the origin. end : mm, the largest elongation it was fitted to; beyond,
    it means nothing. r_squared : 1 - (squares left) / (squares about the mean load), as in Table
    3.1, also through the origin. NaN where not known. rmse : N, root of the mean square left. NaN
    where not known. points : how many it was fitted to; 0 where not known.
    """

    coefficients: Array
    end: float
    r_squared: float
    rmse: float
    points: int

    @property
    def order(self) -> int:
        return len(self.coefficients) - 1

    def __call__(self, elongation: ArrayLike) -> Array:
        """Return the load in N at elongations in mm, of the same shape."""
        at = np.asarray(elongation, dtype=float)
        return np.asarray(polynomial.polyval(at, self.coefficients))

    def slope(self, elongation: ArrayLike) -> Array:
        """Return dP/du in N/mm at elongations in mm, of the same shape."""
        at = np.asarray(elongation, dtype=float)
        return np.asarray(polynomial.polyval(at, polynomial.polyder(self.coefficients)))


def fit_load_polynomial(
    elongation: ArrayLike, load: ArrayLike, order: int = 4, through_origin: bool = True
) -> LoadPolynomial:
    """Fit a polynomial to the points (n,) mm and (n,) N by least squares.

    Raises InputError: an order out of range; points that are not finite, too few, or too close
    together for the order; loads that are all the same.
    """
    u, f = checked_points(elongation, load)
    terms, scale, lowest = terms_of(u, order, through_origin)
    solution, _, rank, _ = np.linalg.lstsq(terms, f, rcond=1e-13)
    if rank < terms.shape[1]:
        problem = f"the elongations settle only {rank} of {terms.shape[1]} coefficients; lower it"
        raise InputError(None, f"order {order}", problem)
    left = f - terms @ solution
    coefficients = np.zeros(order + 1)
    coefficients[lowest:] = solution / scale ** np.arange(lowest, order + 1)
    about_mean = ((f - f.mean()) ** 2).sum()
    r_squared = float(1.0 - (left**2).sum() / about_mean)
    return LoadPolynomial(
        coefficients, float(u.max()), r_squared, float(np.sqrt((left**2).mean())), len(u)
    )


@dataclass(frozen=True)
class SpecimenScatter:
    """Deviations of specimens from one polynomial, in N.

    specimens : their names. rms, mean : root mean square and mean of load - P(u), one a specimen.
    rmse : root mean square over all points. deviation : standard deviation of load - P(u) over
    all points about their own mean, n - 1 in the denominator: the published 21.7, 64.1 and 40.3 N.
    """

    specimens: tuple[str, ...]
    rms: tuple[float, ...]
    mean: tuple[float, ...]
    rmse: float
    deviation: float


def specimen_scatter(
    curves: LoadCurve | Sequence[LoadCurve], fitted: LoadPolynomial
) -> SpecimenScatter:
    """Return the scatter of one or several curves about a polynomial.

    Raises InputError: fewer than two points in all.
    """
    each = [curves] if isinstance(curves, LoadCurve) else list(curves)
    left = [curve.load - fitted(curve.elongation) for curve in each]
    together = np.concatenate([*left, np.zeros(0)])
    if len(together) < 2:
        raise InputError(None, "curves", f"scatter needs two points, there are {len(together)}")
    return SpecimenScatter(
        tuple(curve.specimen for curve in each),
        tuple(float(np.sqrt((one**2).mean())) for one in left),
        tuple(float(one.mean()) for one in left),
        float(np.sqrt((together**2).mean())),
        float(together.std(ddof=1)),
    )


def checked_points(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """Return the points as arrays (n,) mm and (n,) N.

    Raises InputError: counts that differ, numbers that are not finite, no elongation, one load
    only.
    """
    u, f = np.asarray(elongation, dtype=float), np.asarray(load, dtype=float)
    if u.ndim != 1 or u.shape != f.shape:
        problem = f"expected as many elongations as loads, got {u.size} and {f.size}"
        raise InputError(None, "elongation", problem)
    if not (np.isfinite(u).all() and np.isfinite(f).all()):
        raise InputError(None, "elongation", "expected finite numbers; leave out lost frames")
    if not len(u) or u.max() <= 0:
        raise InputError(None, "elongation", "expected points with elongation above 0 mm")
    if np.ptp(f) == 0:
        raise InputError(None, "load", f"all {len(f)} loads are {f[0]:g} N: nothing to fit")
    return u, f


def terms_of(u: Array, order: int, through_origin: bool) -> tuple[Array, float, int]:
    """Return powers (n, terms) of u / scale, the scale, and the lowest power.

    Raises InputError: an order out of range, or fewer points than coefficients.
    """
    if not 1 <= order <= MAX_ORDER:
        raise InputError(None, "order", f"expected 1 to {MAX_ORDER}, got {order}")
    lowest, scale = int(through_origin), float(np.abs(u).max())
    count = order + 1 - lowest
    if len(u) < count:
        problem = f"{count} coefficients need as many points, there are {len(u)}; lower it"
        raise InputError(None, f"order {order}", problem)
    return np.vander(u / scale, order + 1, increasing=True)[:, lowest:], scale, lowest


@dataclass(frozen=True, eq=False)
class PublishedPolynomial:
    """One direction's load over gauge elongation.

    direction : warp, fill or bias. gauge_length, final_length : mm, of the virtual strain gauge
    before the test and at its end. polynomial : its end is final - gauge length; R^2, RMSE and
    points are not in the file. scatter : N, standard deviation of the specimens about it, NaN
    where the file has none.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial
    scatter: float


def read_published_polynomials(
    path: Path | str, format: str | None = None
) -> dict[str, PublishedPolynomial]:
    """Read load polynomials by direction: N, of the full strip, over mm.

    format : name of the file's format; found by its content unless given.
    Raises InputError: naming file, line and column.
    """
    polynomials: dict[str, PublishedPolynomial] = read_file("load polynomials", path, format)
    return polynomials
