"""Data of strip tests: files, load curves by direction, polynomials of them and their regions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...files import is_file
from ...inference.comparison import NoiseIs
from ...meshes.strip_models import WIDTH
from ...readers.curves import (
    DIRECTIONS,
    LoadCurve,
    LoadPolynomial,
    checked_points,
    fit_load_polynomial,
    read_load_curves,
    read_published_polynomials,
    specimen_scatter,
    split_at_restarts,
    terms_of,
)
from ...readers.frames import FrameSource
from ...readers.registry import format_of
from ...readers.sections import beside
from ..keys import named_format
from ..kinds import DataFile, Place
from .section import CurvesSection, GaugeSection, StripsSection

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OrderScore:
    """Scores of one order: n points, k coefficients, S the sum of squares left.

    adjusted_r_squared : of S / (n - k) and (squares about the mean) / (n - 1). rmse : N, sqrt(S /
    n). aic, bic : n ln(S / n) + 2 (k + 1) and n ln(S / n) + (k + 1) ln n. left_out : N, RMS error
    at points, or whole specimens, that the fit did not see.
    """

    order: int
    r_squared: float
    adjusted_r_squared: float
    rmse: float
    aic: float
    bic: float
    left_out: float


@dataclass(frozen=True)
class OrderComparison:
    """Scores by rising order, and the order that each rule chooses.

    by_fit : lowest RMSE and highest R^2, the thesis' rule (section 3.2). Each order contains the
    ones below it, so that it chooses the highest offered: the thesis' fourth was a choice of what
    to offer.
    """

    scores: tuple[OrderScore, ...]
    by_fit: int
    by_adjusted_r_squared: int
    by_aic: int
    by_bic: int
    by_left_out: int


def compare_orders(
    elongation: ArrayLike,
    load: ArrayLike,
    orders: Sequence[int] = range(1, 9),
    through_origin: bool = True,
    specimens: Sequence[object] | None = None,
) -> OrderComparison:
    """Fit each order to the points (n,) mm and (n,) N and score it.

    specimens : (n,) of each point. With it a whole specimen is left out at a time: points of one
    specimen err together, so leaving out one of them flatters.
    """
    u, f = checked_points(elongation, load)
    names = list(range(len(u))) if specimens is None else list(specimens)
    if len(names) != len(u):
        raise InputError(None, "specimens", f"expected {len(u)} names, got {len(names)}")
    if not len(orders):
        raise InputError(None, "orders", "expected at least one, got none")
    groups = [
        np.array([i for i, name in enumerate(names) if name == one]) for one in dict.fromkeys(names)
    ]
    scores = tuple(_score(u, f, order, through_origin, groups) for order in sorted(set(orders)))

    def best(values: list[float]) -> int:
        return scores[int(np.argmin(values))].order

    rules = ("rmse", "aic", "bic", "left_out")
    fit, aic, bic, left_out = (best([getattr(s, rule) for s in scores]) for rule in rules)
    adjusted = best([-score.adjusted_r_squared for score in scores])
    return OrderComparison(scores, fit, adjusted, aic, bic, left_out)


def _score(
    u: Array,
    f: Array,
    order: int,
    through_origin: bool,
    groups: list[NDArray[np.intp]],
) -> OrderScore:
    fitted = fit_load_polynomial(u, f, order, through_origin)
    terms, _, _ = terms_of(u, order, through_origin)
    n, k = terms.shape
    if n < k + 2:
        problem = f"comparing needs {k + 2} points, there are {n}; lower it"
        raise InputError(None, f"order {order}", problem)
    # Below rounding a fit is exact, and the logarithm of nothing says nothing.
    mean_square = max(fitted.rmse**2, 1e-30 * float((f**2).mean()))
    likelihood = n * float(np.log(mean_square))
    orthonormal = np.linalg.qr(terms)[0]
    left = f - fitted(u)
    squares = sum(_left_out_squares(orthonormal[group], left[group]) for group in groups)
    return OrderScore(
        order,
        fitted.r_squared,
        1.0 - (1.0 - fitted.r_squared) * (n - 1) / (n - k),
        fitted.rmse,
        likelihood + 2 * (k + 1),
        likelihood + float(np.log(n)) * (k + 1),
        float(np.sqrt(squares / n)),
    )


def _left_out_squares(rows: Array, left: Array) -> float:
    """Return the squared error at points refitted without them, by (1 - H)^-1."""
    without = np.eye(len(rows)) - rows @ rows.T
    if np.linalg.cond(without) > 1e12:
        return float("inf")  # the others do not settle the coefficients
    return float((np.linalg.solve(without, left) ** 2).sum())


#: Places that a break may take between zero and the last strain.
BREAKS = 40


def strain_regions(strain: ArrayLike, load: ArrayLike) -> tuple[float, float]:
    """Return the two breaks of the broken line through the origin nearest to the curve.

    By least squares over a grid of 40 places, as Ambroziak and Klosowski read the regions of a
    coated fabric by eye. strain, load : (n,) of one curve, strain above zero.
    """
    x, f = np.asarray(strain, dtype=float), np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), BREAKS + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)
    best, least = (places[0], places[-1]), np.inf
    for a, b in itertools.combinations(range(BREAKS), 2):
        terms = np.stack([x, hinges[:, a], hinges[:, b]], axis=1)
        slopes, *_ = np.linalg.lstsq(terms, f, rcond=None)
        error = float(np.sum((terms @ slopes - f) ** 2))
        if error < least:
            best, least = (places[a], places[b]), error
    return float(best[0]), float(best[1])


@dataclass(frozen=True)
class ListedFile:
    """A file of a section, with its key, and the direction it is listed for or None.

    field : its key below the section. direction : the one it is listed for; None where the file
    itself names it.
    """

    path: Path
    field: str
    direction: str | None = None


def listed_files(place: Place, data: CurvesSection, folder: Path) -> list[ListedFile]:
    """Return the files of [strips.data], there or not, in the order of the section."""
    if data.polynomials is not None:
        return [ListedFile(folder / data.polynomials, "data.polynomials")]
    field = "data.files"
    by_direction: dict[str | None, list[str]] = {}
    if isinstance(data.files, list):
        by_direction[None] = data.files
    elif data.files is not None:
        by_direction = {d: getattr(data.files, d) or [] for d in DIRECTIONS}
    listed = []
    for direction, names in by_direction.items():
        key = field if direction is None else f"{field}.{direction}"
        for i, name in enumerate(names):
            if Path(name) in map(Path, names[:i]):
                problem = f"{name!r} is listed twice; its points would count double"
                raise place.error(f"{key}[{i}]", problem)
            listed.append(ListedFile(folder / name, f"{key}[{i}]", direction))
    if not listed:
        problem = "expected files of one direction at least: { warp = [...], fill = [...] }"
        raise place.error(field, problem)
    return listed


def measured_curves(
    place: Place, data: CurvesSection, listed: Sequence[ListedFile], width: float
) -> dict[str, tuple[LoadCurve, ...]]:
    """Return the specimens' curves by direction, in the order of `DIRECTIONS`.

    A file with one curve in a direction perhaps lists several specimens, one after the other and
    not named: it is split where the elongation starts again. width : of the strips, mm.
    """
    format = named_format(place, "data.format", "machine table", data.format)
    columns = {k: v for k, v in data.columns.model_dump().items() if v is not None}
    by_direction: dict[str, list[LoadCurve]] = {direction: [] for direction in DIRECTIONS}
    first: dict[Path, LoadCurve] = {}
    for file in listed:
        curves = read_load_curves(
            file.path,
            columns=columns or None,
            load_unit=data.load_unit,
            length_unit=data.length_unit,
            width=width,
            comment=data.comment,
            direction=file.direction,
            decimal=data.decimal,
            format=format,
        )
        before = first.setdefault(file.path, curves[0])
        if before.direction != curves[0].direction and all(
            np.array_equal(getattr(before, name), getattr(curves[0], name))
            for name in ("elongation", "load")
        ):
            problem = f"is listed for {before.direction} too, and does not tell the two apart"
            raise place.error(file.field, problem)
        for direction in DIRECTIONS:
            own = [curve for curve in curves if curve.direction == direction]
            if len(own) == 1:
                parts = split_at_restarts(own[0])
                own = list(parts) if len(parts) > 1 else own
            by_direction[direction] += own
    return {direction: tuple(curves) for direction, curves in by_direction.items() if curves}


#: Of the largest load: the least noise to reckon with where no scatter is known. The thesis'
#: load cell is of accuracy class 0.5 %.
LOAD_CELL = 0.005
#: Why points are not matched.
BELOW, BEYOND = "elongation below zero", "beyond the final length"
PLACES = 200  # at which a polynomial is asked for its regions


@dataclass(frozen=True, eq=False)
class Strip:
    """Data of one direction; lengths mm, loads N.

    gauge_length, final_length : of the virtual strain gauge. polynomial : given or fitted to the
    curves; None in a forward analysis without data. scatter : standard deviation of points about
    the polynomial. open_end : the final length is where the points end. published : file of a given
    polynomial.
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

    @property
    def strain(self) -> float:
        """Return logarithmic strain of the gauge at the end."""
        return float(np.log1p(self.elongation / self.gauge_length))

    def strain_by(self, mask: NDArray[np.bool_] | None) -> float:
        """Return the strain at the end by the points of a mask, unless the end was given."""
        end = self._end_of(mask) if self.open_end else self.elongation
        return float(np.log1p(end / self.gauge_length))

    @property
    def points(self) -> tuple[Array, Array]:
        """Return elongation and load of all specimens up to the end of the model, by elongation."""
        elongation, load, _ = self._inside
        return elongation, load

    @property
    def specimen_of(self) -> NDArray[np.intp]:
        """Return number of the specimen of each of the `points`."""
        return self._inside[2]

    @property
    def beyond(self) -> int:
        """Return number of measured points that are not among the `points`."""
        return sum(len(c.load) for c in self.curves) - len(self.points[0])

    def noise(self, largest: float, given: float | None = None) -> tuple[float, NoiseIs]:
        """Return the least noise of a load, N, and its origin."""
        if given is not None:
            return given, "given"
        if self.scatter is not None:
            return self.scatter, "specimens' scatter"
        return LOAD_CELL * largest, "assumed"

    def data_files(self, points: bool) -> list[DataFile]:
        """Return the files of the load curve; points : whether those up to the end alone count."""
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
        """Return the two breaks (shares of strain) of the three lines nearest to the curve."""
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
        """Return the last elongation (mm) of masked points, at most the end of the gauge."""
        if mask is None or not self.curves:
            return self.elongation
        return min(self.elongation, float(self.points[0][mask].max()))

    @cached_property
    def _inside(self) -> tuple[Array, Array, NDArray[np.intp]]:
        if not self.curves:
            return np.empty(0), np.empty(0), np.empty(0, np.intp)
        elongation = np.concatenate([c.elongation for c in self.curves])
        load = np.concatenate([c.load for c in self.curves])
        owners = np.repeat(np.arange(len(self.curves)), [len(c.load) for c in self.curves])
        end = self.elongation * (1 + 1e-9)
        order = np.argsort(elongation, kind="stable")
        order = order[(elongation[order] >= 0) & (elongation[order] <= end)]
        return elongation[order], load[order], owners[order].astype(np.intp)


#: How far beyond the last point a load polynomial may be followed, of the last elongation: a strip
#: breaks between two readings.
EXTRAPOLATED = 0.05


def read_strips(place: Place, section: StripsSection) -> dict[str, Strip]:
    """Read the strips of a section, by direction: those with a table or data.

    Missing files are no error where the place needs none and all lengths are given.
    """
    data = section.data
    if (data.polynomials is None) == (data.files is None):
        raise place.error("data", "expected exactly one of 'polynomials' and 'files'")
    folder = place.data_folder
    if folder is None:
        folder = beside(place.path.parent, data.folder)
    tables = {d: getattr(section, d) for d in DIRECTIONS if getattr(section, d) is not None}
    listed = listed_files(place, data, folder)
    missing = next((file for file in listed if not is_file(file.path)), None)
    if missing is not None:
        lengths = [x for t in tables.values() for x in (t.gauge_length, t.final_length)]
        if place.need_data or not lengths or None in lengths:
            problem = f"there is no file {missing.path}; --data DIR names another folder"
            raise place.error(missing.field, problem)
        length = place.scales.length
        return {
            d: _strip(place, d, t.gauge_length * length, t.final_length * length)
            for d, t in tables.items()
        }
    if data.polynomials is not None:
        strips = _published(place, data, tables, listed[0])
    else:
        width = WIDTH if section.width is None else section.width * place.scales.length
        strips = _measured(place, data, tables, listed, width)
    if not strips:
        problem = f"these data hold none of the directions {', '.join(tables or DIRECTIONS)}"
        raise place.error("data", problem)
    for direction in tables:
        if direction not in strips:
            problem = f"the data hold no {direction} test; leave this section out or add its data"
            raise place.error(direction, problem)
    return strips


def _published(
    place: Place, data: CurvesSection, tables: Mapping[str, GaugeSection], file: ListedFile
) -> dict[str, Strip]:
    format = named_format(place, "data.format", "load polynomials", data.format)
    curves, length = read_published_polynomials(file.path, format), place.scales.length
    wanted = [d for d in DIRECTIONS if d in curves and (d in tables or not tables)]
    strips = {}
    for direction in wanted:
        curve, own = curves[direction], tables.get(direction) or GaugeSection()
        start = curve.gauge_length if own.gauge_length is None else own.gauge_length * length
        end = curve.final_length if own.final_length is None else own.final_length * length
        scatter = None if np.isnan(curve.scatter) else curve.scatter
        known = {"scatter": scatter, "published": file.path}
        strips[direction] = _strip(place, direction, start, end, curve.polynomial, **known)
    return strips


def _measured(
    place: Place,
    data: CurvesSection,
    tables: Mapping[str, GaugeSection],
    listed: Sequence[ListedFile],
    width: float,
) -> dict[str, Strip]:
    said = {file.direction for file in listed}
    strips = {}
    for direction, curves in measured_curves(place, data, listed, width).items():
        # A table picks among what a file holds; a file listed for a direction is meant.
        if tables and direction not in tables and direction not in said:
            continue
        own = tables.get(direction) or GaugeSection()
        if own.gauge_length is None:
            problem = "this key is missing; the strain follows from it"
            raise place.error(f"{direction}.gauge_length", problem)
        start = own.gauge_length * place.scales.length
        elongation = np.concatenate([c.elongation for c in curves])
        load = np.concatenate([c.load for c in curves])
        try:
            polynomial = fit_load_polynomial(elongation, load, data.order, data.through_origin)
            scatter = specimen_scatter(curves, polynomial).deviation
        except InputError as error:
            problem = f"no load curve through the {direction} points: {error.problem}"
            raise place.error(f"data, {error.field}", problem) from None
        end = start + polynomial.end
        if own.final_length is not None:
            end = own.final_length * place.scales.length
        strips[direction] = _strip(
            place,
            direction,
            start,
            end,
            polynomial=polynomial,
            curves=curves,
            scatter=scatter,
            through_origin=data.through_origin,
            open_end=own.final_length is None,
        )
    return strips


def _strip(
    place: Place,
    direction: str,
    start: float,
    end: float,
    polynomial: LoadPolynomial | None = None,
    **data: Any,
) -> Strip:
    field = f"{direction}.final_length"
    if not end > start:
        problem = f"expected more than the gauge length {start:g} mm, got {end:g} mm"
        raise place.error(field, problem)
    if polynomial is not None and end - start > polynomial.end * (1 + EXTRAPOLATED):
        problem = (
            f"the data end at an elongation of {polynomial.end:.5g} mm; expected up to"
            f" {start + polynomial.end:.5g} mm, got {end:g} mm"
        )
        raise place.error(field, problem)
    return Strip(direction, start, end, polynomial, **data)
