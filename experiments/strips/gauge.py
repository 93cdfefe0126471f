"""The virtual strain gauge: two points followed on a specimen by image correlation, and its table.

References
----------
Section 3.2 of the thesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ...notes import Note, NoteKind, as_note, note_records
from ...readers.curves import LoadCurve
from ...readers.frames import Frame
from ...solvers.base import Array
from ...storage.writing import replacing

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
    areas = np.roll(x, -1, 1) * np.roll(y, -2, 1) - np.roll(x, -2, 1) * np.roll(y, -1, 1)
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
