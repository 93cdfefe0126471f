"""Hold the data of strips of one direction: load curves over elongation and their polynomial."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...inference.objective import NoiseIs
from ...readers.curves import (
    CURVES_FILE,
    LoadCurve,
    LoadPolynomial,
    fit_load_polynomial,
)
from ...readers.frames import FrameSource
from ...readers.registry import format_of
from ...solvers.base import Array
from ..data_files import DataFile
from .curve_shape import strain_regions

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
