"""Displacement fields of a bubble, as a stereo image correlation (DIC) exports them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .frames import LOST, Frame, FrameOptions, FrameSource, read_frames

#: What a file must hold: reference place and displacement; the names in the file may differ. The
#: height z of the reference state is read where it is there.
QUANTITIES = ("x", "y", "dx", "dy", "dz")
#: How a table of exactly these columns is read.
PLAIN = FrameOptions(QUANTITIES)


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements measured (or computed) at one pressure (MPa).

    points : (n, 2) mm in the reference state; x is warp, y is fill. displacement : (n, 3) mm. z :
    (n,) mm, height in the reference state; None where unknown. sigma : (n,) as `Frame.sigma`.
    dropped : counts of rows left out, by reason.
    """

    pressure: float
    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    dropped: Mapping[str, int] = field(default_factory=dict)
    z: NDArray[np.float64] | None = None
    sigma: NDArray[np.float64] | None = None
    path: Path | None = None
    source: FrameSource = field(default_factory=FrameSource)

    @property
    def frame(self) -> Frame:
        """Return the field as a frame; z is 0 where the height was not measured."""
        z = np.zeros(len(self.points)) if self.z is None else self.z
        return Frame(np.column_stack([self.points, z]), self.displacement, self.path)


def read_fields(
    files: Sequence[Path | str],
    pressures: Sequence[float],
    columns: Mapping[str, str] | None = None,
    flag_column: str | None = None,
    comment: str = "#",
    length_scale: float = 1.0,
    format: str | None = None,
    options: FrameOptions | None = None,
    frames: Sequence[int] | None = None,
) -> tuple[DisplacementField, ...]:
    """Read one frame a pressure.

    A first frame in which nothing moves is left out where there is one frame too many in one file.
    pressures : MPa. columns, flag_column, comment, length_scale : see `frames.FrameOptions`;
    options stands in their place. frames : numbers from 0 of the frames taken; all unless given.
    """
    if len(files) > len(pressures) and frames is None:
        problem = f"expected one file a pressure, got {len(files)} for {len(pressures)} pressures"
        raise InputError(None, "files", problem)
    if options is None:
        options = FrameOptions(QUANTITIES, columns, flag_column, comment, length_scale)
    read = read_frames(files, options, format)
    if frames is not None:
        read = tuple(read[number] for number in frames)
    elif len(read) == len(pressures) + 1 and len(files) == 1:
        moved = read[0].displacement[np.isfinite(read[0].displacement)]
        read = read[1:] if moved.size and not moved.any() else read
    if len(read) != len(pressures):
        problem = f"expected one frame for each of {len(pressures)} pressures, found {len(read)}"
        raise InputError(None, "files", problem)
    return tuple(
        field_of(frame, float(pressure), options)
        for frame, pressure in zip(read, pressures, strict=True)
    )


def read_field(
    path: Path | str, pressure: float, options: FrameOptions = PLAIN, format: str | None = None
) -> DisplacementField:
    """Read the field of one file, at a pressure in MPa."""
    frames = read_frames([path], options, format)
    if len(frames) != 1:
        raise InputError(path, "", f"expected one frame, one a pressure; found {len(frames)}")
    return field_of(frames[0], pressure, options)


def field_of(frame: Frame, pressure: float, options: FrameOptions = PLAIN) -> DisplacementField:
    """Return the field of a frame, at a pressure in MPa, without points of lost correlation."""
    z = frame.points[:, 2]
    # A height that no row has was not measured; one that some rows lack was lost there.
    measured = bool(np.isfinite(z).any())
    values = np.concatenate([frame.points[:, : 2 + measured], frame.displacement], axis=1)
    whole = np.isfinite(values).all(axis=1)
    lost = int((~whole).sum())
    dropped = {**frame.dropped, **({LOST: frame.dropped.get(LOST, 0) + lost} if lost else {})}
    if not whole.any():
        why = (
            ", ".join(f"{count} {reason}" for reason, count in dropped.items()) or "there are none"
        )
        raise InputError(frame.path, "", f"no row is left to use: {why}")
    return DisplacementField(
        pressure,
        frame.points[whole, :2],
        frame.displacement[whole],
        dropped,
        z[whole] if measured else None,
        None if frame.sigma is None else frame.sigma[whole],
        frame.path,
        frame.source,
    )
