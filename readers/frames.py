"""Read frames of digital image correlation (DIC): positions at rest and displacements in mm."""

import glob
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, check_one_of
from ..notes import Note, NoteKind
from .quantities import LENGTHS, PIXELS, is_of_no_length
from .registry import read_file

ORDER = NoteKind("order of frames")

Array = NDArray[np.float64]
#: Reference position and displacement, in the order of a frame's columns.
QUANTITIES = ("x", "y", "z", "dx", "dy", "dz")
PLACES = QUANTITIES[:3]
# Reasons why rows of a file are not used, as in the table of provenance.
FLAGGED = "flagged as doubtful"
NEGATIVE_SIGMA = "sigma below zero"
ALL_ZERO = "all zero"
WITHOUT_VALUE = "without a value"
BELOW_POINTS = "of words below the points"


@dataclass(frozen=True)
class FrameSource:
    """A record of what was read from a file.

    Attributes
    ----------
    format : str
        Name of the format.
    columns, units : mapping
        Column and unit by quantity, as the file has them.
    notes : tuple of str
        Choices made while reading.
    is_turned_over : bool
        Whether y and z, which the file has pointing down and away from the camera, are reversed.
    """

    format: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    is_turned_over: bool = False


@dataclass(frozen=True, eq=False)
class Frame:
    """The measured points of a surface in one frame.

    Attributes
    ----------
    points : (m, 3) array, mm
        Positions at rest.
    displacement : (m, 3) array, mm
        Displacements, NaN where correlation was lost.
    path : Path or None
        File of the frame.
    dropped : mapping
        Number of rows that were left out, by reason.
    sigma : (m,) array or None
        Measure of the error of each point.
    source : FrameSource
        Format, columns and units that were read.
    ids : (m,) array or None
        Numbers of the points in the file.
    number : float or None
        Number of the frame in a file of several.
    rows : (m,) array of int or None
        Row of each point, from 0; None where it is not known.
    """

    points: Array
    displacement: Array
    path: Path | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    sigma: Array | None = None
    source: FrameSource = field(default_factory=FrameSource)
    ids: Array | None = None
    number: float | None = None
    rows: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        if self.points.shape != self.displacement.shape or self.points.shape[1:] != (3,):
            shapes = f"{self.points.shape} and {self.displacement.shape}"
            raise ValueError(f"expected (m, 3) points and displacements, got {shapes}")


@dataclass(frozen=True)
class FrameOptions:
    """Options of a reader of frames.

    Attributes
    ----------
    quantities : tuple of str
        Quantities that are needed, of `QUANTITIES`.
    columns : mapping, optional
        Column names in the file by quantity; other columns are found by their headings.
    flag_column : str, optional
        Column of flags; rows where it is not zero are left out.
    comment : str
        What comments begin with.
    length_scale : float
        mm per unit of length where the file names none.
    valid_column : str, optional
        Column of flags; rows where it is zero are left out.
    decimal : {".", ","}, optional
        Decimal mark; detected if omitted.
    coordinates : {"reference", "deformed"}, optional
        State in which the file has positions; None where the format tells.
    camera_axes : bool, optional
        Whether y points down and z away from the camera; None where the format tells.
    planar : bool
        Whether z and dz may be missing.
    reference : Path, optional
        File of the positions at rest, for files that hold positions only.
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
    reference: Path | None = None

    def __post_init__(self) -> None:
        if not 0 < self.length_scale < math.inf:
            problem = f"expected mm per unit, above 0, got {self.length_scale}"
            raise InputError(None, "length_scale", problem)
        for name in self.columns or ():
            check_one_of(name, QUANTITIES, "columns")


def read_frames(
    files: Sequence[Path | str], options: FrameOptions = FrameOptions(), format: str | None = None
) -> tuple[Frame, ...]:
    """Read the frames of measured displacements from files.

    Parameters
    ----------
    files : sequence of paths
        Files of one or, in some formats, several frames.
    options : FrameOptions
        Columns, units and axes of the files.
    format : str, optional
        Name of the format; recognised by the content if omitted.

    Returns
    -------
    tuple of Frame
        In the order of the files.

    Raises
    ------
    InputError
        A file cannot be read, or holds no frame.
    """
    if not files:
        raise InputError(None, "files", "expected one file a frame, got none")
    if options.reference is not None:
        return _displaced_from(files, options.reference, options, format)
    frames: list[Frame] = []
    for path in map(Path, files):
        frames_of_file: Sequence[Frame] = read_file("frame", path, format, options)
        for frame in frames_of_file:
            if np.isinf(frame.points).any() or np.isinf(frame.displacement).any():
                raise InputError(path, "", "lengths too large to be mm; is the length unit right?")
        frames += frames_of_file
    return tuple(frames)


def _displaced_from(
    files: Sequence[Path | str],
    reference: Path,
    options: FrameOptions,
    format: str | None,
) -> tuple[Frame, ...]:
    """Return the frames of files of positions, with displacements from those in `reference`."""
    columns = {key: name for key, name in (options.columns or {}).items() if key in PLACES}
    options = replace(
        options,
        quantities=PLACES,
        columns=columns,
        reference=None,
        coordinates=None,
    )
    frames_at_rest = read_frames([reference], options, format)
    if len(frames_at_rest) != 1:
        problem = f"expected the one frame of the undeformed sheet, found {len(frames_at_rest)}"
        raise InputError(reference, "", problem)
    frames = read_frames(files, options, format)
    return tuple(_displaced(frame, frames_at_rest[0]) for frame in frames)


def _displaced(frame: Frame, reference: Frame) -> Frame:
    """Return a frame of positions with its displacements from a reference frame.

    Points are paired by their numbers, or by their rows in the files where either frame has none.
    """
    if np.isfinite(frame.displacement).any():
        problem = "holds displacements, and a reference is for files of places alone; leave it out"
        raise InputError(frame.path, "", problem)
    counts = [len(f.points) + sum(f.dropped.values()) for f in (frame, reference)]
    numbers: Array | NDArray[np.intp] | None = frame.ids
    reference_numbers: Array | NDArray[np.intp] | None = reference.ids
    if numbers is None or reference_numbers is None:
        numbers, reference_numbers = frame.rows, reference.rows
        if counts[0] != counts[1]:
            numbers = None
    rows = reference_rows = np.zeros(0, dtype=np.intp)
    if numbers is not None and reference_numbers is not None:
        _, rows, reference_rows = np.intersect1d(numbers, reference_numbers, return_indices=True)
    if not len(rows):
        problem = (
            f"holds {counts[0]} points, the reference {counts[1]}, and no column of point"
            " numbers (id) in both says which are the same; export one, or all points of every"
            " frame"
        )
        raise InputError(frame.path, "", problem)
    points = reference.points[reference_rows]
    return replace(
        frame,
        points=points,
        displacement=frame.points[rows] - points,
        sigma=None if frame.sigma is None else frame.sigma[rows],
        ids=None,
        rows=None,
    )


def frame_file_name(number: int) -> str:
    """Return the name of the file to which the arrays of a frame (index from 0) are written."""
    return f"frame-{number + 1:03d}.csv"


def frames_in_memory(frames: Sequence[Frame], options: FrameOptions) -> tuple[Frame, ...]:
    """Return frames that were given as arrays in the form of frames read from files.

    Rows that are all zero are left out, axes are turned over and positions taken from the deformed
    to the undeformed state, as the options say; lengths are in mm whatever they say.

    Parameters
    ----------
    frames : sequence of Frame
    options : FrameOptions
    """
    units = dict.fromkeys(QUANTITIES, "mm")
    names = {quantity: f"{quantity} [mm]" for quantity in QUANTITIES}
    read = []
    for frame in frames:
        table = np.hstack([frame.points, frame.displacement])
        values = dict(zip(QUANTITIES, table.T, strict=True))
        rows = FrameRows(values, names, units, number=frame.number)
        read.append(frame_of(rows, options, None, "arrays"))
    return tuple(read)


@dataclass(frozen=True, eq=False)
class FrameRows:
    """The rows of one frame as its file has them.

    Attributes
    ----------
    values : mapping
        Values (rows,) by quantity, also "x deformed" and so on; NaN where correlation was lost.
    names, units : mapping
        Column name and unit by quantity.
    valid : (rows,) array of bool or None
        Whether a row is good.
    sigma : (rows,) array or None
        Measure of error, below zero where correlation was lost.
    camera_axes : bool
        Whether y points down and z away from the camera.
    row_numbers : (rows,) array of int or None
        Row of each in its file, from 0, where the reader left rows out.
    dropped, notes, ids, number
        Fields of the same names of `Frame` and of its source.
    """

    values: Mapping[str, Array]
    names: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    valid: NDArray[np.bool_] | None = None
    sigma: Array | None = None
    camera_axes: bool = False
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ids: Array | None = None
    number: float | None = None
    row_numbers: NDArray[np.intp] | None = None


def frame_of(
    rows: FrameRows,
    options: FrameOptions,
    path: Path | None,
    format: str,
) -> Frame:
    """Return the frame of some rows in mm, without rows that are flagged, lost or all zero.

    Parameters
    ----------
    rows : FrameRows
    options : FrameOptions
    path : Path or None
        File of the frame, if it has one.
    format : str
        Name of the format, for the record of what was read.

    Raises
    ------
    InputError
        A quantity that is needed is missing or in pixels.
    """
    values = {name: _in_mm(rows, name, options, path) for name in rows.values}
    good, dropped = _good_rows(rows, values)
    values = {name: value[good] for name, value in values.items()}
    values, notes = _completed(values, options, rows.notes)
    missing = [name for name in options.quantities if name not in values]
    if missing:
        raise InputError(path, "", _describe_missing(missing, rows))
    unknown = np.full(good.sum(), np.nan)
    table = np.column_stack([values.get(quantity, unknown) for quantity in QUANTITIES])
    is_turned_over = rows.camera_axes if options.camera_axes is None else options.camera_axes
    if is_turned_over:
        table[:, [1, 2, 4, 5]] *= -1.0
        note = "y and z are turned over: in the file y points down, z away from the camera"
        notes = (*notes, note)
    units = {name: unit for name, unit in rows.units.items() if unit}
    return Frame(
        points=table[:, :3],
        displacement=table[:, 3:],
        path=path,
        dropped=dropped,
        sigma=None if rows.sigma is None else rows.sigma[good],
        source=FrameSource(format, dict(rows.names), units, notes, is_turned_over),
        ids=None if rows.ids is None else rows.ids[good],
        number=rows.number,
        rows=_row_numbers(rows, good),
    )


def _row_numbers(rows: FrameRows, good: NDArray[np.bool_]) -> NDArray[np.intp] | None:
    """Return the rows in the file of good rows; None where the reader left some out unnumbered."""
    if rows.row_numbers is not None:
        return rows.row_numbers[good]
    return None if any(rows.dropped.values()) else np.flatnonzero(good)


def _describe_missing(missing: Sequence[str], rows: FrameRows) -> str:
    """Return what columns a frame lacks, and what to do."""
    listed = " and ".join(missing)
    if set(missing) <= {"z", "dz"}:
        return f"planar correlation, without {listed}; a stereo one is needed"
    names = ", ".join(rows.names.values())[:300]
    return f"no column of {listed}; name them with columns. Read: {names}"


def _in_mm(
    rows: FrameRows,
    name: str,
    options: FrameOptions,
    path: Path | None,
) -> Array:
    """Return a column (n,) in mm, by its unit or the options' scale; InputError for no length."""
    unit = rows.units.get(name, "").strip().casefold()
    column = f"column {rows.names[name]!r}"
    if unit in PIXELS:
        problem = f"is in pixels; export lengths, or name a column of {name} in mm with columns"
        raise InputError(path, column, problem)
    if is_of_no_length(unit):
        problem = f"expected a unit of mm, cm, m, µm, in, mil and ft, got {rows.units[name]!r}"
        advice = "convert the lengths, or take what is no unit off the heading"
        raise InputError(path, column, f"{problem}; {advice}")
    scale = LENGTHS.get(unit, options.length_scale)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(rows.values[name] * scale)


def _good_rows(
    rows: FrameRows, values: Mapping[str, Array]
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return the mask of rows that are valid points, and how many others there are by reason."""
    bad_rows = {ALL_ZERO: _zero_rows(values)}
    if rows.sigma is not None:
        bad_rows = {NEGATIVE_SIGMA: rows.sigma < 0, **bad_rows}
    if rows.valid is not None:
        bad_rows = {FLAGGED: ~rows.valid, **bad_rows}
    good = np.ones(len(bad_rows[ALL_ZERO]), dtype=bool)
    dropped = {reason: count for reason, count in rows.dropped.items() if count}
    for reason, is_bad in bad_rows.items():
        count = int((is_bad & good).sum())
        if count:
            dropped[reason] = dropped.get(reason, 0) + count
            good &= ~is_bad
    return good, dropped


def _zero_rows(values: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Return the mask of rows that are all zero, except the origin of a sheet at rest."""
    is_zero = np.all([value == 0 for value in values.values()], axis=0)
    displacements = [value for name, value in values.items() if name[0] == "d"]
    if is_zero.sum() == 1 and not any(np.nan_to_num(d).any() for d in displacements):
        is_zero[:] = False
    return np.asarray(is_zero)


def _completed(
    values: dict[str, Array], options: FrameOptions, notes: tuple[str, ...]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return reference positions and displacements, each computed from the other where missing."""
    values = dict(values)
    if options.coordinates == "deformed":
        for axis in {*"xyz"} & {*values}:
            values[f"{axis} deformed"] = values.pop(axis)
    computed_positions = []
    computed_displacements = []
    for axis in "xyz":
        if f"{axis} deformed" not in values or (axis in values) == (f"d{axis}" in values):
            continue
        deformed = values[f"{axis} deformed"]
        if axis in values:
            values[f"d{axis}"] = deformed - values[axis]
            computed_displacements.append(axis)
        else:
            values[axis] = deformed - values[f"d{axis}"]
            computed_positions.append(axis)
    if computed_positions:
        state = "are places in the deformed state; the displacement is taken off"
        notes = (*notes, f"{', '.join(computed_positions)} {state}")
    if computed_displacements:
        axes = ", ".join(computed_displacements)
        notes = (*notes, f"displacements along {axes} are deformed less reference places")
    if options.planar and not {"z", "dz", "z deformed"} & {*values}:
        values["z"] = values["dz"] = np.zeros_like(values["x"])
        notes = (*notes, "planar correlation: z and dz are taken to be zero")
    return values, notes


def frame_files(
    patterns: Sequence[str], field: str = "files", folder: Path | None = None
) -> tuple[list[Path], Note | None]:
    """Return the files of frames in the order of the numbers in their names.

    Parameters
    ----------
    patterns : sequence of str
        Files, and patterns such as ``t_*.csv``; only matches of a pattern are sorted.
    field : str
        Key or argument that errors name.
    folder : Path, optional
        Folder of the files.

    Returns
    -------
    files : list of Path
    note : Note or None
        A note if the files are in the order of a shell, with frame_10 before frame_2.

    Raises
    ------
    InputError
        A pattern fits no file, a file is there twice, or is a folder.
    """
    names = [pattern if folder is None else str(folder / pattern) for pattern in patterns]
    files: list[Path] = []
    for pattern, name in zip(patterns, names, strict=True):
        files += _matching_files(pattern, name, field, folder)
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError(file, field, "is given twice")
    by_number = sorted(files, key=_number_key)
    is_expanded = files == list(map(Path, names))
    if not is_expanded or files == by_number or files != sorted(files, key=str):
        return files, None
    first, expected = next((a, b) for a, b in zip(files, by_number, strict=True) if a != b)
    order = f"frames in the order given: {first.name} before {expected.name}"
    return files, Note(ORDER, f"{order}; quote the pattern to have them by number")


def _matching_files(
    pattern: str,
    name: str,
    field: str,
    folder: Path | None,
) -> list[Path]:
    """Return the file of this name, or those that match it as a pattern."""
    if os.path.isdir(name):
        problem = f"expected files; quote a pattern such as {str(Path(name) / '*.csv')!r}"
        raise InputError(name, field, f"is a folder, {problem}")
    if os.path.exists(name) or not glob.has_magic(name):
        return [Path(name)]
    # The folder's name is no pattern.
    wildcard = pattern if folder is None else str(Path(glob.escape(str(folder))) / pattern)
    matches = [Path(match) for match in glob.glob(wildcard, recursive=True)]
    files = [match for match in matches if not match.is_dir()]
    if not files:
        raise InputError(None, field, f"no file matches {name!r}")
    return sorted(files, key=_number_key)


def _number_key(file: Path) -> list[tuple[bool, int, str]]:
    """Return a sort key: digits as numbers, numbers before letters."""
    parts = re.findall(r"\d+|\D+", str(file))
    return [(not part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts]
