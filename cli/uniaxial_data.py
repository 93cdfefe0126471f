"""The strips of a uniaxial project: what was measured in each direction, and the gauge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..experiments.curves import LoadCurve, read_load_curves, split_at_restarts
from ..experiments.load_polynomials import LoadPolynomial, fit_load_polynomial, specimen_scatter
from ..experiments.published_polynomials import read_published_polynomials
from .project_schema import LENGTH_UNITS, UnitsSection
from .uniaxial_schema import CurvesSection, GaugeSection, UniaxialSection

Array = NDArray[np.float64]

DIRECTIONS = ("warp", "fill", "bias")


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
        if not self.curves:
            return np.empty(0), np.empty(0)
        elongation = np.concatenate([c.elongation for c in self.curves])
        load = np.concatenate([c.load for c in self.curves])
        end = (self.final_length - self.gauge_length) * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return elongation[order], load[order]

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Number of the specimen of each of the `points`."""
        if not self.curves:
            return np.empty(0, np.intp)
        elongation = np.concatenate([c.elongation for c in self.curves])
        whose = np.repeat(np.arange(len(self.curves)), [len(c.load) for c in self.curves])
        end = (self.final_length - self.gauge_length) * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return whose[order].astype(np.intp)


def read_strips(
    path: Path,
    section: UniaxialSection,
    units: UnitsSection,
    data_folder: Path | None,
    need_data: bool,
) -> dict[str, StripData]:
    """The strips of [uniaxial], by direction: those whose section or whose data are there.

    Raises
    ------
    InputError : no data, no gauge length, a final length that is not longer.
    """
    data = section.data
    if (data.polynomials is None) == (data.files is None):
        problem = "expected exactly one of 'polynomials' and 'files'"
        raise InputError(path, "uniaxial.data", problem)
    folder = Path(data_folder) if data_folder is not None else path.parent / data.folder
    scale = LENGTH_UNITS[units.length]
    sections = {d: getattr(section, d) for d in DIRECTIONS if getattr(section, d) is not None}
    names = [data.polynomials] if data.polynomials is not None else data.files or []
    there = all((folder / name).is_file() for name in names)
    complete = sections and all(
        s.gauge_length is not None and s.final_length is not None for s in sections.values()
    )
    if not there and not need_data and complete:
        return {
            d: _strip(path, d, s.gauge_length * scale, s.final_length * scale)
            for d, s in sections.items()
        }
    if data.polynomials is not None:
        strips = _published(path, sections, folder / data.polynomials, scale)
    else:
        strips = _measured(path, data, sections, folder, scale)
    if not strips:
        problem = f"hold none of the directions {', '.join(sections or DIRECTIONS)}"
        raise InputError(path, "uniaxial.data", problem)
    missing = [d for d in sections if d not in strips]
    if missing:
        problem = f"the data hold no {missing[0]} test; leave this section out or add its data"
        raise InputError(path, f"uniaxial.{missing[0]}", problem)
    return strips


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
    folder: Path,
    scale: float,
) -> dict[str, StripData]:
    columns = {k: v for k, v in data.columns.model_dump().items() if v is not None}
    found: list[LoadCurve] = []
    for name in data.files or []:
        found += read_load_curves(
            folder / name,
            columns=columns or None,
            load_unit=data.load_unit,
            length_unit=data.length_unit,
            comment=data.comment,
        )
    strips = {}
    for direction in DIRECTIONS:
        curves = tuple(c for c in found if c.direction == direction)
        if len(curves) == 1:  # perhaps several specimens, one after the other and not named
            curves = split_at_restarts(curves[0])
        if not curves or (sections and direction not in sections):
            continue
        own = sections.get(direction) or GaugeSection()
        if own.gauge_length is None:
            field = f"uniaxial.{direction}.gauge_length"
            raise InputError(path, field, "this key is missing; the strain follows from it")
        start = own.gauge_length * scale
        longest = start + max(float(c.elongation.max()) for c in curves)
        end = longest if own.final_length is None else own.final_length * scale
        elongation = np.concatenate([c.elongation for c in curves])
        load = np.concatenate([c.load for c in curves])
        polynomial = fit_load_polynomial(elongation, load, data.order, data.through_origin)
        scatter = specimen_scatter(curves, polynomial).deviation
        strips[direction] = _strip(
            path, direction, start, end, polynomial=polynomial, curves=curves, scatter=scatter
        )
    return strips


def _strip(path: Path, direction: str, start: float, end: float, **data: object) -> StripData:
    if not end > start:
        problem = f"expected more than the gauge length {start:g} mm, got {end:g} mm"
        raise InputError(path, f"uniaxial.{direction}.final_length", problem)
    return StripData(direction, start, end, **data)  # type: ignore[arg-type]
