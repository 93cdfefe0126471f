"""Read displacement fields of a bubble, and fit polynomial surfaces to them (Eq. 4.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from .frames import WITHOUT_VALUE, Array, Frame, FrameOptions, FrameSource, read_frames

#: What a file must hold: reference place and displacement; the names in the file may differ. The
#: height z of the reference state is read where it is there.
QUANTITIES = ("x", "y", "dx", "dy", "dz")
PLAIN = FrameOptions(QUANTITIES)


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Displacements measured, or computed, at one pressure.

    Attributes
    ----------
    pressure : float, MPa
    points : (n, 2) array, mm
        Positions at rest; x is warp, y fill.
    displacement : (n, 3) array, mm
    dropped : mapping
        Number of points that were left out, by reason.
    z : (n,) array, mm, or None
        Height at rest, where it was measured.
    sigma : (n,) array or None
        Measure of the error of each point, see `Frame`.
    path : Path or None
        File of the field; None if it was given as arrays.
    source : FrameSource
        Format, columns and units that were read.
    """

    pressure: float
    points: Array
    displacement: Array
    dropped: Mapping[str, int] = field(default_factory=dict)
    z: Array | None = None
    sigma: Array | None = None
    path: Path | None = None
    source: FrameSource = field(default_factory=FrameSource)

    def subset(self, rows: NDArray[np.bool_]) -> DisplacementField:
        """Return the field with some of its points only, by a mask (n,)."""
        return replace(
            self,
            points=self.points[rows],
            displacement=self.displacement[rows],
            z=None if self.z is None else self.z[rows],
            sigma=None if self.sigma is None else self.sigma[rows],
        )

    @property
    def frame(self) -> Frame:
        """Return the field as a frame; z is 0 where the height was not measured."""
        z = np.zeros(len(self.points)) if self.z is None else self.z
        return Frame(np.column_stack([self.points, z]), self.displacement, self.path)


def read_fields(
    files: Sequence[Path | str],
    pressures: Sequence[float],
    options: FrameOptions = PLAIN,
    format: str | None = None,
    frames: Sequence[int] | None = None,
    count: int | None = None,
) -> tuple[DisplacementField, ...]:
    """Read one displacement field for each pressure.

    Parameters
    ----------
    files : sequence of paths
        Files with one frame each, or one file with all frames.
    pressures : sequence of float, MPa
        Pressure of each frame.
    options : FrameOptions
        Columns, units and axes of the files.
    format : str, optional
        Name of the format; recognised by the content if omitted.
    frames : sequence of int, optional
        Indices, from 0, of the frames that are used, counted through all files; all if omitted.
    count : int, optional
        Number of frames that `frames` count; one a pressure if omitted. A first frame at rest in a
        single file that has one frame more is not counted.

    Raises
    ------
    InputError
        There are not as many frames as pressures, or one has no point.
    """
    if len(files) > len(pressures) and frames is None:
        problem = f"expected one file a pressure, got {len(files)} for {len(pressures)} pressures"
        raise InputError(None, "files", problem)
    used_frames: Sequence[Frame] = read_frames(files, options, format)
    if len(files) == 1:
        used_frames = without_frame_at_rest(used_frames, count or len(pressures))
    if frames is not None:
        if count is not None:
            check_count(used_frames, count)
        used_frames = [used_frames[number] for number in frames]
    return fields_of_frames(used_frames, pressures)


def fields_of_frames(
    frames: Sequence[Frame], pressures: Sequence[float]
) -> tuple[DisplacementField, ...]:
    """Return the displacement field of each frame, without points of lost correlation.

    Parameters
    ----------
    frames : sequence of Frame
    pressures : sequence of float, MPa
        One a frame.

    Raises
    ------
    InputError
        There are not as many frames as pressures, or one has no point.
    """
    check_count(frames, len(pressures))
    return tuple(_field_of(f, float(p)) for f, p in zip(frames, pressures, strict=True))


def without_frame_at_rest(frames: Sequence[Frame], count: int) -> Sequence[Frame]:
    """Return the frames of a file without a first one at rest if it is one more than `count`."""
    return frames[1:] if len(frames) == count + 1 and _is_at_rest(frames[0]) else frames


def check_count(frames: Sequence[Frame], count: int) -> None:
    """Raise InputError unless there is a frame for each of as many pressures."""
    if len(frames) != count:
        problem = f"expected one frame for each of {count} pressures, found {len(frames)}"
        raise InputError(None, "files", problem)


def _is_at_rest(frame: Frame) -> bool:
    """Return whether all known displacements are zero."""
    values = frame.displacement[np.isfinite(frame.displacement)]
    return bool(values.size) and not values.any()


def _field_of(frame: Frame, pressure: float) -> DisplacementField:
    """Return the field of a frame, at a pressure in MPa, without points of lost correlation."""
    z = frame.points[:, 2]
    # A height that no row has was not measured; one that some rows lack was lost there.
    has_height = np.isfinite(z).any()
    values = np.concatenate([frame.points[:, : 2 + has_height], frame.displacement], axis=1)
    is_complete = np.isfinite(values).all(axis=1)
    dropped = dict(frame.dropped)
    lost_count = int((~is_complete).sum())
    if lost_count:
        dropped[WITHOUT_VALUE] = dropped.get(WITHOUT_VALUE, 0) + lost_count
    if lost_count == len(z):
        reasons = ", ".join(f"{count} {reason}" for reason, count in dropped.items())
        no_row = f"no row is left to use: {reasons or 'there are none'}"
        raise InputError(frame.path, "", f"{no_row}; leave this frame and its pressure out")
    return DisplacementField(
        pressure,
        frame.points[is_complete, :2],
        frame.displacement[is_complete],
        dropped,
        z[is_complete] if has_height else None,
        None if frame.sigma is None else frame.sigma[is_complete],
        frame.path,
        frame.source,
    )


def powers(points: Array, degree: int) -> Array:
    """Return the terms x^i y^j of Eq. 4.4 at points.

    Parameters
    ----------
    points : (n, 2) array
        Coordinates x and y.
    degree : int
        Highest power of x and of y.

    Returns
    -------
    (n, (degree + 1)^2) array
        Terms by falling power of y, and for each of these by falling power of x.
    """
    x = np.vander(points[:, 0], degree + 1)
    y = np.vander(points[:, 1], degree + 1)
    return (y[:, :, None] * x[:, None, :]).reshape(len(points), -1)


#: Largest degree: higher powers cannot be distinguished in double precision.
MAX_DEGREE = 12


@dataclass(frozen=True, eq=False)
class DisplacementSurface:
    """Polynomials in x and y for the three displacement components at one pressure.

    Attributes
    ----------
    pressure : float, MPa
    degree : int
        Highest power of x and of y.
    coefficients : (3, (degree + 1)^2) array, mm
        Coefficients of the powers of x / scale and y / scale, ordered as in Eq. 4.4.
    scale : float, mm
        Length by which coordinates are divided.
    r_squared : (3,) array
        R^2 of each component.
    """

    pressure: float
    degree: int
    coefficients: Array
    scale: float
    r_squared: Array

    def evaluate(self, points: Array) -> Array:
        """Return displacement (n, 3) mm at reference points (n, 2) mm."""
        return powers(np.asarray(points) / self.scale, self.degree) @ self.coefficients.T

    @property
    def physical(self) -> Array:
        """Return coefficients (3, (degree + 1)^2) of Eq. 4.4 with x and y in mm."""
        falling = np.arange(self.degree, -1, -1)
        return self.coefficients / self.scale ** (falling[:, None] + falling).ravel()


def fit_surface(field: DisplacementField, degree: int) -> DisplacementSurface:
    """Fit Eq. 4.4 to a displacement field by least squares.

    Parameters
    ----------
    field : DisplacementField
    degree : int
        From 0 to `MAX_DEGREE`.

    Raises
    ------
    InputError
        The points do not determine all coefficients.
    """
    if not 0 <= degree <= MAX_DEGREE:
        raise InputError(None, "degree", f"expected 0 to {MAX_DEGREE}, got {degree}")
    term_count = (degree + 1) ** 2
    count = len(field.points)
    subject = f"surface of degree {degree} at {field.pressure * 1e3:g} kPa"
    if count < term_count:
        problem = f"{term_count} coefficients need as many points, there are {count}"
        raise InputError(None, subject, f"{problem}; lower the degree")
    scale = np.abs(field.points).max() or 1.0
    terms = powers(field.points / scale, degree)
    # Terms are scaled to length one, so that small ones (x^8 y^8 is at most 1/256 on a disk) count.
    length = np.linalg.norm(terms, axis=0)
    length[length == 0] = 1.0
    solution, _, rank, _ = np.linalg.lstsq(terms / length, field.displacement, rcond=1e-13)
    if rank < term_count:
        problem = (
            f"the {count} points lie so that they settle only {rank} of {term_count} coefficients"
        )
        raise InputError(None, subject, f"{problem} (on too few lines?); lower the degree")
    coefficients = (solution / length[:, None]).T
    u = field.displacement
    squares = ((u - u.mean(axis=0)) ** 2).sum(axis=0)
    unexplained = ((u - terms @ coefficients.T) ** 2).sum(axis=0)
    # A constant direction (a clamped one, all zeros) has nothing to explain.
    is_constant = squares <= 1e-24 * (u**2).sum(axis=0)
    share = np.divide(unexplained, squares, out=np.zeros(3), where=~is_constant)
    return DisplacementSurface(field.pressure, degree, coefficients, scale, 1.0 - share)


def surface_table(surfaces: Sequence[DisplacementSurface]) -> pd.DataFrame:
    """Return a row for each surface and direction: R^2, degree, scale, and C0 ... of Eq. 4.4."""
    rows = []
    for surface in surfaces:
        for axis, direction in enumerate("xyz"):
            row = {
                "pressure_MPa": surface.pressure,
                "direction": direction,
                "R2": surface.r_squared[axis],
                "degree": surface.degree,
                "scale_mm": surface.scale,
            }
            coefficients = surface.physical[axis]
            rows.append(row | {f"C{i}": value for i, value in enumerate(coefficients)})
    return pd.DataFrame(rows)
