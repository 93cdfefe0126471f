"""Read load curves of tensile tests from exports of test machines, and fit polynomials to them."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from ..light_dataclasses import dataclass
from .frames import Array, FrameSource
from .machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from .quantities import DIRECTION_ALIASES, distance_to_strip, is_between_grips
from .registry import read_file
from .units import LENGTH_UNITS, LOAD_UNITS, STRAIN_UNITS, WIDTH_LOAD_UNITS

#: Units that a caller may name: of the load on the strip or per width, and of an elongation or of a
#: strain (%).
LoadUnit = Literal["N", "kN", "lbf", "kN/m", "N/mm", "N/5cm", "lbf/in"]
LengthUnit = Literal["mm/mm", "mm", "cm", "m", "in", "%"]
QUANTITIES = ("elongation", "load", "specimen", "direction", "time")
#: Directions in which a strip can be pulled, in the order of tables.
DIRECTIONS = ("warp", "fill", "bias")
DIRECTION_OF_ANGLE = {0.0: "warp", 45.0: "bias", 90.0: "fill"}


#: File to which the arrays of load curves are written.
CURVES_FILE = "curves.csv"


@dataclass(frozen=True, eq=False)
class LoadCurve:
    """Load over elongation of one specimen.

    Attributes
    ----------
    direction : str
        "warp", "fill", "bias", or an angle from the warp such as "15 degrees".
    specimen : str
        Name of the specimen.
    elongation : (n,) array, mm
    load : (n,) array, N
        Load on the full width of the strip.
    path : Path or None
        File of the readings; None if they were given as arrays.
    time : (n,) array or None
        Time of each reading, in s, or as the file has it if the user named its column.
    frame : (n,) array of int or None
        Index of each reading's frame, from 0, where a virtual strain gauge gave the elongation.
    notes : tuple of str
        Choices made while reading.
    source : FrameSource or None
        Format, columns and units that were read.
    between_grips : str
        Name of the column of elongation if it is the machine's travel, else "".
    cut : int
        Number of rows left out after the largest load.
    lateral : (n,) array or None
        Engineering strain across the strip.
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
    lateral: Array | None = None

    def until_largest_load(self) -> LoadCurve:
        """Return the curve without the rows after its largest load."""
        end = int(np.argmax(self.load)) + 1
        return self.part(slice(end), cut=len(self.load) - end)

    def part(self, rows: slice | Sequence[int], **changes: Any) -> LoadCurve:
        """Return the curve with some of its rows only, and with `changes` of other fields."""
        return replace(
            self,
            elongation=self.elongation[rows],
            load=self.load[rows],
            time=None if self.time is None else self.time[rows],
            frame=None if self.frame is None else self.frame[rows],
            lateral=None if self.lateral is None else self.lateral[rows],
            **changes,
        )


def direction_named(name: str | float, path: Path | None = None, field: str = "direction") -> str:
    """Return the direction that a name in `DIRECTION_ALIASES`, or an angle from the warp, means.

    Parameters
    ----------
    name : str or float
        A name, an angle with its unit such as "15 deg", or an angle in degrees.
    path : Path, optional
    field : str
        What messages name beside `path`.

    Returns
    -------
    str
        "warp" (0 degrees), "fill" (90), "bias" (45), or an angle such as "15 degrees".

    Raises
    ------
    InputError
        The name is neither of them.
    """
    words = name if isinstance(name, str) else f"{name:g} deg"
    plain = re.sub(r"[\W_]+", "", words.casefold())
    angle = re.fullmatch(r"\s*(\d+\.?\d*)[\s_]*(?:deg|degrees?|°)\s*", words.casefold())
    if angle and float(angle[1]) <= 90:
        degrees = float(angle[1])
        return DIRECTION_OF_ANGLE.get(degrees, f"{degrees:g} degrees")
    if plain in DIRECTION_ALIASES:
        return DIRECTION_ALIASES[plain]
    aliases = ", ".join(DIRECTION_ALIASES)
    problem = f"unknown direction {words[:40]!r}; use one of {aliases}, 0 to 90 deg (from the warp)"
    raise InputError(path, field, problem)


def cut_of(direction: str) -> str:
    """Return "warp" or "fill" for strips along a yarn, and "bias" for all at an angle to them."""
    return direction if direction in DIRECTIONS else "bias"


def in_order(directions: Collection[str]) -> list[str]:
    """Return directions in the order of tables: warp, fill, bias, then angles."""
    angles = [direction for direction in directions if direction not in DIRECTIONS]
    angles.sort(key=lambda direction: float(direction.split()[0]))
    return [*(direction for direction in DIRECTIONS if direction in directions), *angles]


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
    """Read the load curves of one export, in the order of the file.

    Parameters
    ----------
    path : path
        Export of a test machine: text, workbook, or a plug-in's format.
    columns : mapping, optional
        Column names in the file by quantity: `elongation`, `load`, `specimen`, `direction`, `time`
        and `lateral`, the strain across the strip, without which it is not read.
    load_unit, length_unit : str, optional
        Units where the file names none.
    width : float, mm, optional
        Width of the strip, needed where loads are per width.
    gauge_length : mapping, mm, optional
        Gauge length by direction, needed where the file has engineering strains.
    comment : str
        Text that comment lines begin with.
    direction : str, optional
        Direction of all rows in a file without a column of directions; otherwise the direction
        whose rows are kept.
    decimal : {".", ","}, optional
        Decimal mark, needed where a number such as 1,234 is ambiguous.
    format : str, optional
        Name of the format; recognised by the content if omitted.
    sheet : str, optional
        Sheet of a workbook.

    Returns
    -------
    tuple of LoadCurve
        One curve for each direction and specimen.

    Raises
    ------
    InputError
        A column or a unit is missing, or the table is ambiguous.
    """
    path = Path(path)
    columns = dict(columns or {})
    for quantity in columns:
        check_one_of(quantity, (*QUANTITIES, "lateral"), "columns")
    check_one_of(decimal, (".", ","), "decimal")
    selected = None if direction is None else direction_named(direction)
    options = TableOptions(columns, comment=comment, decimal=decimal, sheet=sheet)
    table = read_machine_table(path, options, format)
    column_of = {quantity: table.column(quantity) for quantity in QUANTITIES}
    column = column_of["elongation"]
    channel = Channel(unit=length_unit)
    elongation = table.values(column, LENGTH_UNITS | STRAIN_UNITS, channel, "length_unit")
    load = _read_loads(table, column_of["load"], load_unit, width)
    notes = table.notes + table.choice("elongation")
    if notes != table.notes and not np.ptp(elongation):
        problem = "does not move: name another column of elongation with columns"
        raise table.error(column, problem)
    time_column = column_of["time"]
    time = table.table.numbers(time_column) if time_column else table.times()
    labels = _labels(table, column_of, selected)
    if (table.units[column] or length_unit) in STRAIN_UNITS:
        gauges = _gauge_lengths(table, column, labels, gauge_length or {}, selected)
        elongation = elongation * gauges
        notes = (*notes, _describe_strain(path, column))
    units = {"elongation": length_unit, "load": load_unit}
    source = table.source(column_of, units, notes)
    travel = column if is_between_grips(column, "elongation" in columns) else ""
    rows_by_label = _rows_by_label(path, labels, column_of["direction"], selected)
    all_rows = LoadCurve(
        direction="",
        specimen="",
        elongation=elongation,
        load=load,
        path=path,
        time=time,
        notes=notes,
        source=source,
        between_grips=travel,
        lateral=_read_lateral_strain(table, length_unit),
    )
    return tuple(
        all_rows.part(rows, direction=direction, specimen=specimen)
        for (direction, specimen), rows in rows_by_label.items()
    )


def _read_lateral_strain(table: MachineTable, length_unit: LengthUnit | None) -> Array | None:
    """Return the strain (rows,) across the strip, in the unit of the file or of strains along.

    None is returned where its column is not named.
    """
    if "lateral" not in table.options.columns:
        return None
    name = table.column("lateral")
    unit = length_unit if length_unit in STRAIN_UNITS else "mm/mm"
    channel = Channel(unit=table.units[name] or unit)
    return table.values(name, STRAIN_UNITS, channel, "length_unit")


def _read_loads(
    table: MachineTable,
    column: str,
    load_unit: LoadUnit | None,
    width: float | None,
) -> Array:
    """Return the loads (rows,) N on a strip of full width `width` (mm)."""
    units = dict(LOAD_UNITS)
    file_unit = table.units[column]
    if file_unit in WIDTH_LOAD_UNITS or load_unit in WIDTH_LOAD_UNITS:
        if width is None:
            problem = f"{file_unit or load_unit} is a load per width; say the strip's width"
            raise table.error(column, problem)
        units |= {name: scale * width for name, scale in WIDTH_LOAD_UNITS.items()}
    return table.values(column, units, Channel(unit=load_unit), "load_unit")


def _gauge_lengths(
    table: MachineTable,
    column: str,
    labels: Sequence[tuple[str, str]],
    gauge_length: Mapping[str, float],
    selected: str | None,
) -> Array:
    """Return the gauge length (rows,) mm of each row; NaN of directions that are not selected."""
    for direction, _ in labels:
        if cut_of(direction) not in gauge_length and selected in (None, direction):
            problem = f"is a strain, no elongation: say the {direction} strip's gauge_length"
            raise table.error(column, problem)
    return np.array([gauge_length.get(cut_of(direction), np.nan) for direction, _ in labels])


def _describe_strain(path: Path, column: str) -> str:
    """Return a remark that a column of strain was used for the elongation."""
    doubt = "; its name does not say of what" if distance_to_strip(column) else ""
    return (
        f"{path.name}: the elongation is the strain of column {column!r} times gauge_length{doubt}"
    )


def _rows_by_label(
    path: Path,
    labels: Sequence[tuple[str, str]],
    column: str,
    selected: str | None,
) -> dict[tuple[str, str], list[int]]:
    """Return the rows of each (direction, specimen), only of the direction `selected` if given.

    InputError names `column`, that of the directions, if the selected one is not among them.
    """
    rows: dict[tuple[str, str], list[int]] = {}
    for row, label in enumerate(labels):
        if selected in (None, label[0]):
            rows.setdefault(label, []).append(row)
    if not rows:
        directions = ", ".join(dict.fromkeys(direction for direction, _ in labels))
        raise InputError(path, f"column {column!r}", f"no {selected}; it has: {directions}")
    return rows


def _labels(
    table: MachineTable, columns: Mapping[str, str], selected: str | None
) -> list[tuple[str, str]]:
    """Return direction and specimen of each row.

    `selected` is the direction of all rows if the file has no column of directions.
    """
    cells = table.table
    direction_column = columns["direction"]
    specimen_column = columns["specimen"]
    if not direction_column and selected is None:
        problem = (
            "no column says the direction; say direction, in a project files = { warp = [...] }."
            f" The file has: {', '.join(filter(None, table.names))[:300]}"
        )
        raise InputError(cells.path, f"line {table.header}", problem)
    unit = " deg" if re.search(r"deg|°", direction_column) else ""
    series = [cell + unit for cell in cells.text(direction_column)] if direction_column else []
    specimens = table.specimens(specimen_column) if specimen_column else series
    labels = []
    for row, line in enumerate(cells.lines):
        direction = str(selected)
        if series:
            field = f"line {line}, column {direction_column!r}"
            direction = direction_named(series[row], cells.path, field)
        labels.append((direction, specimens[row] if specimens else cells.path.stem))
    return labels


def split_at_restarts(curve: LoadCurve) -> tuple[LoadCurve, ...]:
    """Split a curve of several unnamed specimens: one starts where the elongation halves."""
    elongation = curve.elongation
    noise = 1e-2 * elongation.max()  # elongations near zero, before loading, are no restart
    starts = [0]
    largest = 0.0
    for row, value in enumerate(elongation):
        if 0 < largest and value < 0.5 * largest:
            starts.append(row)
            largest = 0.0
        if value > noise:
            largest = max(largest, value)
    return tuple(
        curve.part(slice(start, end), specimen=f"{curve.specimen} {number}")
        for number, (start, end) in enumerate(pairwise([*starts, len(elongation)]), start=1)
    )


#: Largest order: higher powers of the elongation cannot be distinguished numerically.
MAX_ORDER = 12


@dataclass(frozen=True, eq=False)
class LoadPolynomial:
    """A polynomial P(u) = c0 + c1 u + c2 u^2 + ..., load in N over elongation in mm.

    Attributes
    ----------
    coefficients : (order + 1,) array
        Coefficients c0, c1, c2 ...; that of u^k is in N / mm^k.
    end : float, mm
        Largest elongation for which the polynomial is valid.
    r_squared : float
        R^2 about the mean load, as in Table 3.1 of the thesis; NaN if unknown.
    rmse : float, N
        RMS error of the points; NaN if unknown.
    points : int
        Number of points that were fitted; 0 if unknown.
    """

    coefficients: Array
    end: float
    r_squared: float
    rmse: float
    points: int

    @property
    def order(self) -> int:
        """Return the highest power."""
        return len(self.coefficients) - 1

    def __call__(self, elongation: ArrayLike) -> Array:
        """Return the load in N at elongations in mm, of the same shape."""
        u = np.asarray(elongation, dtype=float)
        return np.asarray(polynomial.polyval(u, self.coefficients))


def fit_load_polynomial(
    elongation: ArrayLike,
    load: ArrayLike,
    order: int = 4,
    through_origin: bool = True,
) -> LoadPolynomial:
    """Fit a polynomial to the points of a curve by least squares.

    Parameters
    ----------
    elongation : (n,) array, mm
    load : (n,) array, N
    order : int
        Highest power.
    through_origin : bool
        Whether c0 is zero.

    Raises
    ------
    InputError
        The points are too few, or do not determine all coefficients.
    """
    u, f = checked_points(elongation, load)
    terms, scale, lowest = terms_of(u, order, through_origin)
    solution, _, rank, _ = np.linalg.lstsq(terms, f, rcond=1e-13)
    if rank < terms.shape[1]:
        problem = f"the elongations settle only {rank} of {terms.shape[1]} coefficients; lower it"
        raise InputError(None, f"order {order}", problem)
    residual = f - terms @ solution
    coefficients = np.zeros(order + 1)
    coefficients[lowest:] = solution / scale ** np.arange(lowest, order + 1)
    squares_about_mean = ((f - f.mean()) ** 2).sum()
    r_squared = float(1.0 - (residual**2).sum() / squares_about_mean)
    rmse = float(np.sqrt((residual**2).mean()))
    return LoadPolynomial(coefficients, float(u.max()), r_squared, rmse, len(u))


def specimen_deviation(elongation: Array, load: Array, fitted: LoadPolynomial) -> float:
    """Return the sample standard deviation (n - 1) of the deviations of points from a polynomial.

    Parameters
    ----------
    elongation : (n,) array, mm
    load : (n,) array, N
    fitted : LoadPolynomial

    Returns
    -------
    float, N
        The published values are 21.7, 64.1 and 40.3 N.
    """
    if len(load) < 2:
        raise InputError(None, "curves", f"scatter needs two points, there are {len(load)}")
    return float((load - fitted(elongation)).std(ddof=1))


def checked_points(elongation: ArrayLike, load: ArrayLike) -> tuple[Array, Array]:
    """Return points as arrays, (n,) mm and (n,) N; InputError if no curve can be fitted to them."""
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
    """Return the powers of scaled elongations that a load polynomial is fitted with.

    Parameters
    ----------
    u : (n,) array, mm
    order : int
        Highest power.
    through_origin : bool
        Whether the power 0 is left out.

    Returns
    -------
    terms : (n, coefficients) array
        Powers of u / scale.
    scale : float, mm
        Largest elongation.
    lowest : int
        Lowest power: 1 through the origin, else 0.
    """
    if not 1 <= order <= MAX_ORDER:
        raise InputError(None, "order", f"expected 1 to {MAX_ORDER}, got {order}")
    lowest = int(through_origin)
    scale = np.abs(u).max()
    count = order + 1 - lowest
    if len(u) < count:
        problem = f"{count} coefficients need as many points, there are {len(u)}; lower it"
        raise InputError(None, f"order {order}", problem)
    return np.vander(u / scale, order + 1, increasing=True)[:, lowest:], scale, lowest


@dataclass(frozen=True, eq=False)
class PublishedPolynomial:
    """A published polynomial of load over elongation of a gauge, for one direction.

    Attributes
    ----------
    direction : str
        "warp", "fill" or "bias".
    gauge_length, final_length : float, mm
        Length of the gauge at rest and at the end of the polynomial.
    polynomial : LoadPolynomial
    scatter : float, N
        Standard deviation of measured points about the polynomial; NaN if unknown.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial
    scatter: float


def read_published_polynomials(
    path: Path | str, format: str | None = None
) -> dict[str, PublishedPolynomial]:
    """Read published polynomials of load (N, of the full strip) over elongation (mm).

    Parameters
    ----------
    path : path
    format : str, optional
        Name of the format; recognised by the content if omitted.

    Returns
    -------
    dict
        Polynomial by direction.
    """
    return read_file("load polynomials", path, format)
