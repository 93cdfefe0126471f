"""The virtual strain gauge: two points followed on a specimen's surface (thesis section 3.2)."""

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
from ...storage.writing import replacing

#: Kinds of notes that are made here.
LOST, NO_LOAD = NoteKind("correlation lost"), NoteKind("frames without load")
Array = NDArray[np.float64]
log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Surface:
    """The correlated points of a frame, triangulated by their reference x and y.
    places : (points, 2, 3) mm, before and after."""

    mesh: scipy.spatial.Delaunay
    places: Array

    def longest_edge(self, triangles: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Return longest edge (triangles,) mm in the reference x and y."""
        corners = self.places[self.mesh.simplices[triangles], 0, :2]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(edges.max(axis=1))


def triangulated(frame: Frame, before: Surface | None = None) -> Surface | None:
    """Triangulate a frame; None where fewer than three points, or a line, were correlated.
    before : a surface; its triangles are taken where the reference points are the same:
    triangulating is what costs."""
    places = np.stack([frame.points, frame.points + frame.displacement], axis=1)
    places = places[np.isfinite(places).all(axis=(1, 2))]
    if len(places) < 3:
        return None
    if before is not None and np.array_equal(places[:, 0, :2], before.places[:, 0, :2]):
        return Surface(before.mesh, places)
    try:
        return Surface(scipy.spatial.Delaunay(places[:, 0, :2]), places)
    except scipy.spatial.QhullError:  # all on one line
        return None


def place_of(end: Array, surface: Surface | None, limit: float) -> Array | str:
    """Return place (2, 3) mm before and after of the point (2,), or the reason for none.
    limit : mm; a triangle with a longer edge spans a hole."""
    if surface is None:
        return "no three correlated points that span a surface"
    # Delaunay.find_simplex first inverts a matrix for every triangle, which costs more than
    # triangulating. Twice the areas that the point makes with the sides opposite to each corner:
    x, y = np.moveaxis(surface.places[surface.mesh.simplices, 0, :2] - end, -1, 0)
    areas = np.roll(x, -1, 1) * np.roll(y, -2, 1) - np.roll(x, -2, 1) * np.roll(y, -1, 1)
    whole = areas.sum(axis=1, keepdims=True)
    weights = np.divide(areas, whole, out=np.full_like(areas, -1.0), where=whole != 0)
    best = int(np.argmax(weights.min(axis=1)))
    if weights[best].min() < -1e-9:
        return "outside the correlated points"
    widest = float(surface.longest_edge(np.array([best]))[0])
    if widest > limit:
        return f"the points around it are {widest:.3g} mm apart, allowed {limit:.3g}"
    corners = surface.places[surface.mesh.simplices[best]]
    return np.asarray(np.einsum("i,ijk->jk", weights[best], corners))


@dataclass(frozen=True, eq=False)
class GaugeRecord:
    """A virtual strain gauge through n frames; NaN in the frames where it was lost.
    reference_length, length : mm, by x, y and z. strain : engineering, elongation / reference
    length; log_strain : ln(length / reference length). lost : frames without surface around an end.
    """

    reference_length: float
    length: Array
    elongation: Array
    strain: Array
    log_strain: Array
    lost: tuple[int, ...]
    warnings: tuple[Note, ...]


def virtual_strain_gauge(
    frames: Sequence[Frame], lower: ArrayLike, upper: ArrayLike, max_gap: float = 1.35
) -> GaugeRecord:
    """Follow the two ends of a gauge, interpolating linearly in the triangle around each.
    An end is lost in a frame where it lies outside the triangulated points, or in a triangle with
    an edge longer than `max_gap` times the usual longest edge: a value would be interpolated over a
    hole. lower, upper : (2,) mm, x and y in the reference state. max_gap : 1.35 finds one missing
    point of a square grid (1.41 there); points scattered at random need about 2.5."""
    if not np.isfinite(max_gap):
        raise InputError(None, "max_gap", f"expected a finite number, got {max_gap:g}")
    ends = [np.asarray(end, dtype=float) for end in (lower, upper)]
    for name, end in zip(("lower", "upper"), ends, strict=True):
        if not np.isfinite(end).all():
            raise InputError(None, name, f"expected x and y in mm, got {end.tolist()}")
    if np.array_equal(ends[0], ends[1]):
        raise InputError(None, "gauge", "lower and upper are the same point; expected two")
    seen: list[Surface | None] = []
    whole: Surface | None = None
    for frame in frames:
        seen.append(triangulated(frame, whole))
        whole = seen[-1] or whole
    spacing = [float(np.median(s.longest_edge())) for s in seen if s is not None]
    usual = float(np.median(spacing)) if spacing else 0.0
    apart = float(np.linalg.norm(ends[1] - ends[0]))
    if apart < usual:
        problem = (
            f"the ends are {apart:.4g} mm apart, the points {usual:.4g} mm: a gauge must span"
            " several points; is the length unit right?"
        )
        raise InputError(frames[0].path, "gauge", problem)
    limit = max_gap * usual
    places = [[place_of(end, surface, limit) for surface in seen] for end in ends]
    warnings = []
    for name, end, per_frame in zip(("lower", "upper"), ends, places, strict=True):
        if not (why := {i: place for i, place in enumerate(per_frame) if isinstance(place, str)}):
            continue
        at = f"{name} end of the gauge at ({end[0]:g}, {end[1]:g}) mm"
        first = next(iter(why.values()))
        if len(why) == len(frames):
            problem = f"lost in every frame ({first}); move it onto the correlated surface"
            raise InputError(frames[0].path, at, problem)
        which = ", ".join(map(str, why))
        words = (
            f"{at}: correlation lost in {len(why)} of {len(frames)} frames ({which}): {first};"
            " these give no length. Move the gauge to keep them"
        )
        warnings.append(Note(LOST, words))
    pairs = [
        None if isinstance(a, str) or isinstance(b, str) else b - a
        for a, b in zip(*places, strict=True)
    ]
    whole = next((pair for pair in pairs if pair is not None), None)
    if whole is None:
        problem = "no frame shows both ends; move the gauge onto the correlated surface"
        raise InputError(None, "gauge", problem)
    # Row 0: the line between the reference places; row 1: between the places in the frame.
    reference = float(np.linalg.norm(whole[0]))
    length = np.array([np.nan if pair is None else np.linalg.norm(pair[1]) for pair in pairs])
    if not length[np.isfinite(length)].all():
        raise InputError(None, "gauge", "the two ends meet in a frame; are the columns right?")
    lost = tuple(i for i, pair in enumerate(pairs) if pair is None)
    further = length - reference
    strains = further / reference, np.log(length / reference)
    return GaugeRecord(reference, length, further, *strains, lost, tuple(warnings))


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
    """Return the machine's load over the gauge's elongation; lost frames are left out.
    loads : N, one a frame, or (k,) at rising load_times, interpolated at frame_times (n,); frames
    before the first or after the last load are left out, which is logged."""
    load = np.asarray(loads, dtype=float)
    kept = np.isfinite(record.elongation)
    if frame_times is not None and load_times is not None:
        if len(load) < 2 or (np.diff(load_times) <= 0).any():
            problem = "expected two or more, each later than the one before"
            raise InputError(path, "load_times", problem)
        load = np.interp(frame_times, load_times, load)
        inside = (frame_times >= load_times[0]) & (frame_times <= load_times[-1])
        if len(early := np.flatnonzero(~inside)):
            problem = "%s: %d of %d frames have no load at their time: %s"
            log.warning(problem, specimen, len(early), len(kept), ", ".join(map(str, early)))
        kept &= inside
    if kept.sum() < 2:
        problem = f"only {kept.sum()} of {len(kept)} frames have both length and load; expected two"
        raise InputError(path, f"specimen {specimen!r}", problem)
    times = None if frame_times is None else frame_times[kept]
    way = direction_named(direction)
    frame = np.flatnonzero(kept)
    return LoadCurve(way, specimen, record.elongation[kept], load[kept], path, times, frame)


@dataclass(frozen=True)
class PairedLoads:
    """A machine's loads, and their pairing with the frames of a gauge.
    load_column, load_unit, decimal, format : of the export, where not found. frame_times : a table
    of the frames' times, or frame_interval : s between frames, the first at 0: pair the loads by
    time. time_offset : s, the machine's clock less the frames'."""

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
        if self.frame_times is not None and self.frame_interval is not None:
            raise InputError(None, "frame_times, frame_interval", "give one of them, not both")
        for name, needs in (
            ("time_column", None if self.timed else "frame_times or frame_interval"),
            ("time_offset", None if self.timed else "frame_times or frame_interval"),
            ("frame_time_column", "frame_times" if self.frame_times is None else None),
        ):
            if needs and getattr(self, name) is not None:
                raise InputError(None, name, f"means nothing without {needs}")
        for name in ("frame_interval", "time_offset"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise InputError(None, name, f"expected a finite number, got {value:g}")
        if not (self.specimen.strip() and self.specimen.isprintable()):
            problem = f"expected a name on one line, got {self.specimen!r}"
            raise InputError(None, "specimen", problem)

    @property
    def timed(self) -> bool:
        """Return whether loads and frames are paired by time."""
        return self.frame_times is not None or self.frame_interval is not None


def loads_at_frames(record: GaugeRecord, loads: PairedLoads) -> LoadCurve:
    """Return the load curve of a gauge."""
    count = len(record.length)
    times = None
    if loads.frame_interval is not None:
        times = loads.frame_interval * np.arange(count)
    if loads.frame_times is not None:
        with _naming("frame_time_column"):
            times = read_times(loads.frame_times, loads.frame_time_column, decimal=loads.decimal)
        if len(times) != count:
            problem = f"expected one time for each of the {count} frames, got {len(times)}"
            raise InputError(loads.frame_times, "", problem)
    columns = {"load": loads.load_column, "time": loads.time_column}
    named = {quantity: column for quantity, column in columns.items() if column is not None}
    own = {name: getattr(loads, name) for name in ("timed", "load_unit", "decimal", "format")}
    with _naming("load_column, time_column" if loads.timed else "load_column"):
        machine, clock = read_machine_loads(loads.path, columns=named, **own)
    if not loads.timed and len(machine) != count:
        problem = (
            f"expected one load for each of the {count} frames, got {len(machine)};"
            " frame_times or frame_interval pair by time"
        )
        raise InputError(loads.path, "", problem)
    return gauge_load_curve(
        record,
        machine,
        direction=loads.direction,
        specimen=loads.specimen.strip(),
        frame_times=None if times is None else times + (loads.time_offset or 0.0),
        load_times=clock,
        path=loads.path,
    )


@contextmanager
def _naming(fields: str) -> Iterator[None]:
    """Rename the readers' argument `columns` in errors to what it is called here."""
    try:
        yield
    except InputError as error:
        problem = error.problem.replace("with columns", f"with {fields}")
        raise InputError(error.path, error.field, problem) from None


#: Columns of a table by the attributes of a record.
COLUMNS = {
    "length": "length_mm",
    "elongation": "elongation_mm",
    "strain": "strain",
    "log_strain": "log_strain",
}


@dataclass(frozen=True, eq=False)
class GaugeTable:
    """A gauge through the frames of a test, with the machine's loads where there are any.
    lower, upper : (x, y) mm of the ends. curve : without lost frames and those without load. note :
    on the order of the frames."""

    files: Sequence[str]
    lower: tuple[float, float]
    upper: tuple[float, float]
    record: GaugeRecord
    curve: LoadCurve | None = None
    note: str | None = None

    @property
    def notes(self) -> list[Note]:
        """Return warnings: lost ends of the gauge, order of the frames, frames without load."""
        notes = [*self.record.warnings, *([as_note(self.note)] if self.note else [])]
        if without := self.without_load:
            words = f"{len(without)} of {len(self.files)} frames have a length and no load; they "
            notes.append(Note(NO_LOAD, f"{words}are left out: {', '.join(without)}"))
        return notes

    @property
    def without_load(self) -> list[str]:
        """Return the files of frames with a length that the load curve leaves out."""
        if self.curve is None:
            return []
        seen = np.flatnonzero(np.isfinite(self.record.length))
        return [self.files[i] for i in sorted({*seen.tolist()} - {*self._used().tolist()})]

    def frame(self) -> pd.DataFrame:
        """Return a DataFrame, a row a frame; with loads only the frames of the curve."""
        record = self.record
        curve = self.curve
        rows = np.arange(len(self.files)) if curve is None else self._used()
        table = pd.DataFrame({"frame": rows, "file": [self.files[i] for i in rows]})
        for name, column in COLUMNS.items():
            table[column] = getattr(record, name)[rows]
        if curve is not None:
            table["load_N"] = curve.load
            table["specimen"] = curve.specimen
            table["direction"] = curve.direction
        return table

    def write(self, path: Path | str) -> None:
        """Write the table with its notes; with loads, strips of a project read it as a curve."""
        ends = [f"({x:g}, {y:g})" for x, y in (self.lower, self.upper)]
        about = (
            f"virtual strain gauge between {ends[0]} and {ends[1]} mm,"
            f" {self.record.reference_length:.6g} mm long in the reference state"
        )
        # A line each, whatever the names of the files hold.
        lines = [about, *(f"note: {' '.join(note.split())}" for note in self.notes)]
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8") as stream:
            stream.writelines(f"# {line}\n" for line in lines)
            self.frame().to_csv(stream, index=False, lineterminator="\n")

    def numbers(self) -> dict[str, Any]:
        """Return the results as plain data; frames by the names of their files."""
        record = self.record
        curve = self.curve
        seen = np.flatnonzero(np.isfinite(record.length))
        last = seen[np.argmax(record.length[seen])]
        numbers: dict[str, Any] = {
            "gauge_length_mm": record.reference_length,
            "longest": {"file": self.files[last]}
            | {column: float(getattr(record, name)[last]) for name, column in COLUMNS.items()},
            "frames": len(self.files),
            "lost": [self.files[i] for i in record.lost],
            "warnings": [note.line for note in self.notes],
            "notes": note_records(self.notes),
        }
        if curve is not None:
            numbers |= {"direction": curve.direction, "specimen": curve.specimen}
            numbers |= {"points": len(curve.load), "largest_load_N": float(curve.load.max())}
            numbers["without_load"] = self.without_load
        return numbers

    def _used(self) -> NDArray[np.intp]:
        """Return the frames (points,) of the curve."""
        if self.curve is None or self.curve.frame is None:
            return np.flatnonzero(np.isfinite(self.record.length))
        return self.curve.frame
