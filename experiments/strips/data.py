"""The data of strips of one direction: load curves, their polynomial, and the shape of the curve.

The shape is the order of the polynomial, and the breaks between the three regions of the curve.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...inference.objective import NoiseIs
from ...readers.curves import (
    CURVES_FILE,
    LoadCurve,
    LoadPolynomial,
    checked_points,
    fit_load_polynomial,
    terms_of,
)
from ...readers.frames import FrameSource
from ...readers.registry import format_of
from ...solvers.base import Array
from ..data_files import DataFile

#: Reasons, in run records, why measured points are not matched.
BELOW_ZERO = "elongation below zero"
BEYOND_END = "beyond the final length"


@dataclass(frozen=True, eq=False)
class Strip:
    """Data of all strips of one direction.

    Attributes
    ----------
    direction : str
        "warp", "fill" or "bias".
    gauge_length, final_length : float, mm
        Length of the virtual strain gauge at rest, and where the model ends.
    polynomial : LoadPolynomial or None
        Load over elongation, given or fitted to the curves; None in a forward analysis without
        data.
    curves : tuple of LoadCurve
        Measured load curves, one for each specimen.
    scatter : float, N, or None
        Standard deviation of measured points about the polynomial.
    through_origin : bool
        Whether the polynomial is zero at no elongation.
    open_end : bool
        Whether the final length was not given, but is where the measured points end.
    published : Path or None
        File of the polynomial, where it is given and not fitted.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial | None = None
    curves: tuple[LoadCurve, ...] = ()
    scatter: float | None = None
    through_origin: bool = True
    open_end: bool = False
    published: Path | None = None

    @property
    def elongation(self) -> float:
        """Return the elongation of the gauge at the end, mm."""
        return self.final_length - self.gauge_length

    def end_strain(self, mask: NDArray[np.bool_] | None = None) -> float:
        """Return the logarithmic strain of the gauge at its final length.

        Where that length was not given, it is that of the last of the `points` that `mask` keeps.
        """
        end = self._end_of(mask) if self.open_end else self.elongation
        return float(np.log1p(end / self.gauge_length))

    @property
    def points(self) -> tuple[Array, Array]:
        """Return elongation (n,) mm and load (n,) N of all specimens, sorted by elongation.

        Points below zero elongation and beyond the final length are left out.
        """
        return self._points_to_end[:2]

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Return for each of the `points` the index (n,) of its specimen in `curves`."""
        return self._points_to_end[2]

    def poissons_ratio(self) -> float | None:
        """Return minus the slope of lateral over axial strain, the mean of the specimens.

        The slope is that of a straight line up to the final length. None without lateral strains.
        """
        ratios = []
        for curve in self.curves:
            is_used = curve.elongation <= self.elongation
            if curve.lateral is not None and is_used.any():
                strain = curve.elongation[is_used] / self.gauge_length
                ratios.append(-np.polyfit(strain, curve.lateral[is_used], 1)[0])
        return float(np.mean(ratios)) if ratios else None

    @property
    def unmatched_count(self) -> int:
        """Return how many measured points are not among the `points`."""
        return sum(len(c.load) for c in self.curves) - len(self.points[0])

    def noise(
        self, largest: float, stated: float | None = None, *, accuracy: float = 0.005
    ) -> tuple[float, NoiseIs]:
        """Return the standard deviation of one load, N, and where that number comes from.

        Parameters
        ----------
        largest : float, N
            Largest measured load.
        stated : float, N, or None
            Noise that the project states; it is taken first, then the scatter of the points.
        accuracy : float
            Accuracy of the load cell as a share of the largest load, taken where neither is known.
            The load cell of the thesis is of class 0.5 %.
        """
        if stated is not None:
            return stated, "given"
        if self.scatter is not None:
            return self.scatter, "specimens' scatter"
        return accuracy * largest, "assumed"

    def data_files(self, by_points: bool) -> list[DataFile]:
        """Return the files of the load curves, with how many rows of each were used.

        `by_points` says whether measured points are matched: then rows outside the gauge's
        elongation count as not used.
        """
        if self.published is not None:
            name = format_of("load polynomials", self.published).name
            return [DataFile(self.published, FrameSource(name), 1)]
        end = self.elongation * (1 + 1e-9)
        files = []
        for curve in self.curves:
            # A computed curve (of a plan) is from no file and no array.
            if curve.path is None and curve.source is None:
                continue
            dropped = {}
            if by_points:
                dropped[BELOW_ZERO] = int((curve.elongation < 0).sum())
                dropped[BEYOND_END] = int((curve.elongation > end).sum())
            used = len(curve.load) - sum(dropped.values())
            if curve.cut:
                dropped["after the largest load"] = curve.cut
            arrays = () if curve.path is not None else (curve.elongation, curve.load)
            path = curve.path or Path(CURVES_FILE)
            files.append(DataFile(path, curve.source or FrameSource(), used, dropped, arrays))
        return files

    def break_shares(self, mask: NDArray[np.bool_] | None = None) -> tuple[float, float] | None:
        """Return the two strains at which the curve's three regions meet, over the final strain.

        `mask` keeps some of the `points`, to which the polynomial is fitted anew. None is returned
        without a polynomial. See `strain_regions`.
        """
        polynomial = self.polynomial
        if polynomial is None:
            return None
        if mask is not None and self.curves:
            u, load = (values[mask] for values in self.points)
            polynomial = fit_load_polynomial(u, load, polynomial.order, self.through_origin)
        u = np.linspace(0.0, self._end_of(mask), 200)[1:]
        strain = np.log1p(u / self.gauge_length)
        end_strain = self.end_strain(mask)
        first, second = strain_regions(strain, polynomial(u))
        return float(first / end_strain), float(second / end_strain)

    def _end_of(self, mask: NDArray[np.bool_] | None) -> float:
        """Return the largest elongation (mm) of the points that `mask` keeps, else the gauge's."""
        if mask is None or not self.curves:
            return self.elongation
        return min(self.elongation, float(self.points[0][mask].max()))

    @cached_property
    def _points_to_end(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return elongation (n,) mm, load (n,) N and index (n,) of the specimen of the `points`."""
        if not self.curves:
            return np.empty(0), np.empty(0), np.empty(0, np.intp)
        elongation = np.concatenate([curve.elongation for curve in self.curves])
        load = np.concatenate([curve.load for curve in self.curves])
        counts = [len(curve.load) for curve in self.curves]
        specimen = np.repeat(np.arange(len(self.curves)), counts)
        end = self.elongation * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return elongation[order], load[order], specimen[order].astype(np.intp)


def compare_orders(
    elongation: ArrayLike,
    load: ArrayLike,
    orders: Sequence[int] = range(1, 9),
    through_origin: bool = True,
    specimens: Sequence[object] | None = None,
) -> list[tuple[int, float, float]]:
    """Compare the orders of a load polynomial by their errors at points that are left out.

    Parameters
    ----------
    elongation, load : (n,) array, mm and N
        Points of one direction.
    orders : sequence of int
        Orders of the polynomial to compare.
    through_origin : bool
        Whether the polynomial is zero at no elongation.
    specimens : (n,) sequence or None
        Specimen of each point. If given, a whole specimen is left out at a time: errors of points
        of one specimen are correlated, so that leaving out single points would understate them.

    Returns
    -------
    list of (order, fitted error, error left out)
        RMS errors (N) at the points that the polynomial is fitted to, which are smallest for the
        highest order, and at points (or specimens) left out one by one; the latter is infinite
        where the remaining points do not determine the coefficients.

    Raises
    ------
    InputError
        There are too few points for an order.
    """
    u, f = checked_points(elongation, load)
    names = list(range(len(u))) if specimens is None else list(specimens)
    groups = [
        np.array([i for i, owner in enumerate(names) if owner == name])
        for name in dict.fromkeys(names)
    ]
    scores = []
    for order in orders:
        polynomial = fit_load_polynomial(u, f, order, through_origin)
        terms, _, _ = terms_of(u, order, through_origin)
        count, term_count = terms.shape
        if count < term_count + 2:
            problem = f"comparing needs {term_count + 2} points, there are {count}; lower it"
            raise InputError(None, f"order {order}", problem)
        squares = _squares_left_out(terms, f - polynomial(u), groups)
        scores.append((order, polynomial.rmse, float(np.sqrt(squares / count))))
    return scores


def _squares_left_out(terms: Array, residual: Array, groups: Sequence[Array]) -> float:
    """Return the sum of squared errors at points that a fit leaves out, group by group.

    `terms` (n, coefficients) are the polynomial's terms at each point, `residual` (n,) are its
    errors when fitted to all points, `groups` are rows that are left out together.
    """
    orthonormal = np.linalg.qr(terms)[0]
    squares = 0.0
    for size in {len(group) for group in groups}:  # groups of a size together
        same_size = np.array([group for group in groups if len(group) == size])
        rows = orthonormal[same_size]
        # Errors of a fit without the group: (I - H)^-1 residual, H the group's block of the hat
        # matrix.
        without = np.eye(size) - rows @ rows.swapaxes(1, 2)
        if (np.linalg.cond(without) > 1e12).any():
            return float("inf")  # the other points do not determine the coefficients
        errors = np.linalg.solve(without, residual[same_size, None])
        squares += float((errors**2).sum())
    return squares


def strain_regions(strain: ArrayLike, load: ArrayLike, *, grid: int = 40) -> tuple[float, float]:
    """Return the two strains at which the three linear regions of a load curve meet.

    The curve is approximated by a line of three straight pieces through the origin, by least
    squares, with breaks at places of a grid. Ambroziak and Klosowski read these regions by eye.

    Parameters
    ----------
    strain, load : (n,) array
        One curve, with strains above zero.
    grid : int
        Number of places that a break may take between zero and the largest strain.

    Raises
    ------
    InputError
        There are fewer than five points.
    """
    x = np.asarray(strain, dtype=float)
    f = np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), grid + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    # Of all points as few rows as there are columns: errors of each fit remain the same.
    _, rows = np.linalg.qr(np.column_stack([x, hinges, f]))
    pairs = np.array(list(itertools.combinations(range(grid), 2)))
    first, second = pairs[np.argmin(_errors_of_breaks(rows, pairs))]
    return float(places[first]), float(places[second])


def _errors_of_breaks(rows: Array, pairs: Array) -> Array:
    """Return the sum of squared errors of the best line of three pieces for each pair of breaks.

    `rows` (k, breaks + 2) are strain, strain less each break (zero below it), and load; `pairs`
    (pairs, 2) are the numbers of two breaks.
    """
    load = rows[:, -1]
    columns = np.column_stack([np.zeros(len(pairs), dtype=int), pairs + 1])
    terms = rows[:, columns].swapaxes(0, 1)
    axes, upper = np.linalg.qr(terms)
    # A break that no point tells from another one adds no direction: what remains of it without
    # the other terms is zero but for rounding.
    remainder = np.abs(np.diagonal(upper, axis1=1, axis2=2))
    rounding = len(load) * np.finfo(float).eps * remainder.max(axis=1, keepdims=True)
    axes *= (remainder > rounding)[:, None]
    fitted = np.einsum("pki,pi->pk", axes, load @ axes)
    return ((load - fitted) ** 2).sum(axis=1)
