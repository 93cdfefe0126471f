"""The strips of a uniaxial project: what was measured in each direction, and the gauge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..experiments.curves import LoadCurve
from ..experiments.load_polynomials import LoadPolynomial, fit_load_polynomial, specimen_scatter
from ..experiments.published_polynomials import read_published_polynomials
from .schema import LENGTH_UNITS, UnitsSection
from .uniaxial_files import DIRECTIONS, ListedFile, listed_files, measured_curves
from .uniaxial_schema import CurvesSection, GaugeSection, UniaxialSection

Array = NDArray[np.float64]

#: How far beyond the last point a load polynomial may be followed, of the last elongation: a strip
#: breaks between two readings.
EXTRAPOLATED = 0.05


@dataclass(frozen=True, eq=False)
class StripData:
    """One direction. Lengths mm, loads N.

    polynomial : the load curve, given or fitted to the curves; None where a forward analysis does
    without data. curves : the specimens' points, empty where only the polynomial is given.
    scatter : standard deviation of the points about the polynomial, N; None where not known.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial | None = None
    curves: tuple[LoadCurve, ...] = ()
    scatter: float | None = None

    @property
    def points(self) -> tuple[Array, Array]:
        """Elongation and load of all specimens up to the end of the model, by elongation."""
        elongation, load, _ = self._inside
        return elongation, load

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Number of the specimen of each of the `points`."""
        return self._inside[2]

    @cached_property
    def _inside(self) -> tuple[Array, Array, NDArray[np.intp]]:
        if not self.curves:
            return np.empty(0), np.empty(0), np.empty(0, np.intp)
        elongation = np.concatenate([c.elongation for c in self.curves])
        load = np.concatenate([c.load for c in self.curves])
        whose = np.repeat(np.arange(len(self.curves)), [len(c.load) for c in self.curves])
        end = (self.final_length - self.gauge_length) * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return elongation[order], load[order], whose[order].astype(np.intp)


def read_strips(
    path: Path,
    section: UniaxialSection,
    units: UnitsSection,
    data_folder: Path | None,
    need_data: bool,
    option: str = "--data",
) -> dict[str, StripData]:
    """The strips of [uniaxial], by direction: those whose section or whose data are there.

    Parameters
    ----------
    data_folder : where the files lie; replaces `uniaxial.data.folder`.
    need_data : without, files that are not there are done without where all lengths are given.
    option : of the command line, that names the folder.

    Raises
    ------
    InputError : naming the project and the key, or the data file: no data, no gauge length, a
        final length that is not longer or beyond the data, points that settle no polynomial.
    """
    data = section.data
    if (data.polynomials is None) == (data.files is None):
        problem = "expected exactly one of 'polynomials' and 'files'"
        raise InputError(path, "uniaxial.data", problem)
    folder = Path(data_folder) if data_folder is not None else path.parent / data.folder
    scale = LENGTH_UNITS[units.length]
    sections = {d: getattr(section, d) for d in DIRECTIONS if getattr(section, d) is not None}
    listed = listed_files(path, data, folder)
    missing = next((file for file in listed if not file.path.is_file()), None)
    if missing is not None:
        if need_data or not _complete(sections):
            problem = f"there is no file {missing.path}; {option} DIR names another folder"
            raise InputError(path, missing.field, problem)
        return {
            d: _strip(path, d, s.gauge_length * scale, s.final_length * scale)
            for d, s in sections.items()
        }
    if data.polynomials is not None:
        strips = _published(path, sections, listed[0].path, scale)
    else:
        strips = _measured(path, data, sections, listed, scale)
    if not strips:
        problem = f"these data hold none of the directions {', '.join(sections or DIRECTIONS)}"
        raise InputError(path, "uniaxial.data", problem)
    for direction in sections:
        if direction not in strips:
            problem = f"the data hold no {direction} test; leave this section out or add its data"
            raise InputError(path, f"uniaxial.{direction}", problem)
    return strips


def _complete(sections: Mapping[str, GaugeSection]) -> bool:
    lengths = [(s.gauge_length, s.final_length) for s in sections.values()]
    return bool(lengths) and all(a is not None and b is not None for a, b in lengths)


def _published(
    path: Path, sections: Mapping[str, GaugeSection], file: Path, scale: float
) -> dict[str, StripData]:
    curves = read_published_polynomials(file)
    wanted = [d for d in DIRECTIONS if d in curves and (d in sections or not sections)]
    strips = {}
    for direction in wanted:
        curve, own = curves[direction], sections.get(direction) or GaugeSection()
        start = curve.gauge_length if own.gauge_length is None else own.gauge_length * scale
        end = curve.final_length if own.final_length is None else own.final_length * scale
        scatter = None if np.isnan(curve.scatter) else curve.scatter
        strips[direction] = _strip(
            path, direction, start, end, polynomial=curve.polynomial, scatter=scatter
        )
    return strips


def _measured(
    path: Path,
    data: CurvesSection,
    sections: Mapping[str, GaugeSection],
    listed: Sequence[ListedFile],
    scale: float,
) -> dict[str, StripData]:
    found = measured_curves(path, data, listed)
    said = {file.direction for file in listed}
    strips = {}
    for direction, curves in found.items():
        # A section picks among what a file holds; a file listed for a direction is meant.
        if sections and direction not in sections and direction not in said:
            continue
        own = sections.get(direction) or GaugeSection()
        if own.gauge_length is None:
            field = f"uniaxial.{direction}.gauge_length"
            raise InputError(path, field, "this key is missing; the strain follows from it")
        start = own.gauge_length * scale
        elongation = np.concatenate([c.elongation for c in curves])
        load = np.concatenate([c.load for c in curves])
        try:
            polynomial = fit_load_polynomial(elongation, load, data.order, data.through_origin)
            scatter = specimen_scatter(curves, polynomial).deviation
        except InputError as error:
            problem = f"no load curve through the {direction} points: {error.problem}"
            raise InputError(path, f"uniaxial.data, {error.field}", problem) from None
        end = start + polynomial.end if own.final_length is None else own.final_length * scale
        strips[direction] = _strip(
            path, direction, start, end, polynomial=polynomial, curves=curves, scatter=scatter
        )
    return strips


def _strip(
    path: Path,
    direction: str,
    start: float,
    end: float,
    polynomial: LoadPolynomial | None = None,
    **data: Any,
) -> StripData:
    field = f"uniaxial.{direction}.final_length"
    if not end > start:
        problem = f"expected more than the gauge length {start:g} mm, got {end:g} mm"
        raise InputError(path, field, problem)
    if polynomial is not None and end - start > polynomial.end * (1 + EXTRAPOLATED):
        problem = (
            f"the data end at an elongation of {polynomial.end:.5g} mm; expected up to"
            f" {start + polynomial.end:.5g} mm, got {end:g} mm"
        )
        raise InputError(path, field, problem)
    return StripData(direction, start, end, polynomial, **data)
