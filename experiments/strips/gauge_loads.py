"""Pair a machine's loads with the frames of a virtual strain gauge, one by one or by time."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...readers.curves import LoadCurve, direction_named
from ...readers.machine_tables import read_machine_loads, read_times
from ...solvers.base import Array
from .gauge import GaugeRecord

log = logging.getLogger(__name__)


def gauge_load_curve(
    record: GaugeRecord,
    loads: ArrayLike,
    *,
    direction: str,
    specimen: str,
    frame_times: NDArray[Any] | None = None,
    load_times: Array | None = None,
    path: Path | None = None,
) -> LoadCurve:
    """Return the load curve of a gauge: the machine's load over the gauge's elongation.

    Frames in which the gauge was lost are left out.

    Parameters
    ----------
    record : GaugeRecord
        Gauge through n frames.
    loads : (n,) or (k,) array, N
        A load for each frame; or, with times, k loads at `load_times`, which are interpolated at
        `frame_times`. Frames before the first or after the last load are left out, which is
        logged.
    direction : str
        "warp", "fill" or "bias".
    specimen : str
        Name of the specimen.
    frame_times : (n,) array, s, or None
        Time of each frame by the machine's clock.
    load_times : (k,) array, s, or None
        Time of each load, rising.
    path : Path or None
        File of the loads, for messages.

    Raises
    ------
    InputError
        `load_times` do not rise, or fewer than two frames have both a length and a load.
    """
    load = np.asarray(loads, dtype=float)
    is_used = np.isfinite(record.elongation)
    if frame_times is not None and load_times is not None:
        if len(load) < 2 or (np.diff(load_times) <= 0).any():
            problem = "expected two or more, each later than the one before"
            raise InputError(path, "load_times", problem)
        load = np.interp(frame_times, load_times, load)
        has_load = (frame_times >= load_times[0]) & (frame_times <= load_times[-1])
        if not has_load.all():
            without = np.flatnonzero(~has_load)
            problem = "%s: %d of %d frames have no load at their time: %s"
            numbers = ", ".join(map(str, without))
            log.warning(problem, specimen, len(without), len(has_load), numbers)
        is_used &= has_load
    if is_used.sum() < 2:
        frames = f"{is_used.sum()} of {len(is_used)} frames"
        problem = f"only {frames} have both length and load; expected two"
        raise InputError(path, f"specimen {specimen!r}", problem)
    return LoadCurve(
        direction_named(direction),
        specimen,
        record.elongation[is_used],
        load[is_used],
        path,
        time=None if frame_times is None else frame_times[is_used],
        frame=np.flatnonzero(is_used),
    )


@dataclass(frozen=True)
class PairedLoads:
    """Where the loads of a machine are, and how they are paired with the frames of a gauge.

    Loads are paired by time if `frame_times` or `frame_interval` is given, else one by one.

    Attributes
    ----------
    path : Path
        Export of the machine.
    direction : str
        "warp", "fill" or "bias".
    specimen : str
        Name of the specimen.
    load_column, load_unit, decimal, format : str or None
        Column and unit of the load, decimal mark and format of the export, where they are not to
        be detected.
    frame_times : Path or None
        File with a table of the frames' times.
    frame_time_column : str or None
        Column of the times in that table.
    frame_interval : float, s, or None
        Time between frames, the first of which is at 0 s.
    time_column : str or None
        Column of the times in the export.
    time_offset : float, s, or None
        Time by the machine's clock less time by the frames' clock.

    Raises
    ------
    InputError
        Options contradict each other, or have no effect without another.
    """

    path: Path
    direction: str
    specimen: str
    load_column: str | None = None
    load_unit: Literal["N", "kN", "lbf"] | None = None
    decimal: Literal[".", ","] | None = None
    format: str | None = None
    frame_times: Path | None = None
    frame_time_column: str | None = None
    frame_interval: float | None = None
    time_column: str | None = None
    time_offset: float | None = None

    def __post_init__(self) -> None:
        direction_named(self.direction)
        self._check_times()
        for name in ("frame_interval", "time_offset"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise InputError(None, name, f"expected a finite number, got {value:g}")
        if not (self.specimen.strip() and self.specimen.isprintable()):
            problem = f"expected a name on one line, got {self.specimen!r}"
            raise InputError(None, "specimen", problem)

    def _check_times(self) -> None:
        """Raise InputError for two ways of pairing, or options of the way that is not taken."""
        if self.frame_times is not None and self.frame_interval is not None:
            raise InputError(None, "frame_times, frame_interval", "give one of them, not both")
        if not self.timed:
            for name in ("time_column", "time_offset"):
                if getattr(self, name) is not None:
                    problem = "means nothing without frame_times or frame_interval"
                    raise InputError(None, name, problem)
        if self.frame_times is None and self.frame_time_column is not None:
            raise InputError(None, "frame_time_column", "means nothing without frame_times")

    @property
    def timed(self) -> bool:
        """Return whether loads and frames are paired by time."""
        return self.frame_times is not None or self.frame_interval is not None


def loads_at_frames(record: GaugeRecord, loads: PairedLoads) -> LoadCurve:
    """Read the loads of a machine, and return the load curve of a gauge.

    Parameters
    ----------
    record : GaugeRecord
        Gauge through the frames of the test.
    loads : PairedLoads
        Files of loads and times, and how they are paired with the frames.

    Raises
    ------
    InputError
        The files cannot be read, or do not have a load or a time for each frame.
    """
    count = len(record.length)
    times = _frame_times(loads, count)
    columns = {}
    if loads.load_column is not None:
        columns["load"] = loads.load_column
    if loads.time_column is not None:
        columns["time"] = loads.time_column
    with _naming("load_column, time_column" if loads.timed else "load_column"):
        machine_loads, machine_times = read_machine_loads(
            loads.path,
            columns=columns,
            timed=loads.timed,
            load_unit=loads.load_unit,
            decimal=loads.decimal,
            format=loads.format,
        )
    if not loads.timed and len(machine_loads) != count:
        problem = (
            f"expected one load for each of the {count} frames, got {len(machine_loads)};"
            " frame_times or frame_interval pair by time"
        )
        raise InputError(loads.path, "", problem)
    return gauge_load_curve(
        record,
        machine_loads,
        direction=loads.direction,
        specimen=loads.specimen.strip(),
        frame_times=None if times is None else times + (loads.time_offset or 0.0),
        load_times=machine_times,
        path=loads.path,
    )


def _frame_times(loads: PairedLoads, count: int) -> Array | None:
    """Return the times (s) of `count` frames by their clock; None if not paired by time."""
    if loads.frame_interval is not None:
        return np.asarray(loads.frame_interval * np.arange(count))
    if loads.frame_times is None:
        return None
    with _naming("frame_time_column"):
        times = read_times(loads.frame_times, loads.frame_time_column, decimal=loads.decimal)
    if len(times) != count:
        problem = f"expected one time for each of the {count} frames, got {len(times)}"
        raise InputError(loads.frame_times, "", problem)
    return times


@contextmanager
def _naming(fields: str) -> Iterator[None]:
    """Name `fields` in errors in place of the readers' argument `columns`."""
    try:
        yield
    except InputError as error:
        problem = error.problem.replace("with columns", f"with {fields}")
        raise InputError(error.path, error.field, problem) from None
