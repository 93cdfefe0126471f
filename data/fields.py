"""Displacement fields of a bubble, as a stereo image correlation (DIC) exports them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import FrameOptions, read_frames

#: What a file must hold: reference place and displacement; the names in the file may differ.
QUANTITIES = ("x", "y", "dx", "dy", "dz")
#: How a table of exactly these columns is read.
PLAIN = FrameOptions(QUANTITIES, holes=False)


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements measured (or computed) at one pressure.

    Parameters
    ----------
    pressure : MPa.
    points : (n, 2) mm, places in the flat reference state; x is warp, y is fill.
    displacement : (n, 3) mm.
    dropped : doubtful points that were left out.
    """

    pressure: float
    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    dropped: int


def read_fields(
    files: Sequence[Path | str],
    pressures: Sequence[float],
    columns: Mapping[str, str] | None = None,
    flag_column: str | None = None,
    comment: str = "#",
    length_scale: float = 1.0,
    format: str | None = None,
) -> tuple[DisplacementField, ...]:
    """Read one frame a pressure.

    Parameters
    ----------
    files : each with one frame; columns that are not asked for are ignored.
    pressures : MPa, one a file.
    columns, flag_column, comment, length_scale : see `frames.FrameOptions`; quantities are `x`,
        `y`, `dx`, `dy`, `dz`.
    format : its name; found by the files' content unless given.

    Raises
    ------
    InputError : naming file, line and column: no such file, missing columns, an empty table,
        cells that are not finite numbers, nothing left without the doubtful rows.
    """
    if len(files) != len(pressures):
        problem = f"expected one file a pressure, got {len(files)} for {len(pressures)} pressures"
        raise InputError(None, "files", problem)
    options = FrameOptions(QUANTITIES, columns, flag_column, comment, length_scale, holes=False)
    return tuple(
        read_field(file, float(pressure), options, format)
        for file, pressure in zip(files, pressures, strict=True)
    )


def read_field(
    path: Path | str,
    pressure: float,
    options: FrameOptions = PLAIN,
    format: str | None = None,
) -> DisplacementField:
    """Read the field of one file, at a pressure in MPa.

    Points where a quantity is not a number, which only formats that mark lost correlation so have,
    are dropped as the doubtful ones are.

    Raises
    ------
    InputError : as `read_fields`; several frames in the file.
    """
    frames = read_frames([path], options, format)
    if len(frames) != 1:
        raise InputError(path, "", f"expected one frame, one a pressure; found {len(frames)}")
    (frame,) = frames
    values = np.concatenate([frame.points[:, :2], frame.displacement], axis=1)
    whole = np.isfinite(values).all(axis=1)
    dropped = frame.dropped + int((~whole).sum())
    if not whole.any():
        why = f" ({options.flag_column!r} is not 0)" if options.flag_column is not None else ""
        problem = f"all {dropped} rows are doubtful{why}; none is left to use"
        raise InputError(path, "", problem)
    values = values[whole]
    return DisplacementField(pressure, values[:, :2], values[:, 2:], dropped)
