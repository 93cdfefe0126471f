"""Rows of a file as the points of a frame: lengths in mm, axes, and which rows are not points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frame_headings import LENGTHS, PIXELS
from .frames import ALL_ZERO, FLAGGED, NEGATIVE_SIGMA, QUANTITIES, Frame, FrameOptions, FrameSource

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameRows:
    """One frame as its file has it.

    Parameters
    ----------
    values : (rows,) of x, y, z, dx, dy, dz, those that there are; NaN where correlation was lost.
        Of "x deformed" and so on where the file has places after the motion.
    names, units : what the file calls each, and the unit it names, "" or missing for none.
    valid : (rows,) what the file's own flag says; None without one.
    sigma : (rows,) below zero where correlation was lost; None without one.
    camera_axes : whether y points down and z away from the camera, as in an image.
    dropped : rows that are not in `values`, by why.
    """

    values: Mapping[str, Array]
    names: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    valid: NDArray[np.bool_] | None = None
    sigma: Array | None = None
    camera_axes: bool = False
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def frame_of(rows: FrameRows, options: FrameOptions, path: Path, format: str) -> Frame:
    """The frame of the rows: reference places and displacements in mm.

    Rows that the file's flag rejects, those with a sigma below zero and those that are zero
    throughout are left out and counted. One row of zeros is a point in a frame in which nothing
    moves.

    Raises
    ------
    InputError : a quantity that is asked for is not there, or is in pixels.
    """
    notes = list(rows.notes)
    values = {name: _in_mm(rows, name, options, path) for name in rows.values}
    keep, dropped = _kept(rows, values)
    values = {name: value[keep] for name, value in values.items()}
    sigma = None if rows.sigma is None else rows.sigma[keep]
    _complete(values, options, notes)
    missing = [name for name in options.quantities if name not in values]
    if missing:
        there = ", ".join(rows.names.values())[:300]
        problem = f"no column of {' and '.join(missing)}; name them with columns. Read: {there}"
        if set(missing) <= {"z", "dz"}:
            problem = f"planar correlation, without {' and '.join(missing)}; a stereo one is needed"
        raise InputError(path, "", problem)
    count = int(keep.sum())
    table = np.full((count, 6), np.nan)
    for index, quantity in enumerate(QUANTITIES):
        if quantity in values:
            table[:, index] = values[quantity]
    camera_axes = rows.camera_axes if options.camera_axes is None else options.camera_axes
    if camera_axes:
        table[:, [1, 2, 4, 5]] *= -1.0
        notes.append("y and z are turned over: in the file y points down, z away from the camera")
    named = {name: unit for name, unit in rows.units.items() if unit}
    source = FrameSource(format, dict(rows.names), named, tuple(notes))
    return Frame(table[:, :3], table[:, 3:], path, dropped, sigma, source)


def _in_mm(rows: FrameRows, name: str, options: FrameOptions, path: Path) -> Array:
    unit = rows.units.get(name, "")
    if unit.casefold() in PIXELS:
        problem = f"is in pixels; export lengths, or name a column of {name} in mm with columns"
        raise InputError(path, f"column {rows.names[name]!r}", problem)
    scale = LENGTHS.get(unit.casefold(), options.length_scale)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(rows.values[name] * scale)


def _kept(rows: FrameRows, values: Mapping[str, Array]) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Which rows are points, and how many are not, by why."""
    count = len(next(iter(values.values())))
    keep = np.ones(count, dtype=bool)
    dropped = {name: number for name, number in rows.dropped.items() if number}
    zero = np.all([value == 0 for value in values.values()], axis=0)
    at_rest = all((np.nan_to_num(v) == 0).all() for name, v in values.items() if name[0] == "d")
    if at_rest and zero.sum() == 1:
        zero[:] = False
    reasons = [(FLAGGED, None if rows.valid is None else ~rows.valid)]
    reasons += [(NEGATIVE_SIGMA, None if rows.sigma is None else rows.sigma < 0), (ALL_ZERO, zero)]
    for reason, bad in reasons:
        more = 0 if bad is None else int((bad & keep).sum())
        if bad is not None and more:
            dropped[reason] = dropped.get(reason, 0) + more
            keep &= ~bad
    return keep, dropped


def _complete(values: dict[str, Array], options: FrameOptions, notes: list[str]) -> None:
    """Reference places and displacements from each other; the planes of a planar correlation."""
    if options.coordinates == "deformed":
        for axis in "xyz":
            if axis in values:
                values[f"{axis} deformed"] = values.pop(axis)
    after = [axis for axis in "xyz" if f"{axis} deformed" in values]
    back = [axis for axis in after if axis not in values and f"d{axis}" in values]
    forth = [axis for axis in after if axis in values and f"d{axis}" not in values]
    for axis in back:
        values[axis] = values[f"{axis} deformed"] - values[f"d{axis}"]
    for axis in forth:
        values[f"d{axis}"] = values[f"{axis} deformed"] - values[axis]
    if back:
        notes.append(
            f"{', '.join(back)} are places in the deformed state; the displacement is taken off"
        )
    if forth:
        notes.append(f"displacements along {', '.join(forth)} are deformed less reference places")
    if options.planar and not {"z", "dz", "z deformed"} & set(values):
        values["z"] = values["dz"] = np.zeros_like(values["x"])
        notes.append("planar correlation: z and dz are taken to be zero")
