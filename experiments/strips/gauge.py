"""The virtual strain gauge: two points followed on a specimen by image correlation, with its loads.

Loads of the machine are paired with the frames of the gauge one by one, or by time.

References
----------
Section 3.2 of the thesis.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ...notes import Note, NoteKind, as_note, note_records
from ...readers.curves import LoadCurve, direction_named
from ...readers.frames import Frame
from ...readers.machine_tables import read_machine_loads, read_times
from ...solvers.base import Array
from ...storage.writing import replacing

log = logging.getLogger(__name__)

#: The kind of note on a gauge whose end was lost.
CORRELATION_LOST = NoteKind("correlation lost")


@dataclass(frozen=True, eq=False)
class Surface:
    """The correlated points of a frame, triangulated by their reference x and y.

    Attributes
    ----------
    mesh : Delaunay
    positions : (points, 2, 3) array, mm
        Reference position and position in the frame of each point.
    """

    mesh: scipy.spatial.Delaunay
    positions: Array

    def longest_edge(self, triangles: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Return the longest edge (m,), mm in reference x and y, of these triangles."""
        corners = self.positions[self.mesh.simplices[triangles], 0, :2]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return edges.max(axis=1)


def triangulated(frame: Frame, previous: Surface | None = None) -> Surface | None:
    """Triangulate the correlated points of a frame.

    Parameters
    ----------
    frame : Frame
        Points and displacements, NaN where the correlation failed.
    previous : Surface or None
        Surface of an earlier frame, whose triangles are used again if the reference points are the
        same, because triangulating takes most of the time.

    Returns
    -------
    Surface or None
        None where fewer than three points were correlated, or only points on one line.
    """
    positions = np.stack([frame.points, frame.points + frame.displacement], axis=1)
    positions = positions[np.isfinite(positions).all(axis=(1, 2))]
    if len(positions) < 3:
        return None
    reference = positions[:, 0, :2]
    if previous is not None and np.array_equal(reference, previous.positions[:, 0, :2]):
        return Surface(previous.mesh, positions)
    try:
        return Surface(scipy.spatial.Delaunay(reference), positions)
    except scipy.spatial.QhullError:  # all on one line
        return None


def position_on(surface: Surface | None, end: Array, max_edge: float) -> Array | str:
    """Interpolate the position of a point in the triangle around it.

    Parameters
    ----------
    surface : Surface or None
        Triangulated points of a frame.
    end : (2,) array, mm
        x and y of the point in the reference state.
    max_edge : float, mm
        A triangle with a longer edge spans a hole.

    Returns
    -------
    (2, 3) array, mm, or str
        Reference position and position in the frame; or the reason why there is none.
    """
    if surface is None:
        return "no three correlated points that span a surface"
    simplices = surface.mesh.simplices
    # Delaunay.find_simplex first inverts a matrix for every triangle, which takes longer than
    # triangulating. `areas` are twice the areas of the triangles that the point makes with the
    # side opposite to each corner: over their sum they are its barycentric coordinates.
    x, y = np.moveaxis(surface.positions[simplices, 0, :2] - end, -1, 0)
    x_next = np.roll(x, -1, axis=1)
    y_next = np.roll(y, -1, axis=1)
    x_last = np.roll(x, -2, axis=1)
    y_last = np.roll(y, -2, axis=1)
    areas = x_next * y_last - x_last * y_next
    area = areas.sum(axis=1, keepdims=True)
    weights = np.divide(areas, area, out=np.full_like(areas, -1.0), where=area != 0)
    triangle = int(np.argmax(weights.min(axis=1)))
    if weights[triangle].min() < -1e-9:
        return "outside the correlated points"
    longest = float(surface.longest_edge(np.array([triangle]))[0])
    if longest > max_edge:
        return f"the points around it are {longest:.3g} mm apart, allowed {max_edge:.3g}"
    corners = surface.positions[simplices[triangle]]
    return np.einsum("i,ijk->jk", weights[triangle], corners)


@dataclass(frozen=True, eq=False)
class GaugeRecord:
    """Length and strain of a virtual strain gauge in n frames; NaN where it was lost.

    Attributes
    ----------
    reference_length : float, mm
        Distance of the two ends in space in the reference state.
    length, elongation : (n,) array, mm
        Distance of the ends in each frame, and that less the reference length.
    strain : (n,) array
        Engineering strain, elongation over reference length.
    log_strain : (n,) array
        Logarithmic strain, ln(length / reference length).
    lost_frames : tuple of int
        Indices of the frames in which an end has no correlated surface around it.
    warnings : tuple of Note
        A note for each end that was lost in some frames.
    """

    reference_length: float
    length: Array
    elongation: Array
    strain: Array
    log_strain: Array
    lost_frames: tuple[int, ...]
    warnings: tuple[Note, ...]


def virtual_strain_gauge(
    frames: Sequence[Frame],
    lower: ArrayLike,
    upper: ArrayLike,
    max_gap: float = 1.35,
) -> GaugeRecord:
    """Follow the two ends of a gauge, interpolating linearly in the triangle around each.

    An end is lost in a frame where it lies outside the triangulated points, or in a triangle with
    an edge longer than `max_gap` times the usual longest edge: a value would be interpolated over a
    hole.

    Parameters
    ----------
    frames : sequence of Frame
        Correlated points of each frame, in order of time.
    lower, upper : (2,) array, mm
        x and y of the two ends in the reference state.
    max_gap : float
        Longest edge of a triangle, as a multiple of the usual longest edge. The default detects
        one missing point of a square grid (1.41 there); points scattered at random need about 2.5.

    Raises
    ------
    InputError
        The ends are not finite, closer than the points, or never both found in one frame.
    """
    if not np.isfinite(max_gap):
        raise InputError(None, "max_gap", f"expected a finite number, got {max_gap:g}")
    ends = {"lower": np.asarray(lower, dtype=float), "upper": np.asarray(upper, dtype=float)}
    _check_ends(ends)
    surfaces = _triangulated_frames(frames)
    usual_edge = _usual_edge(surfaces)
    distance = float(np.linalg.norm(ends["upper"] - ends["lower"]))
    if distance < usual_edge:
        problem = (
            f"the ends are {distance:.4g} mm apart, the points {usual_edge:.4g} mm: a gauge must"
            " span several points; is the length unit right?"
        )
        raise InputError(frames[0].path, "gauge", problem)
    max_edge = max_gap * usual_edge
    positions = {
        name: [position_on(surface, end, max_edge) for surface in surfaces]
        for name, end in ends.items()
    }
    warnings = []
    for name, end in ends.items():
        warnings += _lost_notes(name, end, positions[name], frames)
    return _record(positions["lower"], positions["upper"], tuple(warnings))


def _check_ends(ends: dict[str, Array]) -> None:
    """Refuse ends (2,) mm that are not finite, or the same point."""
    for name, end in ends.items():
        if not np.isfinite(end).all():
            raise InputError(None, name, f"expected x and y in mm, got {end.tolist()}")
    if np.array_equal(ends["lower"], ends["upper"]):
        raise InputError(None, "gauge", "lower and upper are the same point; expected two")


def _triangulated_frames(frames: Sequence[Frame]) -> list[Surface | None]:
    """Return the surface of each frame; frames of the same points share their triangles."""
    surfaces: list[Surface | None] = []
    previous: Surface | None = None
    for frame in frames:
        surface = triangulated(frame, previous)
        surfaces.append(surface)
        previous = surface or previous
    return surfaces


def _usual_edge(surfaces: Sequence[Surface | None]) -> float:
    """Return the median longest edge (mm) of the triangles; 0 if there are none."""
    medians = [float(np.median(s.longest_edge())) for s in surfaces if s is not None]
    return float(np.median(medians)) if medians else 0.0


def _lost_notes(
    name: str,
    end: Array,
    positions: Sequence[Array | str],
    frames: Sequence[Frame],
) -> list[Note]:
    """Return a note on the frames in which an end was lost; InputError if it was lost in all.

    Parameters
    ----------
    end : (2,) array, mm
        x and y of the end in the reference state.
    positions : sequence of (2, 3) array or str
        Result of `position_on` in each frame.
    """
    reasons = {
        frame: position for frame, position in enumerate(positions) if isinstance(position, str)
    }
    if not reasons:
        return []
    location = f"{name} end of the gauge at ({end[0]:g}, {end[1]:g}) mm"
    reason = next(iter(reasons.values()))
    if len(reasons) == len(frames):
        problem = f"lost in every frame ({reason}); move it onto the correlated surface"
        raise InputError(frames[0].path, location, problem)
    numbers = ", ".join(map(str, reasons))
    words = (
        f"{location}: correlation lost in {len(reasons)} of {len(frames)} frames ({numbers}): "
        f"{reason}; these give no length. Move the gauge to keep them"
    )
    return [Note(CORRELATION_LOST, words)]


def _record(
    lower: Sequence[Array | str], upper: Sequence[Array | str], warnings: tuple[Note, ...]
) -> GaugeRecord:
    """Return the record of a gauge from the positions of its ends in each frame.

    Parameters
    ----------
    lower, upper : sequence of (2, 3) array or str
        Result of `position_on` in each frame.
    """
    # Each line is (2, 3): from the lower to the upper end in the reference state, and in the frame.
    lines = [
        None if isinstance(a, str) or isinstance(b, str) else b - a
        for a, b in zip(lower, upper, strict=True)
    ]
    first = next((line for line in lines if line is not None), None)
    if first is None:
        problem = "no frame shows both ends; move the gauge onto the correlated surface"
        raise InputError(None, "gauge", problem)
    reference = float(np.linalg.norm(first[0]))
    length = np.array([np.nan if line is None else np.linalg.norm(line[1]) for line in lines])
    if not length[np.isfinite(length)].all():
        raise InputError(None, "gauge", "the two ends meet in a frame; are the columns right?")
    elongation = length - reference
    return GaugeRecord(
        reference_length=reference,
        length=length,
        elongation=elongation,
        strain=elongation / reference,
        log_strain=np.log(length / reference),
        lost_frames=tuple(i for i, line in enumerate(lines) if line is None),
        warnings=warnings,
    )


#: The kind of note on frames that the load curve leaves out.
NO_LOAD = NoteKind("frames without load")


def _columns(record: GaugeRecord) -> dict[str, Array]:
    """Return the values (frames,) of a record by the names of their columns in a table."""
    return {
        "length_mm": record.length,
        "elongation_mm": record.elongation,
        "strain": record.strain,
        "log_strain": record.log_strain,
    }


@dataclass(frozen=True, eq=False)
class GaugeTable:
    """A gauge through the frames of a test, with the machine's loads where there are any.

    Attributes
    ----------
    files : sequence of str
        Names of the frames' files.
    lower, upper : (float, float), mm
        x and y of the ends in the reference state.
    record : GaugeRecord
        Length and strain of the gauge in each frame.
    curve : LoadCurve or None
        Load over elongation, of the frames that have both.
    note : str or None
        Remark on the order of the frames.
    """

    files: Sequence[str]
    lower: tuple[float, float]
    upper: tuple[float, float]
    record: GaugeRecord
    curve: LoadCurve | None = None
    note: str | None = None

    @property
    def notes(self) -> list[Note]:
        """Return warnings: lost ends of the gauge, order of the frames, frames without load."""
        notes = list(self.record.warnings)
        if self.note:
            notes.append(as_note(self.note))
        without_load = self.without_load
        if without_load:
            count = f"{len(without_load)} of {len(self.files)} frames"
            words = f"{count} have a length and no load; they are left out: "
            notes.append(Note(NO_LOAD, words + ", ".join(without_load)))
        return notes

    @property
    def without_load(self) -> list[str]:
        """Return the files of frames with a length that the load curve leaves out."""
        if self.curve is None:
            return []
        frames = {*self._measured_frames().tolist()} - {*self._used_frames().tolist()}
        return [self.files[frame] for frame in sorted(frames)]

    def frame(self) -> pd.DataFrame:
        """Return a DataFrame, one row for each frame; with loads, for each frame of the curve."""
        curve = self.curve
        frames = np.arange(len(self.files)) if curve is None else self._used_frames()
        table = pd.DataFrame({"frame": frames, "file": [self.files[frame] for frame in frames]})
        for name, values in _columns(self.record).items():
            table[name] = values[frames]
        if curve is not None:
            table["load_N"] = curve.load
            table["specimen"] = curve.specimen
            table["direction"] = curve.direction
        return table

    def write(self, path: Path | str) -> None:
        """Write the table as CSV after its notes; with loads, a strip test can read it."""
        ends = [f"({x:g}, {y:g})" for x, y in (self.lower, self.upper)]
        title = (
            f"virtual strain gauge between {ends[0]} and {ends[1]} mm,"
            f" {self.record.reference_length:.6g} mm long in the reference state"
        )
        # Each note stays on one line, even if a file name has a line break.
        lines = [title, *(f"note: {' '.join(note.split())}" for note in self.notes)]
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.writelines(f"# {line}\n" for line in lines)
            self.frame().to_csv(stream, index=False, lineterminator="\n")

    def numbers(self) -> dict[str, Any]:
        """Return the results as plain data for JSON; frames are named by their files."""
        record = self.record
        curve = self.curve
        measured = self._measured_frames()
        longest = measured[np.argmax(record.length[measured])]
        columns = {name: float(values[longest]) for name, values in _columns(record).items()}
        numbers: dict[str, Any] = {
            "gauge_length_mm": record.reference_length,
            "longest": {"file": self.files[longest], **columns},
            "frames": len(self.files),
            "lost": [self.files[frame] for frame in record.lost_frames],
            "warnings": [note.line for note in self.notes],
            "notes": note_records(self.notes),
        }
        if curve is not None:
            numbers |= {
                "direction": curve.direction,
                "specimen": curve.specimen,
                "points": len(curve.load),
                "largest_load_N": float(curve.load.max()),
                "without_load": self.without_load,
            }
        return numbers

    def _measured_frames(self) -> NDArray[np.intp]:
        """Return the indices (k,) of the frames in which the gauge has a length."""
        return np.flatnonzero(np.isfinite(self.record.length))

    def _used_frames(self) -> NDArray[np.intp]:
        """Return the indices (k,) of the frames of the curve, else of all frames with a length."""
        if self.curve is None or self.curve.frame is None:
            return self._measured_frames()
        return self.curve.frame


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
