"""Load over elongation of tensile specimens, as test machines export it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from . import tables
from .frames import Array, FrameSource
from .machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from .registry import read_file

#: Units that a caller may name: per width, or of the whole strip; an elongation, or a strain.
LoadUnit = Literal["N", "kN", "lbf", "kN/m", "N/mm", "N/5cm", "lbf/in"]
LengthUnit = Literal["mm", "cm", "m", "in", "%"]
QUANTITIES = ("elongation", "load", "specimen", "direction", "time")
#: Directions in which a strip can be pulled, in the order of tables.
DIRECTIONS = ("warp", "fill", "bias")


@dataclass(frozen=True, eq=False)
class LoadCurve:
    """Load (n,) N of the whole strip over elongation (n,) mm of one specimen or series.

    time : (n,) where the file has it. frame : (n,) numbers from 0, of a strain gauge.
    between_grips : the column where it is the machine's travel. cut : rows left out after the
    largest load.
    """

    direction: str
    specimen: str
    elongation: Array
    load: Array
    path: Path | None
    time: Array | None = None
    frame: NDArray[np.intp] | None = None
    notes: tuple[str, ...] = ()
    source: FrameSource | None = None
    between_grips: str = ""
    cut: int = 0

    def until_largest_load(self) -> LoadCurve:
        """Return the curve without the rows after its largest load."""
        end = int(np.argmax(self.load)) + 1
        return self.part(slice(end), cut=len(self.load) - end)

    def part(self, rows: slice, **changes: Any) -> LoadCurve:
        """Return the curve of these rows, with other values of its fields."""
        kept = {
            n: v[rows]
            for n in ("elongation", "load", "time", "frame")
            if (v := getattr(self, n)) is not None
        }
        return replace(self, **kept, **changes)


def direction_named(name: str, path: Path | None = None, field: str = "direction") -> str:
    """Return warp, fill or bias for any of the names in `DIRECTION_ALIASES`."""
    plain = re.sub(r"[\W_]+", "", name.casefold())
    if plain not in tables.DIRECTION_ALIASES:
        known = ", ".join(tables.DIRECTION_ALIASES)
        raise InputError(path, field, f"unknown direction {name[:40]!r}; use one of {known}")
    return tables.DIRECTION_ALIASES[plain]


def read_load_curves(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    load_unit: LoadUnit | None = None,
    length_unit: LengthUnit | None = None,
    width: float | None = None,
    gauge_length: Mapping[str, float] | None = None,
    comment: str = "#",
    direction: str | None = None,
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
    sheet: str | None = None,
) -> tuple[LoadCurve, ...]:
    """Read the curves of one export: one a direction and specimen, in the order of the file.

    columns : the file's own names of `elongation`, `load`, `specimen`, `direction`, `time` (only if
    named). load_unit, length_unit : where the file names none. width : mm, for loads per width.
    gauge_length : mm, by direction, for engineering strains. direction : of a file without such a
    column; else the rows to keep. decimal : where 1,234 is in doubt. sheet : of a workbook.
    """
    path = Path(path)
    named = dict(columns or {})
    for name in named:
        check_one_of(name, QUANTITIES, "columns")
    check_one_of(decimal, (".", ","), "decimal")
    wanted = None if direction is None else direction_named(direction)
    options = TableOptions(named, comment=comment, decimal=decimal, sheet=sheet)
    found = read_machine_table(path, options, format)
    column = {quantity: found.column(quantity) for quantity in QUANTITIES}
    said = column["elongation"]
    units = tables.LENGTH_UNITS | tables.STRAIN_UNITS
    elongation = found.values(said, units, Channel(unit=length_unit), "length_unit")
    units = dict(tables.LOAD_UNITS)
    own = found.units[column["load"]]
    if own in tables.WIDTH_LOAD_UNITS or load_unit in tables.WIDTH_LOAD_UNITS:
        if width is None:
            problem = f"{own or load_unit} is a load per width; say the strip's width"
            raise found.error(column["load"], problem)
        units |= {name: scale * width for name, scale in tables.WIDTH_LOAD_UNITS.items()}
    load = found.values(column["load"], units, Channel(unit=load_unit), "load_unit")
    notes = found.notes + found.choice("elongation")
    if notes != found.notes and not np.ptp(elongation):
        problem = "does not move: name another column of elongation with columns"
        raise found.error(said, problem)
    grips = said if tables.is_between_grips(said, "elongation" in named) else ""
    asked = {"elongation": length_unit, "load": load_unit}
    time = found.table.numbers(column["time"]) if column["time"] else found.times()
    labels = _labels(found, column, wanted)
    if (found.units[said] or length_unit) in tables.STRAIN_UNITS:
        gauges = gauge_length or {}
        lacks = [d for d, _ in labels if d not in gauges and wanted in (None, d)]
        if lacks:
            problem = f"is a strain, no elongation: say the {lacks[0]} strip's gauge_length"
            raise found.error(said, problem)
        elongation = elongation * np.array([gauges.get(d, np.nan) for d, _ in labels])
        doubtful = "; its name does not say of what" if tables.distance_to_strip(said) else ""
        words = f"{path.name}: the elongation is the strain of column {said!r} times gauge_length"
        notes = (*notes, words + doubtful)
    places: dict[tuple[str, str], list[int]] = {}
    for row, label in enumerate(labels):
        places.setdefault(label, []).append(row)
    source = found.source(column, asked, notes)
    curves = []
    for key, rows in places.items():
        if wanted in (None, key[0]):
            taken = None if time is None else time[rows]
            values = elongation[rows], load[rows]
            curves.append(LoadCurve(*key, *values, path, taken, None, notes, source, grips))
    if not curves:
        there = ", ".join(dict.fromkeys(key[0] for key in places))
        raise InputError(path, f"column {column['direction']!r}", f"no {wanted}; it has: {there}")
    return tuple(curves)


def split_at_restarts(curve: LoadCurve) -> tuple[LoadCurve, ...]:
    """Return specimens listed without names: one starts where the elongation halves."""
    u = curve.elongation
    starts = [0]
    reached = 0.0
    for i, value in enumerate(u):
        if 0 < reached and value < 0.5 * reached:
            starts.append(i)
            reached = 0.0
        # Noise about zero, before the load comes on, is no restart.
        reached = max(reached, value if value > 1e-2 * u.max() else 0.0)
    return tuple(
        curve.part(slice(a, b), specimen=f"{curve.specimen} {number}")
        for number, (a, b) in enumerate(pairwise([*starts, len(u)]), start=1)
    )


def _labels(
    found: MachineTable, column: Mapping[str, str], wanted: str | None
) -> Sequence[tuple[str, str]]:
    """Return direction and specimen of each row."""
    table = found.table
    if not column["direction"] and wanted is None:
        there = ", ".join(filter(None, found.names))[:300]
        problem = (
            "no column says the direction; say direction, in a project files = { warp = [...] }."
            f" The file has: {there}"
        )
        raise InputError(table.path, f"line {found.header}", problem)
    series = list(table.text(column["direction"])) if column["direction"] else None
    specimens = list(table.text(column["specimen"])) if column["specimen"] else None
    labels = []
    for i, line in enumerate(table.lines):
        at = f"line {line}, column {column['direction']!r}"
        way = direction_named(series[i], table.path, at) if series else str(wanted)
        specimen = specimens[i] if specimens else series[i] if series else table.path.stem
        if not specimen:
            at = f"line {line}, column {column['specimen']!r}"
            raise InputError(table.path, at, "expected the specimen's name, found nothing")
        labels.append((way, specimen))
    return labels


MAX_ORDER = 12  # beyond, the powers of one elongation tell nothing apart


@dataclass(frozen=True, eq=False)
class LoadPolynomial:
    """A polynomial P(u) = c0 + c1 u + c2 u^2 + ... in N over mm, up to `end` mm.

    r_squared : about the mean load, as in Table 3.1. rmse : N; both NaN, points 0, if unknown.
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


def fit_load_polynomial(
    elongation: ArrayLike, load: ArrayLike, order: int = 4, through_origin: bool = True
) -> LoadPolynomial:
    """Fit a polynomial to the points (n,) mm and (n,) N by least squares."""
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


def specimen_deviation(elongation: Array, load: Array, fitted: LoadPolynomial) -> float:
    """Return the deviation (N) of all points from a polynomial, about their own mean (n - 1).

    It is the published 21.7, 64.1 and 40.3 N.
    """
    if len(load) < 2:
        raise InputError(None, "curves", f"scatter needs two points, there are {len(load)}")
    return float((load - fitted(elongation)).std(ddof=1))


def checked_points(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """Return the points as arrays (n,) mm and (n,) N, after checks of counts and values."""
    u = np.asarray(elongation, dtype=float)
    f = np.asarray(load, dtype=float)
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
    """Return powers (n, terms) of u / scale, the scale, and the lowest power."""
    if not 1 <= order <= MAX_ORDER:
        raise InputError(None, "order", f"expected 1 to {MAX_ORDER}, got {order}")
    lowest = int(through_origin)
    scale = float(np.abs(u).max())
    count = order + 1 - lowest
    if len(u) < count:
        problem = f"{count} coefficients need as many points, there are {len(u)}; lower it"
        raise InputError(None, f"order {order}", problem)
    return np.vander(u / scale, order + 1, increasing=True)[:, lowest:], scale, lowest


@dataclass(frozen=True, eq=False)
class PublishedPolynomial:
    """One direction's load over elongation of a gauge (mm); scatter of specimens in N, or NaN."""

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial
    scatter: float


def read_published_polynomials(
    path: Path | str, format: str | None = None
) -> dict[str, PublishedPolynomial]:
    """Read load polynomials by direction: N, of the full strip, over mm."""
    polynomials: dict[str, PublishedPolynomial] = read_file("load polynomials", path, format)
    return polynomials
