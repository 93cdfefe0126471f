"""Doubts about the frames of a bubble: their order, states given twice, the reference state.

A fit can be repeated with a reference picture under pressure as an alternative to a sheet at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.bubble_model import SLACK
from ...notes import NoteKind, Objection
from ...readers.fields import DisplacementField
from ...solvers.base import Array
from ..base import Alternative
from ..doubts import Doubt
from . import BubbleTest
from .measured_view import MeasuredView
from .placement import in_all_quarters, thinned
from .sheet import FLAT, fit_disk_polynomial

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class FrameLimits:
    """Limits by which frames are out of order or one state was recorded twice."""

    sinking: float = 0.02  # share of the highest rise: a centre that sinks by more is no noise
    same_state: float = 0.1  # growth of ln(rise) / expected growth: less is the same state
    usual_growth: float = 0.2  # least expected d ln(rise) / d ln(pressure)
    judged_rise: float = 0.02  # share of the highest rise: least expected growth that is judged
    still: float = 0.25  # rise / rise in proportion to the pressure: any bubble begins faster
    no_pressure: float = 0.02  # share of the highest pressure that ...
    inflated: float = 0.5  # ... lifts no flat sheet to this share of the highest rise


@dataclass(frozen=True)
class ReferenceLimits:
    """Limits by which coordinates are those of the deformed sheet, or the sheet was not flat."""

    followed: float = 0.5  # least slope of places over displacements in deformed coordinates
    max_followed: float = 2.0  # largest such slope: no sheet is moved by twice its motion
    min_correlation: float = 0.9  # least correlation of places and displacements for a slope
    same_place: float = 0.05  # share of the median motion within which two points are the same
    most_points: float = 0.5  # least share of the points that is found in both frames
    max_points: int = 4000  # about the largest number of points used of a frame, evenly thinned
    first_shape: float = 0.004  # share of the radius: deviation from a plane that matters
    rising_edge: float = 0.15  # share of the rise by which the edge may rise: 0.08 by a usual clamp
    sliding_edge: float = 0.03  # share of the rise by which it may move in the plane
    dome: float = 0.05  # share of the radius: height of a dome that pressure may have raised
    edge_degree: int = 6  # degree of the polynomial that is followed to the edge
    outlying: float = 10.0  # median distances from it beyond which points do not count
    shape_degree: int = 4  # degree of the polynomial of the sheet's shape before the test


FRAMES = FrameLimits()
REFERENCE = ReferenceLimits()


def frame_order(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt frames that are not in the order of their pressures."""
    for k, (rise, higher_rise) in enumerate(pairwise(view.rises)):
        if higher_rise < rise - FRAMES.sinking * view.rises.max():
            low, high = (1e3 * field.pressure for field in view.fields[k : k + 2])
            text = (
                f"the centre sinks from {rise:.3g} to {higher_rise:.3g} mm between {low:.4g} and "
                f"{high:.4g} kPa: the frames are not in the order of the pressures"
            )
            yield Doubt("frame-order", True, text)
            return


def repeated_frame(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt one frame given for two pressures."""
    pairs = [
        f"{1e3 * first.pressure:.4g} and {1e3 * second.pressure:.4g} kPa"
        for first, second in pairwise(view.fields)
        if np.array_equal(first.displacement, second.displacement) and first.displacement.any()
    ]
    if pairs:
        further = f" (and in {len(pairs) - 1} more pairs)" if pairs[1:] else ""
        text = f"the displacements at {pairs[0]} are the same to the last digit{further}: one frame"
        yield Doubt("repeated-frame", True, f"{text} is given twice")


def states_at_rest(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt frames at rest said to be under pressure, and inflated ones at next to none."""
    if view.counts_from_pressure:
        return
    pressures = np.array([field.pressure for field in view.fields])
    pressure_share = pressures / pressures[-1]
    rise_share = view.rises / max(view.rises.max(), 1e-12)
    is_still = np.abs(rise_share) < FRAMES.still * pressure_share
    is_inflated = (pressure_share < FRAMES.no_pressure) & (rise_share > FRAMES.inflated)
    doubtful = np.flatnonzero(is_still | is_inflated)
    if not len(doubtful):
        return
    k = doubtful[0]
    text = (
        f"the centre rises by {view.rises[k]:.2g} of {view.rises.max():.3g} mm at "
        f"{1e3 * pressures[k]:.3g} kPa, {pressure_share[k]:.2%} of the highest pressure: the frame "
        "was taken at rest, and is to be left out, or a pressure is wrong"
    )
    yield Doubt("rest-frame", True, text)


def same_states(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt two pressures between which the centre rises by next to nothing."""
    rises = view.rises
    if len(view.fields) < 2 or not (rises > 0).all():
        return
    log_pressure = np.log([field.pressure for field in view.fields])
    log_rise = np.log(rises)
    growth = float(np.median(np.diff(log_rise) / np.diff(log_pressure)))
    growth = max(FRAMES.usual_growth, growth)
    for k in range(len(rises) - 1):
        expected_growth = growth * (log_pressure - log_pressure[k])
        # The next frame that is far enough above for a rise to be seen.
        higher = np.flatnonzero(expected_growth * rises[k] > FRAMES.judged_rise * rises.max())
        if not len(higher):
            continue
        n = higher[0]
        if log_rise[n] - log_rise[k] < FRAMES.same_state * expected_growth[n]:
            low, high = (1e3 * view.fields[i].pressure for i in (k, n))
            text = (
                f"the centre stands at {rises[k]:.4g} mm at {low:.4g} kPa and at {rises[n]:.4g} mm "
                f"at {high:.4g} kPa, and should rise by about "
                f"{rises[k] * np.expm1(expected_growth[n]):.2g} mm: one state was recorded twice"
                ", or a pressure is wrong"
            )
            yield Doubt("repeated-frame", True, text)
            return


def deformed_coordinates(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt places after the motion where those before it are meant."""
    sign = _followed_height(view) or _followed_places(view)
    if sign:
        text = f"{sign}: the coordinates are those of the deformed sheet; export the reference"
        yield Doubt("deformed-coordinates", True, f"{text} coordinates")


def _followed_height(view: MeasuredView) -> str:
    """Return that heights follow dz: a reference surface that has the bubble's own shape."""
    last = view.last
    if last.z is None or view.is_registered or view.counts_from_pressure:
        return ""
    followed = _followed_share(last.z[:, None], last.displacement[:, 2:])
    return f"the height z follows dz by {followed:.0%}" if followed > REFERENCE.followed else ""


def _followed_places(view: MeasuredView) -> str:
    """Return that places change from frame to frame with the displacements."""
    last = view.last
    for field in view.fields[:-1]:
        rows, rows_of_field = _same_points(last, field)
        if not len(rows):
            continue
        motion = (last.displacement[rows] - field.displacement[rows_of_field])[:, :2]
        followed = _followed_share(last.points[rows] - field.points[rows_of_field], motion)
        if REFERENCE.followed < followed < REFERENCE.max_followed:
            return f"x and y change from frame to frame by {followed:.0%} of dx and dy"
    return ""


def _same_points(last: DisplacementField, field: DisplacementField) -> tuple[Rows, Rows]:
    """Return the rows of points that are in both frames: by their places, before or after motion.

    Rows are paired as they stand where most of the places are found in neither way.
    """
    in_plane = np.linalg.norm(last.displacement[:, :2], axis=1)
    motion = float(np.median(in_plane))
    for share_of_motion in (0.0, 1.0):
        places = last.points - share_of_motion * last.displacement[:, :2]
        places_of_field = field.points - share_of_motion * field.displacement[:, :2]
        count = len(places_of_field)
        samples = thinned(np.arange(count), REFERENCE.max_points)
        distance, row = scipy.spatial.cKDTree(places).query(places_of_field[samples])
        is_same = distance <= REFERENCE.same_place * motion
        if is_same.mean() > REFERENCE.most_points:
            return row[is_same], samples[is_same]
    count = len(last.points)
    rows = np.arange(count if count == len(field.points) else 0)
    return rows, rows


def _followed_share(places: Array, displacement: Array) -> float:
    """Return the slope of places over displacements if they are correlated, 0 otherwise.

    Parameters
    ----------
    places, displacement : (n, d) array, mm
        Positions of points, or their change, and displacements.
    """
    a = places - places.mean(axis=0)
    b = displacement - displacement.mean(axis=0)
    size = float(np.sqrt((a**2).sum() * (b**2).sum()))
    if not size > 0 or float((a * b).sum()) < REFERENCE.min_correlation * size:
        return 0.0
    return float((a * b).sum() / (b**2).sum())


def _field_of_heights(view: MeasuredView) -> DisplacementField:
    """Return the field with the most points of known height; any field where no height is known."""
    return max(view.fields, key=lambda field: 0 if field.z is None else len(field.points))


def first_shape(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a sheet taken for flat whose measured heights are not."""
    field = _field_of_heights(view)
    if field.z is None or not view.is_flat:
        return
    is_on_disk = view.inner(field, 1.0)
    heights = field.z[is_on_disk][:, None]
    points = field.points[is_on_disk]
    radius = view.outline.major
    try:
        plane = fit_disk_polynomial(points, heights, radius, 1)
        shape = fit_disk_polynomial(points, heights, radius, REFERENCE.shape_degree)
    except InputError:
        return
    largest = float(np.abs(shape.values_at(points) - plane.values_at(points)).max())
    if largest > REFERENCE.first_shape * view.outline.radius:
        text = (
            f"the sheet is up to {largest:.2g} mm off a plane in the reference picture, and would "
            "be taken for flat and taut, which can change E1 by a factor: say [bubble.sheet] "
            'surface = "measured"'
        )
        yield Doubt("flat-sheet", False, text)


def loaded_reference(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a reference picture in which the sheet stands as a dome, in the sense of its rise."""
    field = _field_of_heights(view)
    if field.z is None:
        return
    is_central = view.inner(field, 0.25)
    is_at_rim = ~view.inner(field, 0.9)
    if not is_central.any() or not is_at_rim.any():
        return
    dome = float(np.median(field.z[is_central]) - np.median(field.z[is_at_rim]))
    if dome > REFERENCE.dome * view.outline.radius and view.rises[-1] > 0:
        # The height of a sheet that is flat at rest grows with the cube root of the pressure.
        share = (dome / (dome + view.rises[-1])) ** 3
        pressure = 1e3 * view.fields[-1].pressure * share
        text = (
            f"the sheet stands {dome:.2g} mm above its rim in the reference picture: was it under "
            f"pressure (about {pressure:.2g} kPa by its height)? Take a picture at rest, or count "
            "displacements from a frame whose pressure is known ([bubble.sheet] from_pressure, "
            "with modes)"
        )
        yield Doubt("loaded-reference", False, text)


def moving_edge(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt frames in which the edge of the sheet moves as a whole, with the camera or clamp."""
    if view.moving_rim:
        return
    motions = [_motion_of_edge(view, field) for field in view.fields]
    limits = [REFERENCE.sliding_edge, REFERENCE.sliding_edge, REFERENCE.rising_edge]
    excess = (np.abs(motions) / limits).max(axis=1)
    k = int(np.argmax(excess))
    if excess[k] > view.rises.max() > 0:
        x, y, z = motions[k]
        text = (
            f"the edge of the sheet moves by {x:.2g}, {y:.2g}, {z:.2g} mm on average at "
            f"{1e3 * view.fields[k].pressure:.4g} kPa: the camera or the clamp moved, or dz is a "
            "height and not a rise; let a registration take the motion of the clamp out "
            '([bubble.data.points.registration]), or say [bubble.sheet] rim = "measured"'
        )
        yield Doubt("moving-edge", False, text)


def _motion_of_edge(view: MeasuredView, field: DisplacementField) -> Array:
    """Return the mean displacement (3,), mm, of the edge; zero where it cannot be known."""
    is_on_disk = view.inner(field, 1.0)
    points = field.points[is_on_disk]
    if not in_all_quarters(points) or not view.outline.round:
        return np.zeros(3)
    radius = view.outline.radius
    try:
        displacement = field.displacement[is_on_disk]
        surface = fit_disk_polynomial(points, displacement, radius, REFERENCE.edge_degree)
        distance = np.abs(displacement - surface.values_at(points)).max(axis=1)
        is_close = distance <= REFERENCE.outlying * np.median(distance)
        surface = fit_disk_polynomial(
            points[is_close], displacement[is_close], radius, REFERENCE.edge_degree
        )
    except InputError:
        return np.zeros(3)
    return surface.values_at(view.outline.edge(25)[:-1]).mean(axis=0)


LOADED_REFERENCE = NoteKind(
    "loaded reference",
    weight=20,
    objection=Objection(
        "a reference picture under pressure explains the data better",
        "let displacements count from the reference picture: give it as a frame of its pressure "
        "with displacements of zero, and from_pressure in [bubble.sheet]",
        unusable=True,
    ),
)
#: Slack below which a sheet may have been under pressure, %: half of its prior's usual deviation.
SMALLEST_SLACK = -0.15


def loaded_alternative(prepared: Any, nuisance: Mapping[str, float]) -> Alternative | None:
    """Return a loaded reference picture as an alternative, where the fitted sheet makes it likely.

    That is a sheet shorter than flat, or one that stands as a dome in the sense of its rise.

    Parameters
    ----------
    prepared : PreparedBubble
        The bubble as it was fitted.
    nuisance : mapping of str to float
        Values of its nuisance parameters by name.
    """
    test = prepared.test
    if prepared.known is not None or not _can_be_loaded(test):
        return None
    dome = nuisance.get("z0_1", 0.0)
    if prepared.sheet.surface is not None:
        dome += _height(prepared)
    is_short = min(nuisance.get(name, 0.0) for name in SLACK) <= SMALLEST_SLACK
    if not is_short and dome <= REFERENCE.dome * test.outline.radius:
        return None
    # The height of a sheet that is flat at rest grows with the cube root of the pressure.
    slope, zero = np.polyfit(np.cbrt(test.pressures), prepared.view.rises, 1)
    pressure = max(-float(zero / slope), 0.0) ** 3
    lowest = 1e3 * test.pressures[0]
    return Alternative(
        "a reference picture under {:.3g} kPa",
        "the sheet at rest as it was fitted",
        min(max(1e3 * pressure, 1e-2 * lowest), 0.5 * lowest),
        0.9 * lowest,
        partial(with_loaded_reference, prepared),
        LOADED_REFERENCE,
    )


def _can_be_loaded(test: BubbleTest) -> bool:
    """Return whether the displacements of a test may be counted from a loaded reference picture."""
    is_counted = test.sheet.reference_frame is not None or test.displacement_offset
    has_rising_points = test.match_by == "points" and test.rising == len(test.pressures) > 1
    return has_rising_points and not is_counted and not test.sheet.moving_rim


def _height(prepared: Any) -> float:
    """Return the height (mm) of the centre of the measured surface above its rim."""
    model = prepared.model
    heights = model.mesh.points[:, 2]
    return float(heights[model.mesh.node_sets["apex"][0]])


def with_loaded_reference(prepared: Any, pressure: float) -> Any:
    """Return a bubble whose reference picture was taken under a pressure (kPa), flat at rest."""
    test = prepared.test
    reference = max(prepared.fields, key=lambda field: len(field.points))
    reference = replace(
        reference,
        pressure=1e-3 * pressure,
        displacement=np.zeros_like(reference.displacement),
    )
    sheet = replace(
        test.sheet,
        slack=False,
        measured=False,
        constant=(),
        reference_frame=0,
    )
    loaded = replace(
        test,
        pressures=(reference.pressure, *test.pressures),
        increments=tuple(sorted({reference.pressure, *test.increments})),
        sheet=sheet,
    )
    return replace(prepared, test=loaded, fields=(reference, *prepared.fields), sheet=FLAT)
