"""The loads of a test machine beside a virtual strain gauge: one a frame, or paired by time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from .curves import LoadCurve, direction_named
from .gauge import GaugeRecord, gauge_load_curve
from .machine_loads import read_machine_loads, read_times


@dataclass(frozen=True)
class PairedLoads:
    """A machine's loads, and how they belong to the frames of a gauge.

    Parameters
    ----------
    path : the machine's export.
    direction, specimen : of the strip; the direction by any of its names.
    load_column, time_column : names in the export, where they are not found by themselves.
    load_unit : N or kN, where the export names none.
    decimal : the mark in the export and in the table of times, where it is not clear.
    format : of the export, found by its content unless given.
    frame_times : a table of the frames' times: pairs the loads by time. frame_time_column : name
        of its column.
    frame_interval : s between frames, the first at 0: pairs the loads by time too.
    time_offset : s, the machine's clock less the frames'.

    Raises
    ------
    InputError : naming what is out of range, contradicts another, or would have no effect.
    """

    path: Path
    direction: str
    specimen: str
    load_column: str | None = None
    load_unit: Literal["N", "kN"] | None = None
    decimal: Literal[".", ","] | None = None
    format: str | None = None
    frame_times: Path | None = None
    frame_time_column: str | None = None
    frame_interval: float | None = None
    time_column: str | None = None
    time_offset: float | None = None

    def __post_init__(self) -> None:
        direction_named(self.direction)
        if self.frame_times is not None and self.frame_interval is not None:
            raise InputError(None, "frame_times, frame_interval", "give one of them, not both")
        if not self.timed:
            self._refuse("time_column", "time_offset", needs="frame_times or frame_interval")
        if self.frame_times is None:
            self._refuse("frame_time_column", needs="frame_times")
        for name in ("frame_interval", "time_offset"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise InputError(None, name, f"expected a finite number, got {value:g}")
        if not (self.specimen.strip() and self.specimen.isprintable()):
            problem = f"expected a name on one line, got {self.specimen!r}"
            raise InputError(None, "specimen", problem)

    @property
    def timed(self) -> bool:
        """Whether loads and frames are paired by time."""
        return self.frame_times is not None or self.frame_interval is not None

    def _refuse(self, *useless: str, needs: str) -> None:
        for name in useless:
            if getattr(self, name) is not None:
                raise InputError(None, name, f"means nothing without {needs}")


def loads_at_frames(record: GaugeRecord, loads: PairedLoads) -> LoadCurve:
    """The load curve of a gauge.

    Raises
    ------
    InputError : naming the file of loads or of times; counts that do not agree.
    """
    count, times = len(record.length), None
    if loads.frame_interval is not None:
        times = loads.frame_interval * np.arange(count)
    if loads.frame_times is not None:
        with _naming("frame_time_column"):
            times = read_times(loads.frame_times, loads.frame_time_column, decimal=loads.decimal)
        if len(times) != count:
            problem = f"expected one time for each of the {count} frames, got {len(times)}"
            raise InputError(loads.frame_times, "", problem)
    named = {"load": loads.load_column, "time": loads.time_column}
    with _naming("load_column, time_column" if loads.timed else "load_column"):
        machine = read_machine_loads(
            loads.path,
            columns={quantity: column for quantity, column in named.items() if column is not None},
            timed=loads.timed,
            load_unit=loads.load_unit,
            decimal=loads.decimal,
            format=loads.format,
        )
    if not loads.timed and len(machine.load) != count:
        problem = (
            f"expected one load for each of the {count} frames, got {len(machine.load)};"
            " frame_times or frame_interval pair by time"
        )
        raise InputError(loads.path, "", problem)
    return gauge_load_curve(
        record,
        machine.load,
        direction=loads.direction,
        specimen=loads.specimen.strip(),
        frame_times=None if times is None else times + (loads.time_offset or 0.0),
        load_times=machine.time,
        path=loads.path,
    )


@contextmanager
def _naming(fields: str) -> Iterator[None]:
    """Readers ask for their argument `columns`, which is called otherwise here."""
    try:
        yield
    except InputError as error:
        problem = error.problem.replace("with columns", f"with {fields}")
        raise InputError(error.path, error.field, problem) from None
