"""Data of one direction of strips: load curves and their polynomial over a gauge's length."""

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

#: Why points are not matched.
BELOW_ZERO = "elongation below zero"
BEYOND_END = "beyond the final length"


@dataclass(frozen=True, eq=False)
class Strip:
    """Data of one direction.

    Attributes
    ----------
    direction : str
        "warp", "fill" or "bias".
    gauge_length, final_length : float, mm
        Of the virtual strain gauge.
    polynomial : LoadPolynomial or None
        Given or fitted to the curves; None in a forward analysis without data.
    curves : tuple of LoadCurve
        Of the specimens.
    scatter : float, N, or None
        Standard deviation of points about the polynomial.
    through_origin : bool
        Whether the polynomial is zero at no elongation.
    open_end : bool
        Whether the final length is where the points end.
    published : Path or None
        File of a given polynomial.
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

    def strain_by(self, mask: NDArray[np.bool_] | None = None) -> float:
        """Return log strain of the gauge at the end, by points of a mask unless it was given."""
        end = self._end_of(mask) if self.open_end else self.elongation
        return float(np.log1p(end / self.gauge_length))

    @property
    def points(self) -> tuple[Array, Array]:
        """Return elongation and load of all specimens up to the end of the model, by elongation."""
        return self._points_to_end[:2]

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Return number of the specimen of each of the `points`."""
        return self._points_to_end[2]

    @property
    def unmatched_count(self) -> int:
        """Return number of measured points that are not among the `points`."""
        return sum(len(c.load) for c in self.curves) - len(self.points[0])

    def noise(
        self, largest: float, stated: float | None = None, *, accuracy: float = 0.005
    ) -> tuple[float, NoiseIs]:
        """Return the least noise of a load, N, and its origin.

        Parameters
        ----------
        largest : float, N
            Largest load.
        stated : float, N, or None
            Noise that the project states.
        accuracy : float
            Of the load cell, as a share of the largest load, where no scatter is known. That of the
            thesis is of class 0.5 %.
        """
        if stated is not None:
            return stated, "given"
        if self.scatter is not None:
            return self.scatter, "specimens' scatter"
        return accuracy * largest, "assumed"

    def data_files(self, points: bool) -> list[DataFile]:
        """Return the files of the load curve; points : whether those up to the end alone count."""
        if self.published is not None:
            name = format_of("load polynomials", self.published).name
            return [DataFile(self.published, FrameSource(name), 1)]
        end = self.elongation * (1 + 1e-9)
        files = []
        for curve in self.curves:
            if curve.path is None and curve.source is None:
                continue
            dropped = {}
            if points:
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
        """Return the two breaks (shares of strain) of the three lines nearest to the curve."""
        polynomial = self.polynomial
        if polynomial is None:
            return None
        if mask is not None and self.curves:
            u, load = (values[mask] for values in self.points)
            polynomial = fit_load_polynomial(u, load, polynomial.order, self.through_origin)
        u = np.linspace(0.0, self._end_of(mask), 200)[1:]
        strain = np.log1p(u / self.gauge_length)
        end_strain = self.strain_by(mask)
        first, second = strain_regions(strain, polynomial(u))
        return float(first / end_strain), float(second / end_strain)

    def _end_of(self, mask: NDArray[np.bool_] | None) -> float:
        """Return the last elongation (mm) of masked points, at most the end of the gauge."""
        if mask is None or not self.curves:
            return self.elongation
        return min(self.elongation, float(self.points[0][mask].max()))

    @cached_property
    def _points_to_end(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return elongation, load and number of the specimen of the points, by elongation."""
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
