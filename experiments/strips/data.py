"""Data of one direction: load curves, their polynomials and regions, and doubts about them."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...inference.comparison import NoiseIs
from ...readers.curves import (
    LoadCurve,
    LoadPolynomial,
    checked_points,
    fit_load_polynomial,
    terms_of,
)
from ...readers.frames import FrameSource
from ...readers.registry import format_of
from ...readers.units import STRAIN_UNITS
from ...solvers.base import Array
from ..data_files import DataFile
from ..doubts import Doubt, Expected


def compare_orders(
    elongation: ArrayLike,
    load: ArrayLike,
    orders: Sequence[int] = range(1, 9),
    through_origin: bool = True,
    specimens: Sequence[object] | None = None,
) -> list[tuple[int, float, float]]:
    """Return each order and its RMS errors (N): at the points (n,) mm and (n,) N it is fitted to,
    least for the highest order, and at points left out one by one.
    specimens : (n,) of each point. With it a whole specimen is left out at a time: points of one
    specimen err together, so leaving out one of them flatters."""
    u, f = checked_points(elongation, load)
    names = list(range(len(u))) if specimens is None else list(specimens)
    groups = [
        np.array([i for i, name in enumerate(names) if name == one]) for one in dict.fromkeys(names)
    ]
    scores = []
    for order in orders:
        fitted = fit_load_polynomial(u, f, order, through_origin)
        terms, _, _ = terms_of(u, order, through_origin)
        n, k = terms.shape
        if n < k + 2:
            problem = f"comparing needs {k + 2} points, there are {n}; lower it"
            raise InputError(None, f"order {order}", problem)
        orthonormal = np.linalg.qr(terms)[0]
        left = f - fitted(u)
        squares = 0.0
        for group in groups:
            rows = orthonormal[group]
            # The squared error at points refitted without them, by (1 - H)^-1.
            without = np.eye(len(rows)) - rows @ rows.T
            if np.linalg.cond(without) > 1e12:
                squares = float("inf")  # the others do not settle the coefficients
                break
            squares += float((np.linalg.solve(without, left[group]) ** 2).sum())
        scores.append((order, fitted.rmse, float(np.sqrt(squares / n))))
    return scores


#: Places that a break may take between zero and the last strain.
BREAKS = 40


def strain_regions(strain: ArrayLike, load: ArrayLike) -> tuple[float, float]:
    """Return the two breaks of the broken line through the origin nearest to the curve.
    By least squares over a grid of 40 places, as Ambroziak and Klosowski read the regions of a
    coated fabric by eye. strain, load : (n,) of one curve, strain above zero."""
    x = np.asarray(strain, dtype=float)
    f = np.asarray(load, dtype=float)
    if len(x) < 5 or not x.max() > 0:
        raise InputError(None, "load curve", f"five points are needed for regions, got {len(x)}")
    places = np.linspace(0.0, x.max(), BREAKS + 2)[1:-1]
    hinges = np.maximum(x[:, None] - places, 0.0)

    def error(pair: tuple[int, int]) -> float:
        terms = np.stack([x, hinges[:, pair[0]], hinges[:, pair[1]]], axis=1)
        slopes, *_ = np.linalg.lstsq(terms, f, rcond=None)
        return float(np.sum((terms @ slopes - f) ** 2))

    first, second = min(itertools.combinations(range(BREAKS), 2), key=error)
    return float(places[first]), float(places[second])


#: Of the largest load: the least noise to reckon with where no scatter is known. The thesis'
#: load cell is of accuracy class 0.5 %.
LOAD_CELL = 0.005
#: Why points are not matched.
BELOW, BEYOND = "elongation below zero", "beyond the final length"
CUT = "after the largest load"
PLACES = 200  # at which a polynomial is asked for its regions


@dataclass(frozen=True, eq=False)
class Strip:
    """Data of one direction; lengths mm, loads N.
    gauge_length, final_length : of the virtual strain gauge. polynomial : given or fitted to the
    curves; None in a forward analysis without data. scatter : standard deviation of points about
    the polynomial. open_end : the final length is where the points end. published : file of a given
    polynomial."""

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
        return self._inside[:2]

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
            below = int((curve.elongation < 0).sum())
            beyond = int((curve.elongation > end).sum())
            dropped = {BELOW: below, BEYOND: beyond} if points else {}
            used = len(curve.load) - sum(dropped.values())
            dropped |= {CUT: curve.cut} if curve.cut else {}
            files.append(DataFile(curve.path, curve.source or FrameSource(), used, dropped))
        return files

    def break_shares(self, mask: NDArray[np.bool_] | None = None) -> tuple[float, float] | None:
        """Return the two breaks (shares of strain) of the three lines nearest to the curve."""
        polynomial = self.polynomial
        if polynomial is None:
            return None
        if mask is not None and self.curves:
            u, load = (values[mask] for values in self.points)
            polynomial = fit_load_polynomial(u, load, polynomial.order, self.through_origin)
        u = np.linspace(0.0, self._end_of(mask), PLACES)[1:]
        strain = np.log1p(u / self.gauge_length)
        whole = self.strain_by(mask)
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


#: Strains at the end of a curve: no coated fabric ends below or above.
LEAST_END, MOST_END = 0.002, 1.5
#: Of the largest load: more than that at no elongation is a preload, or a zero that is not one.
PRELOAD = 0.05
#: Of the elongation: where a curve is taken to begin.
BEGINNING = 0.01
#: Of the largest load: a fall below while the strip is pulled further is a failure; one below the
#: second may be.
FAILED, FALLEN = 0.7, 0.9
#: Of the largest load and of the elongation: a strip that takes up so much load while its gauge
#: moves no further than that at its end has lost its extensometer.
TAKEN_UP, STILL = 0.2, 0.002
#: Of the end strain: where the modulus of a curve is taken.
SLOPE_AT = 0.5
#: The modulus along the yarns whose bounds a direction's curve can be held against.
ALONG = {"warp": "E1", "fill": "E2"}
#: How much stiffer than the warp the fill must be to be taken for it.
STIFFER = 1.15


def doubts_of_strips(
    strips: Mapping[str, Strip],
    width: float,
    thickness: float,
    expected: Expected,
    grip_distance: float,
) -> Sequence[Doubt]:
    """Return the doubts about the strips of a test, by direction; lengths mm."""
    found: list[Doubt] = []
    moduli: dict[str, list[float]] = {}
    for direction, strip in strips.items():
        found += _between_grips(direction, strip, grip_distance)
        for name, elongation, load in curves_of(strip):
            what = f"{direction}, {name}" if name else direction
            found += _of_curve(what, strip, elongation, load)
            if direction not in ALONG or not expected.moduli:
                continue
            strain = np.log1p(np.clip(elongation / strip.gauge_length, -0.9, None))
            near = np.argsort(np.abs(strain - SLOPE_AT * float(strain.max())))[:5]
            value = np.median(load[near] / np.where(strain[near] > 0, strain[near], np.nan))
            modulus = float(value) / (width * thickness) if np.isfinite(value) else float("nan")
            moduli.setdefault(direction, []).append(modulus)
            if far := expected.outside(modulus, [ALONG[direction]]):
                text = (
                    f"{what}: load over strain is a modulus of about {far}: are load and "
                    "elongation in the units that are said, and are width and thickness right?"
                )
                found.append(Doubt("load-unit", True, text))
    if set(ALONG) <= set(strips) and expected.moduli and expected.warp_is_stiffer:
        warp, fill = (float(np.median(moduli.get(d) or np.nan)) for d in ALONG)
        if fill > STIFFER * warp:
            text = (
                f"the fill's modulus is about {fill:.3g} MPa, the warp's {warp:.3g} MPa, and the "
                "bounds have the warp stiffer: warp and fill seem to be swapped"
            )
            found.append(Doubt("swapped", False, text))
    return found


def curves_of(strip: Strip) -> list[tuple[str, Array, Array]]:
    """Return name, elongation and load of every specimen, else of the polynomial."""
    if strip.curves:
        return [(curve.specimen, curve.elongation, curve.load) for curve in strip.curves]
    if strip.polynomial is None:
        return []
    elongation = np.linspace(0.0, strip.elongation, 50)
    return [("", elongation, strip.polynomial(elongation))]


def _between_grips(direction: str, strip: Strip, distance: float) -> Iterator[Doubt]:
    """Yield the doubt about elongations of the machine; distance : of the grips, mm."""
    columns = list(dict.fromkeys(c.between_grips for c in strip.curves if c.between_grips))
    if not columns:
        return
    units = [c.source.units.get("elongation") for c in strip.curves if c.source]
    strain = any(unit in STRAIN_UNITS for unit in units)
    share = strip.gauge_length / distance
    modulus = ALONG.get(direction, "G12")
    what = f"{modulus} comes out too low by the slip in the grips and the machine's own give"
    or_else = ""
    if share < 0.95 and not strain:
        or_else = ", or say the grips' distance as the gauge_length"
        what = (
            f"over a gauge of {strip.gauge_length:.4g} mm between grips {distance:.4g} mm apart "
            f"{modulus} comes out at about {share:.0%} of what it is, and lower still by the slip"
        )
    text = (
        f"{direction}: the elongation, column {' and '.join(map(repr, columns))}, is by its name"
        f" the machine's travel from grip to grip: {what}; name one that was measured on the strip "
        f"(columns = {{ elongation = ... }}){or_else}"
    )
    yield Doubt("grip-travel", False, text)


def _of_curve(what: str, strip: Strip, elongation: Array, load: Array) -> Iterator[Doubt]:
    """Yield doubts about one curve: units of elongation, a preload, rows after failure."""
    strain = elongation[-1] / strip.gauge_length
    if not LEAST_END < strain < MOST_END:
        text = (
            f"{what}: the curve ends at an elongation of {strain:.3g} gauge lengths: is it a length"
            " in the unit that is said (not percent, not a strain), and is the gauge length right?"
        )
        yield Doubt("elongation-unit", True, text)
    largest = float(load.max())
    end = float(elongation.max())
    # A curve may begin where the strip is elongated already.
    first = load[np.abs(elongation) <= BEGINNING * end]
    level = float(np.median(first)) / largest if first.size and largest > 0 else 0.0
    if abs(level) >= PRELOAD:
        text = (
            f"{what}: the load is {level * largest:.3g} N ({level:.0%} of the largest) where the "
            "curve begins: a preload, or a zero that was not set; begin the elongation where the "
            "load does"
        )
        yield Doubt("preload", False, text)
    end = float(elongation[elongation <= strip.elongation * (1 + 1e-9)].max(initial=0.0))
    still = load[(elongation >= (1 - STILL) * end) & (elongation <= end)]
    if still.max() - still[0] > TAKEN_UP * largest:
        text = (
            f"{what}: the load rises from {still[0]:.3g} to {still.max():.3g} N while the "
            f"elongation stands still at {end:.3g} mm: the extensometer was taken off or is at its "
            "end; say a shorter final_length"
        )
        yield Doubt("gauge-still", True, text)
    end = strip.elongation
    beyond = np.flatnonzero(elongation > end * (1 + 1e-9))
    rows = slice(0, beyond[0] if len(beyond) else None)
    top = np.maximum.accumulate(np.maximum(load[rows], 0.0))
    for share in (FAILED, FALLEN):
        fallen = np.flatnonzero((load[rows] < share * top) & (elongation[rows] > SLOPE_AT * end))
        if len(fallen):
            row = fallen[0]
            text = (
                f"{what}: the load falls from {top[row]:.3g} to {load[row]:.3g} N at an elongation "
                f"of {elongation[row]:.3g} mm: rows after failure; cut them off with "
                "until_largest_load = true, or say a shorter final_length"
            )
            yield Doubt("after-failure", share == FAILED, text)
            break
