"""One direction of a test of strips: what was measured, and the gauge it was measured with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...data.curves import LoadCurve
from ...data.frames import FrameSource
from ...data.load_polynomials import LoadPolynomial, fit_load_polynomial
from ...data.regions import strain_regions
from ...data.registry import format_of
from ...identification.comparison import NoiseIs
from ..data_files import DataFile

Array = NDArray[np.float64]

#: Of the largest load: the least noise to reckon with where no scatter is known. The thesis'
#: load cell is of accuracy class 0.5 %.
LOAD_CELL = 0.005
#: Why points are not matched.
BELOW, BEYOND = "elongation below zero", "beyond the final length"
PLACES = 200  # at which a polynomial is asked for its regions


@dataclass(frozen=True, eq=False)
class Strip:
    """One direction. Lengths mm, loads N.

    Parameters
    ----------
    direction : warp, fill or bias.
    gauge_length, final_length : of the virtual strain gauge, at rest and at the end.
    polynomial : the load curve, given or fitted to the curves; None where a forward analysis does
        without data.
    curves : the specimens' points, empty where only the polynomial is given.
    scatter : standard deviation of the points about the polynomial; None where not known.
    through_origin : whether a polynomial through the points starts in the origin.
    open_end : nobody said the final length: it is where the points end.
    published : the file of a polynomial that was given, None of one fitted to points.
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
        """Of the gauge at the end, mm."""
        return self.final_length - self.gauge_length

    @property
    def strain(self) -> float:
        """Logarithmic strain of the gauge at the end."""
        return float(np.log1p(self.elongation / self.gauge_length))

    def strain_by(self, mask: NDArray[np.bool_] | None) -> float:
        """The same by the points of a mask, which alone say where the end is if nobody else did."""
        end = self._end_of(mask) if self.open_end else self.elongation
        return float(np.log1p(end / self.gauge_length))

    @property
    def points(self) -> tuple[Array, Array]:
        """Elongation and load of all specimens up to the end of the model, by elongation."""
        elongation, load, _ = self._inside
        return elongation, load

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Number of the specimen of each of the `points`."""
        return self._inside[2]

    @property
    def beyond(self) -> int:
        """Number of measured points that are not among the `points`."""
        return sum(len(c.load) for c in self.curves) - len(self.points[0])

    def noise(self, largest: float, given: float | None = None) -> tuple[float, NoiseIs]:
        """Least noise of a load to reckon with, N, and what it is.

        largest : load measured. given : what the project says of it.
        """
        if given is not None:
            return given, "given"
        if self.scatter is not None:
            return self.scatter, "specimens' scatter"
        return LOAD_CELL * largest, "assumed"

    def data_files(self, points: bool) -> list[DataFile]:
        """The files of the load curve; points : whether those up to the end alone count."""
        if self.published is not None:
            name = format_of("load polynomials", self.published).name
            return [DataFile(self.published, FrameSource(name), 1)]
        end = self.elongation * (1 + 1e-9)
        files = []
        for curve in self.curves:
            if curve.path is None:
                continue
            below, beyond = int((curve.elongation < 0).sum()), int((curve.elongation > end).sum())
            dropped = {BELOW: below, BEYOND: beyond} if points else {}
            used = len(curve.load) - sum(dropped.values())
            files.append(DataFile(curve.path, curve.source or FrameSource(), used, dropped))
        return files

    def break_shares(self, mask: NDArray[np.bool_] | None = None) -> tuple[float, float] | None:
        """Two shares of the gauge's strain between which three lines follow the load curve best.

        mask : of the points, which the curve is to follow; all unless given.

        Raises
        ------
        InputError : the points matched settle no polynomial.
        """
        polynomial = self.polynomial
        if polynomial is None:
            return None
        if mask is not None and self.curves:
            elongation, load = self.points
            order = polynomial.order
            polynomial = fit_load_polynomial(
                elongation[mask], load[mask], order, self.through_origin
            )
        u = np.linspace(0.0, self._end_of(mask), PLACES)[1:]
        strain, whole = np.log1p(u / self.gauge_length), self.strain_by(mask)
        first, second = strain_regions(strain, polynomial(u))
        return float(first / whole), float(second / whole)

    def _end_of(self, mask: NDArray[np.bool_] | None) -> float:
        """How far (mm) the points of a mask go, at most to the end of the gauge."""
        if mask is None or not self.curves:
            return self.elongation
        return min(self.elongation, float(self.points[0][mask].max()))

    @cached_property
    def _inside(self) -> tuple[Array, Array, NDArray[np.intp]]:
        if not self.curves:
            return np.empty(0), np.empty(0), np.empty(0, np.intp)
        elongation = np.concatenate([c.elongation for c in self.curves])
        load = np.concatenate([c.load for c in self.curves])
        whose = np.repeat(np.arange(len(self.curves)), [len(c.load) for c in self.curves])
        end = self.elongation * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return elongation[order], load[order], whose[order].astype(np.intp)
