"""Load over deflection of three-point bending, as sensors or a notebook recorded it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .frames import Array, FrameSource
from .machine_tables import AS_FOUND, Channel, TableOptions, read_machine_table
from .tables import LENGTH_UNITS, LOAD_UNITS

Zero = Literal["none", "first", "line"]
#: N per kg of the weights on the strap, and N in one of each unit of load.
GRAVITY = 9.80665
FORCE_UNITS: Mapping[str, float] = {**LOAD_UNITS, "kg": GRAVITY}
NEEDED = ("deflection", "load")
#: Readings that the straight line of zero = "line" goes through, and the share of the largest load
#: among them that it must rise by, to be more than rounding.
FIRST_READINGS, RISES = 4, 1e-6
#: Why readings are left out.
UNLOADING = "after the largest deflection"


@dataclass(frozen=True, eq=False)
class BendingCurve:
    """One repetition as far as it was loaded: (n,) mm and N, by rising deflection."""

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

    repetition : name of the column that tells them apart. preload : N beside the readings. zero :
    of the deflection: "none", as read; "first", the first reading is zero; "line", the straight
    line through the first four readings goes through the origin.
    """
    path = Path(path)
    named = {k: c.column for k, c in (("deflection", deflection), ("load", load)) if c.column}
    if repetition is not None:
        named["repetition"] = repetition
    found = read_machine_table(path, TableOptions(named, NEEDED, comment, decimal), format)
    columns = {name: found.column(name) for name in (*NEEDED, "repetition")}
    way = found.values(columns["deflection"], LENGTH_UNITS, deflection)
    force = found.values(columns["load"], FORCE_UNITS, load) + preload
    which = columns["repetition"]
    asked = {"deflection": deflection.unit, "load": load.unit}
    source = found.source(columns, asked)
    names = [path.stem] * len(way) if not which else found.table.text(which).tolist()
    curves = []
    for name in dict.fromkeys(names):
        rows = [row for row, own in enumerate(names) if own == name]
        at = f"line {found.table.lines[rows[0]]}"
        if len(rows) < 2:
            raise InputError(path, at, f"repetition {name!r} has one reading; expected two or more")
        full = f"{path.stem} {name}" if which else name
        moved = way[rows] - _start(way[rows], force[rows], zero, path, at, full)
        # Sorted up to the largest deflection: noise is no unloading.
        order = np.argsort(moved[: int(np.argmax(moved)) + 1], kind="stable")
        after = len(rows) - len(order)
        dropped = {UNLOADING: after} if after else {}
        curves.append(BendingCurve(full, moved[order], force[rows][order], path, dropped, source))
    return tuple(curves)


def _start(way: Array, force: Array, zero: Zero, path: Path, at: str, name: str) -> float:
    """Return the deflection that counts as zero, mm."""
    if zero != "line":
        return float(way[0]) if zero == "first" else 0.0
    x = way[:FIRST_READINGS]
    y = force[:FIRST_READINGS]
    slope, intercept = np.polyfit(x, y, 1) if np.ptp(x) > 0 else np.zeros(2)
    if not slope * np.ptp(x) > RISES * np.abs(y).max():
        problem = f"the first readings of {name!r} do not rise: no zero to be found"
        raise InputError(path, at, problem)
    return float(-intercept / slope)


PLACES = 61  # of the grid


@dataclass(frozen=True, eq=False)
class BendingScatter:
    """Mean and deviation (k,) N of the repetitions (`count`) that reach each deflection, mm."""

    deflection: Array
    mean: Array
    deviation: Array
    count: NDArray[np.intp]


@dataclass(frozen=True)
class BendingError:
    """Errors (N, positive: too stiff) of a model's curve; relative : rms over the largest load."""

    rms: float
    mean: float
    relative: float
    compared: int
    beyond: int


def scatter(curves: Sequence[BendingCurve], places: int = PLACES) -> BendingScatter:
    """Return mean and sample standard deviation of the repetitions, interpolated linearly."""
    if not curves:
        raise ValueError("scatter: no repetitions")
    low = min(float(c.deflection[0]) for c in curves)
    high = max(float(c.deflection[-1]) for c in curves)
    grid = np.linspace(low, high, places)
    each = []
    for c in curves:  # without repeats, with the mean load of each deflection
        x, which = np.unique(c.deflection, return_inverse=True)
        mean = np.bincount(which, c.load) / np.bincount(which)
        each.append(np.interp(grid, x, mean, left=np.nan, right=np.nan))
    loads = np.array(each)
    there = np.isfinite(loads)
    count = there.sum(axis=0)
    total = np.where(there, loads, 0.0).sum(axis=0)
    mean = np.divide(total, count, out=np.full(places, np.nan), where=count > 0)
    square = (np.where(there, loads - mean, 0.0) ** 2).sum(axis=0)
    variance = np.divide(square, count - 1, out=np.full(places, np.nan), where=count > 1)
    return BendingScatter(grid, mean, np.sqrt(variance), count)


def model_error(
    curves: Sequence[BendingCurve], deflection: ArrayLike, load: ArrayLike
) -> BendingError | None:
    """Return the load of a model (frames,) N less that read; None where it reaches no load."""
    x = np.asarray(deflection, dtype=float)
    y = np.asarray(load, dtype=float)
    way = np.concatenate([c.deflection for c in curves]) if curves else np.empty(0)
    read = np.concatenate([c.load for c in curves]) if curves else np.empty(0)
    inside = (way >= x[0]) & (way <= x[-1])
    largest = float(np.abs(read[inside]).max(initial=0.0))
    if not largest > 0:
        return None
    off = np.interp(way[inside], x, y) - read[inside]
    rms = float(np.sqrt(np.mean(off**2)))
    return BendingError(
        rms, float(off.mean()), rms / largest, int(inside.sum()), int((way > x[-1]).sum())
    )
