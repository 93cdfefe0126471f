"""The virtual strain gauge: two points followed on a specimen's surface (thesis section 3.2)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..notes import Note, NoteKind
from .curves import LoadCurve, direction_named
from .frames import Frame
from .surface_points import Surface, place_of, triangulated, usual_edge

Array = NDArray[np.float64]

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class GaugeRecord:
    """A virtual strain gauge through n frames; NaN in the frames where it was lost.

    Parameters
    ----------
    reference_length : mm, between the two reference places, by x, y and z.
    length : (n,) mm, by x, y and z.
    elongation : (n,) mm, length - reference length.
    strain : (n,) engineering, elongation / reference length.
    log_strain : (n,) ln(length / reference length).
    lost : indices of the frames where an end had no correlated surface around it.
    warnings : one line for each end of the gauge that was lost: in which frames, why, what to do.
    """

    reference_length: float
    length: Array
    elongation: Array
    strain: Array
    log_strain: Array
    lost: tuple[int, ...]
    warnings: tuple[Note, ...]


def virtual_strain_gauge(
    frames: Sequence[Frame],
    lower: ArrayLike,
    upper: ArrayLike,
    max_gap: float = 1.35,
) -> GaugeRecord:
    """Follow the two ends of a gauge, interpolating linearly in the triangle around each.

    An end is lost in a frame where it lies outside the triangulated points, or in a triangle with
    an edge longer than `max_gap` times the usual longest edge: there the points between are
    missing, and a value would be interpolated over a hole.

    Parameters
    ----------
    frames : in the order of the test; each with its own points, not necessarily the same.
    lower, upper : (2,) mm, x and y of the ends in the reference state.
    max_gap : 1.35 finds one missing point of a square grid (there the ratio is 1.41). Points
        scattered at random need about 2.5.

    Raises
    ------
    InputError : no frames, ends that are no points or coincide, an end lost in every frame,
        a gauge within one triangle of points, a gap that is no number.
    """
    if not np.isfinite(max_gap):
        raise InputError(None, "max_gap", f"expected a finite number, got {max_gap:g}")
    ends = [_end(lower, "lower"), _end(upper, "upper")]
    if not frames:
        raise InputError(None, "frames", "expected at least one, got none")
    if np.array_equal(ends[0], ends[1]):
        raise InputError(None, "gauge", "lower and upper are the same point; expected two")
    seen: list[Surface | None] = []
    whole: Surface | None = None
    for frame in frames:
        seen.append(triangulated(frame, whole))
        whole = seen[-1] or whole
    spacing = [usual_edge(surface) for surface in seen if surface is not None]
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
        why = {i: place for i, place in enumerate(per_frame) if isinstance(place, str)}
        if not why:
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
        warnings.append(Note(NoteKind.LOST, words))
    return _record(places[0], places[1], tuple(warnings))


def _record(lower: Sequence, upper: Sequence, warnings: tuple[Note, ...]) -> GaugeRecord:
    pairs = [
        None if isinstance(a, str) or isinstance(b, str) else b - a
        for a, b in zip(lower, upper, strict=True)
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
    return GaugeRecord(
        reference,
        length,
        length - reference,
        (length - reference) / reference,
        np.log(length / reference),
        lost,
        warnings,
    )


def _end(point: ArrayLike, name: str) -> Array:
    end = np.asarray(point, dtype=float)
    if end.shape != (2,) or not np.isfinite(end).all():
        raise InputError(None, name, f"expected x and y in mm, got {point!r}")
    return end


def gauge_load_curve(
    record: GaugeRecord,
    loads: ArrayLike,
    *,
    direction: str,
    specimen: str,
    frame_times: ArrayLike | None = None,
    load_times: ArrayLike | None = None,
    path: Path | None = None,
) -> LoadCurve:
    """The machine's load against the gauge's elongation; lost frames are left out.

    Without times, one load a frame. With times, the load is interpolated at the frames' times;
    frames before the first or after the last load are left out, which is logged.

    Parameters
    ----------
    loads : (n,) or, with times, (k,) N.
    direction, specimen, path : of the curve; the direction by any of its names.
    frame_times, load_times : (n,) and (k,) on the same clock and in the same unit; the latter
        rising.

    Raises
    ------
    InputError : counts that do not agree, times that do not rise, numbers that are not finite,
        fewer than two frames left.
    """
    way = direction_named(direction)
    load, count = np.asarray(loads, dtype=float), len(record.length)
    if not np.isfinite(load).all():
        raise InputError(path, "loads", "expected finite numbers; leave out rows without a load")
    if (frame_times is None) != (load_times is None):
        problem = "expected both frame_times and load_times, or neither"
        raise InputError(path, "times", problem)
    inside = np.ones(count, dtype=bool)
    if frame_times is None or load_times is None:
        if load.shape != (count,):
            problem = f"expected one load a frame, got {load.size} for {count} frames; pair by time"
            raise InputError(path, "loads", problem)
    else:
        load, inside = _at_times(load, np.asarray(frame_times), np.asarray(load_times), count, path)
    early = int((~inside).sum())
    if early:
        which = ", ".join(map(str, np.flatnonzero(~inside)))
        problem = "%s: %d of %d frames have no load at their time: %s"
        log.warning(problem, specimen, early, count, which)
    kept = inside & np.isfinite(record.elongation)
    if kept.sum() < 2:
        problem = f"only {kept.sum()} of {count} frames have both length and load; expected two"
        raise InputError(path, f"specimen {specimen!r}", problem)
    times = None if frame_times is None else np.asarray(frame_times, dtype=float)[kept]
    frame = np.flatnonzero(kept)
    return LoadCurve(way, specimen, record.elongation[kept], load[kept], path, times, frame)


def _at_times(
    load: Array, frame_times: Array, load_times: Array, count: int, path: Path | None
) -> tuple[Array, NDArray[np.bool_]]:
    """Loads (n,) at the frames' times, and which of them lie within the record."""
    pairs = (("frame_times", frame_times, count), ("load_times", load_times, load.size))
    for name, times, expected in pairs:
        if times.shape != (expected,) or not np.isfinite(times).all():
            problem = f"expected {expected} finite numbers, got {times.size}"
            raise InputError(path, name, problem)
    if load.size < 2 or (np.diff(load_times) <= 0).any():
        raise InputError(path, "load_times", "expected two or more, each later than the one before")
    inside = (frame_times >= load_times[0]) & (frame_times <= load_times[-1])
    return np.interp(frame_times, load_times, load), inside
