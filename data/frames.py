"""Frames of image correlation (DIC): places in the reference picture, and how they moved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .registry import read_file

#: Reference place and displacement, in the order of a frame's columns.
QUANTITIES = ("x", "y", "z", "dx", "dy", "dz")

#: Why rows of a file are not used: what a table of provenance calls it.
FLAGGED = "flagged as doubtful"
NEGATIVE_SIGMA = "sigma below zero"
ALL_ZERO = "all zero"
LOST = "without a value"


@dataclass(frozen=True)
class FrameSource:
    """What was taken from a file, for the record.

    Parameters
    ----------
    format : name of the file's format, "" where its reader does not say.
    columns : for each quantity that was read, what the file calls it.
    units : for each of them the unit that the file names; a quantity is missing where the file
        names none.
    notes : one sentence each: what was chosen where the file leaves a choice.
    """

    format: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Frame:
    """A surface in one frame.

    Parameters
    ----------
    points : (m, 3) mm, reference places; NaN where correlation was lost, z also where it was not
        asked for.
    displacement : (m, 3) mm; NaN where correlation was lost.
    path : the file, None when the frame did not come from one.
    dropped : how many rows of the file are not among the points, by why.
    sigma : (m,) what the correlation says of its own error, in the file's own measure; None where
        it says nothing.
    source : what of the file was read.
    """

    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    path: Path | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    sigma: NDArray[np.float64] | None = None
    source: FrameSource = field(default_factory=FrameSource)

    def __post_init__(self) -> None:
        if self.points.shape != self.displacement.shape or self.points.shape[1:] != (3,):
            shapes = f"{self.points.shape} and {self.displacement.shape}"
            raise ValueError(f"expected (m, 3) points and displacements, got {shapes}")
        if self.sigma is not None and self.sigma.shape != self.points.shape[:1]:
            raise ValueError(f"expected (m,) sigma, got {self.sigma.shape}")


@dataclass(frozen=True)
class FrameOptions:
    """What a reader of frames is told beside the file.

    Parameters
    ----------
    quantities : of `QUANTITIES`, those that the file must hold; others are read where they are
        there.
    columns : the file's own name of some quantities; the others are found by their headings.
    flag_column : rows where this column is not zero are doubtful and left out, whatever they hold.
    valid_column : the same for a column that is zero in doubtful rows.
    comment : lines that start so are skipped, where the format has no comments of its own.
    length_scale : mm in one unit of length of columns that do not name theirs.
    decimal : the decimal mark, "." or ","; None finds it.
    coordinates : whether the places in the file are those before or after the motion; None where
        the format tells.
    camera_axes : whether y points down in the file and z away from the camera, so that both are
        turned over; None where the format tells.
    planar : whether z and dz may be missing, and are then zero.

    Raises
    ------
    InputError : a name for what is no quantity, a scale that is not above zero.
    """

    quantities: tuple[str, ...] = QUANTITIES
    columns: Mapping[str, str] | None = None
    flag_column: str | None = None
    comment: str = "#"
    length_scale: float = 1.0
    valid_column: str | None = None
    decimal: Literal[".", ","] | None = None
    coordinates: Literal["reference", "deformed"] | None = None
    camera_axes: bool | None = None
    planar: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.length_scale < math.inf:
            problem = f"expected mm per unit, above 0, got {self.length_scale}"
            raise InputError(None, "length_scale", problem)
        unknown = [name for name in self.columns or {} if name not in QUANTITIES]
        if unknown:
            problem = f"unknown quantity {unknown[0]!r}; expected {', '.join(QUANTITIES)}"
            raise InputError(None, "columns", problem)


def read_frames(
    files: Sequence[Path | str],
    options: FrameOptions = FrameOptions(),
    format: str | None = None,
) -> tuple[Frame, ...]:
    """Read frames in the order of the files; most formats have one a file.

    Exports that write zeros for the displacement only where correlation was lost need a flag
    column: such a point cannot be told from one that did not move.

    Parameters
    ----------
    format : its name (`registry.format_names("frame")`); found by the files' content unless given.

    Raises
    ------
    InputError : naming file, line and column: no files, no such file, a format that cannot be
        told, missing columns, cells that are not numbers.
    """
    if not files:
        raise InputError(None, "files", "expected one file a frame, got none")
    return tuple(frame for file in files for frame in _frames(Path(file), options, format))


def _frames(path: Path, options: FrameOptions, format: str | None) -> Sequence[Frame]:
    frames: Sequence[Frame] = read_file("frame", path, format, options)
    for frame in frames:
        if np.isinf(frame.points).any() or np.isinf(frame.displacement).any():
            raise InputError(path, "", "lengths too large to be mm; is the length unit right?")
    return frames
