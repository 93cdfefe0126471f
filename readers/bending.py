"""Read load over deflection of three-point bending tests, and compare repetitions and models."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from .frames import Array, FrameSource
from .machine_tables import AS_FOUND, Channel, TableOptions, read_machine_table
from .units import LENGTH_UNITS, LOAD_UNITS

#: Which deflection counts as zero: as read, the first reading, or the origin of the straight line
#: through the first readings.
Zero = Literal["none", "first", "line"]
#: Weight in N of one kg, for loads given as masses on the strap.
GRAVITY = 9.80665
#: N in one of each unit of load.
FORCE_UNITS: Mapping[str, float] = {**LOAD_UNITS, "kg": GRAVITY}
NEEDED = ("deflection", "load")
#: Reason, in run records, why readings are left out.
UNLOADING = "after the largest deflection"


@dataclass(frozen=True, eq=False)
class BendingCurve:
    """Load over deflection of one repetition up to its largest deflection.

    Attributes
    ----------
    repetition : str
        Name of the repetition.
    deflection : (n,) array, mm
        Deflections, never falling.
    load : (n,) array, N
    path : Path or None
        File of the readings; None if they were given as arrays.
    dropped : mapping
        Number of readings that are left out, by reason.
    source : FrameSource or None
        Format, columns and units that were read.
    """

    repetition: str
    deflection: Array
    load: Array
    path: Path | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    source: FrameSource | None = None


def read_bending_curves(
    path: Path | str,
    *,
    deflection: Channel = AS_FOUND,
    load: Channel = AS_FOUND,
    repetition: str | None = None,
    preload: float = 0.0,
    zero: Zero = "none",
    comment: str = "#",
    decimal: Literal[".", ","] | None = None,
    format: str | None = None,
) -> tuple[BendingCurve, ...]:
    """Read the repetitions in one file, each up to its largest deflection.

    Parameters
    ----------
    path : path
    deflection, load : Channel
        Columns, units and scales.
    repetition : str, optional
        Column that names the repetition of each row.
    preload : float, N
        Load that is added to all readings, such as the weight of the strap.
    zero : {"none", "first", "line"}
        Deflection that counts as zero: as read, the first reading, or where the straight line
        through the first four readings has no load.
    comment, decimal, format
        As in `TableOptions` and `read_machine_table`.

    Raises
    ------
    InputError
        A column or a unit is missing, or a repetition has a single reading.
    """
    path = Path(path)
    channels = {"deflection": deflection, "load": load}
    named = {quantity: c.column for quantity, c in channels.items() if c.column}
    if repetition is not None:
        named["repetition"] = repetition
    table = read_machine_table(path, TableOptions(named, NEEDED, comment, decimal), format)
    columns = {name: table.column(name) for name in (*NEEDED, "repetition")}
    deflections = table.values(columns["deflection"], LENGTH_UNITS, deflection)
    loads = table.values(columns["load"], FORCE_UNITS, load) + preload
    source = table.source(columns, {quantity: c.unit for quantity, c in channels.items()})
    labels = [path.stem] * len(loads)
    if columns["repetition"]:
        labels = table.table.text(columns["repetition"])
    curves = []
    for label in dict.fromkeys(labels):
        rows = [row for row, label_of_row in enumerate(labels) if label_of_row == label]
        line = f"line {table.table.lines[rows[0]]}"
        if len(rows) < 2:
            problem = f"repetition {label!r} has one reading; expected two or more"
            raise InputError(path, line, problem)
        name = f"{path.stem} {label}" if columns["repetition"] else label
        readings = BendingCurve(name, deflections[rows], loads[rows], path, source=source)
        curves.append(loading_of(readings, zero, line))
    return tuple(curves)


def loading_of(readings: BendingCurve, zero: Zero, location: str) -> BendingCurve:
    """Return the readings up to the largest deflection, sorted by deflection from its zero.

    Parameters
    ----------
    readings : BendingCurve
        Readings as they were recorded.
    zero : {"none", "first", "line"}
        Deflection that counts as zero, see `read_bending_curves`.
    location : str
        Where the readings stand, for the message.

    Raises
    ------
    InputError
        Deflections or loads are below zero, or the first readings do not rise, and a line through
        them is to give the zero.
    """
    u = readings.deflection
    for quantity, values in (("deflections", u), ("loads", readings.load)):
        low, high = float(values.min()), float(values.max())
        if -low > high:
            problem = f"the {quantity} of {readings.repetition!r} go from {high:.4g} to {low:.4g}"
            advice = "those of a bent cylinder are above zero: reverse their sign"
            raise InputError(readings.path, location, f"{problem}, and {advice}")
    try:
        u = u - _zero_deflection(u, readings.load, zero)
    except ValueError:
        problem = f"the first readings of {readings.repetition!r} do not rise: no zero to be found"
        raise InputError(readings.path, location, problem) from None
    # Readings are sorted, so that deflections that fall by noise do not count as unloading.
    order = np.argsort(u[: np.argmax(u) + 1], kind="stable")
    unloading = len(u) - len(order)
    dropped = {UNLOADING: unloading} if unloading else {}
    return replace(readings, deflection=u[order], load=readings.load[order], dropped=dropped)


def bending_file_name(curve: BendingCurve) -> str:
    """Return the name of the file to which the arrays of a repetition are written."""
    return f"{curve.repetition}.csv"


def _zero_deflection(
    deflection: Array,
    load: Array,
    zero: Zero,
    readings: int = 4,
    min_rise: float = 1e-6,
) -> float:
    """Return the deflection that counts as zero.

    Parameters
    ----------
    deflection : (n,) array, mm
    load : (n,) array, N
    zero : {"none", "first", "line"}
    readings : int
        Number of first readings that the straight line is fitted to.
    min_rise : float
        Least rise of the line, as a share of the largest of these loads, that is not rounding.

    Raises
    ------
    ValueError
        The line does not rise.
    """
    if zero != "line":
        return float(deflection[0]) if zero == "first" else 0.0
    x = deflection[:readings]
    y = load[:readings]
    slope, intercept = np.polyfit(x, y, 1) if np.ptp(x) > 0 else np.zeros(2)
    if not slope * np.ptp(x) > min_rise * np.abs(y).max():
        raise ValueError("the first readings do not rise")
    return float(-intercept / slope)


@dataclass(frozen=True, eq=False)
class BendingScatter:
    """Mean load and its scatter over the repetitions that reach each deflection.

    Attributes
    ----------
    deflection : (k,) array, mm
    mean, deviation : (k,) arrays, N
        Mean and standard deviation of the load. The mean is NaN where no repetition reaches the
        deflection, the standard deviation where fewer than two do.
    count : (k,) array of int
        Number of repetitions that reach the deflection.
    """

    deflection: Array
    mean: Array
    deviation: Array
    count: NDArray[np.intp]


@dataclass(frozen=True)
class BendingError:
    """Errors of a model's load against the measured readings.

    Attributes
    ----------
    rms, mean : float, N
        RMS and mean of the model's load less the measured one; a positive mean is too stiff.
    relative : float
        RMS error over the largest measured load.
    compared : int
        Number of readings within the model's curve.
    beyond_count : int
        Number of readings at larger deflections than the model's.
    """

    rms: float
    mean: float
    relative: float
    compared: int
    beyond_count: int


def scatter(curves: Sequence[BendingCurve], places: int = 61) -> BendingScatter:
    """Return mean and sample standard deviation of repetitions over a grid of deflections.

    Parameters
    ----------
    curves : sequence of BendingCurve
        Repetitions, which are interpolated linearly.
    places : int
        Number of deflections of the grid.
    """
    low = min(curve.deflection[0] for curve in curves)
    high = max(curve.deflection[-1] for curve in curves)
    grid = np.linspace(low, high, places)
    loads = pd.DataFrame([_load_at(grid, curve) for curve in curves])
    return BendingScatter(
        grid,
        mean=loads.mean().to_numpy(),
        deviation=loads.std().to_numpy(),
        count=np.asarray(loads.count(), dtype=np.intp),
    )


def _load_at(grid: Array, curve: BendingCurve) -> Array:
    """Return the mean load (N) at each deflection; NaN beyond the curve.

    Parameters
    ----------
    grid : (n,) array, mm
        The deflections.
    """
    load = pd.Series(curve.load).groupby(curve.deflection).mean()
    return np.interp(grid, load.index, load, left=np.nan, right=np.nan)


def model_error(
    curves: Sequence[BendingCurve], deflection: ArrayLike, load: ArrayLike
) -> BendingError | None:
    """Return the errors of a model's load against measured readings.

    Parameters
    ----------
    curves : sequence of BendingCurve
        Measured repetitions.
    deflection : (frames,) array, mm
        Deflections of the model.
    load : (frames,) array, N
        Loads of the model.

    Returns
    -------
    BendingError or None
        None where no reading within the model's deflections has a load.
    """
    x = np.asarray(deflection, dtype=float)
    y = np.asarray(load, dtype=float)
    measured = np.concatenate([[], *(curve.deflection for curve in curves)])
    measured_load = np.concatenate([[], *(curve.load for curve in curves)])
    is_within = (measured >= x[0]) & (measured <= x[-1])
    largest = np.abs(measured_load[is_within]).max(initial=0.0)
    if not largest > 0:
        return None
    error = np.interp(measured[is_within], x, y) - measured_load[is_within]
    rms = np.sqrt(np.mean(error**2))
    compared = int(is_within.sum())
    beyond_count = int((measured > x[-1]).sum())
    return BendingError(rms, error.mean(), rms / largest, compared, beyond_count)
