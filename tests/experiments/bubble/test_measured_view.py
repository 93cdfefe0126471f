"""experiments/bubble/measured_view.py: rises and clamp of measured fields."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.meshes.disk import Outline

from ...builders.bubbles import (
    CIRCLE,
    THICKNESS,
    TURN,
    doubts_by_name,
    in_camera,
    noisy,
    points_on,
    with_clamp,
)
from .cases import FIVE_POINTS, field_of


def test_rises_of_a_view_are_those_about_the_centre():
    moved = np.outer([10.0, 12.0, 14.0, 1.0, 2.0], [0, 0, 1.0])
    view = MeasuredView((field_of(0.1, moved),), CIRCLE, 0.8, False)
    assert view.rises.tolist() == [12.0]  # those within 25 mm
    far = MeasuredView((field_of(0.1, moved[:4], FIVE_POINTS[1:] * 3.0),), CIRCLE, 0.8, False)
    assert far.rises.tolist() == [11.0]  # no point there: of all
    assert view.apexes == () and view.rim is None and view.axes is None
    assert view.inner(field_of(0.1, moved, FIVE_POINTS * 2.25)).tolist() == [True] * 4 + [False]


def test_sheet_that_falls_has_no_rim_and_is_doubted(clean_bubble):
    fields = [replace(f, displacement=f.displacement * (1.0, 1.0, -1.0)) for f in clean_bubble]
    view = MeasuredView(tuple(fields), CIRCLE, THICKNESS, False)
    assert view.surfaces == [] and view.rim is None and view.clamp is None
    assert doubts_by_name(tuple(fields))["z-flipped"].sure


def test_surfaces_are_those_above_half_of_the_last_rise():
    fields = tuple(field_of(0.01 * rise, [0, 0, rise]) for rise in (10.0, 14.9, 15.1, 30.0))
    view = MeasuredView(fields, CIRCLE, 0.8, False)
    assert [rise[0] for _, rise in view.surfaces] == [15.1, 30.0]
    sunk = MeasuredView((field_of(0.1, [0, 0, -30.0]),), CIRCLE, 0.8, False)
    assert sunk.surfaces == []


@pytest.mark.parametrize(
    ("radius", "sure"), [(85.0, True), (96.0, False), (100.0, None), (104.0, False), (110.0, True)]
)
@pytest.mark.parametrize("off", [0.0, 2.0])
def test_radius_beside_that_of_the_resting_clamp_is_doubted(clean_bubble, radius, sure, off):
    """Its own circle is found within 1 mm of 100, its centre within 0.1."""
    fields = in_camera(TURN("z", 0.0), (off, 0.0, 0.0))(noisy(with_clamp(clean_bubble), 0.02))
    view = MeasuredView(fields, Outline.circle(radius), THICKNESS, False)
    assert view.clamp.scale * radius == pytest.approx(100.0, abs=1.0)
    assert (view.clamp.x, view.clamp.y) == pytest.approx((off, 0.0), abs=0.1)
    found = doubts_by_name(fields, outline=Outline.circle(radius))
    assert found["radius"].sure == sure if sure is not None else "radius" not in found
    if sure is not None:
        assert f"says radius {radius:.3g} mm" in found["radius"].text
    if not sure:
        assert ("off-centre" in found) == (off > 0)


@pytest.mark.parametrize(
    ("scatter", "distance", "is_outlying"),
    [(1.0, 14.4, False), (1.0, 15.3, True), (0.01, 0.58, False), (0.01, 0.62, True)],
)
def test_outlier_is_ten_deviations_and_a_fiftieth_of_the_rise_off(scatter, distance, is_outlying):
    """Ten deviations of errors of 1 mm, of either sign, are 14.8 mm; the rise is 30 mm."""
    points = points_on(CIRCLE)
    dome = 30.0 * (1.0 - (points**2).sum(axis=1) / 1e4)
    chequered = (-1.0) ** np.rint(14.0 * (points / 100.0 - 0.01)).sum(axis=1)
    rise = dome + scatter * chequered
    far = int(np.argmin(np.hypot(*(points - 30.0).T)))
    rise[far] = dome[far] + distance
    moved = np.column_stack([np.zeros_like(points), rise])
    view = MeasuredView((field_of(0.1, moved, points),), CIRCLE, 0.8, False)
    found = view.gross_outliers(view.last)
    assert np.flatnonzero(found.is_outlying).tolist() == [far] * is_outlying
    assert found.count == is_outlying
    assert found.scatter == pytest.approx(1.4826 * scatter, rel=0.03)
    assert found.farthest == pytest.approx(distance * is_outlying, rel=0.02)


@pytest.mark.parametrize(("share", "is_named"), [(0.09, True), (0.11, False)])
def test_outlying_points_are_named_up_to_a_tenth_of_all(share, is_named):
    field = field_of(0.1, [0, 0, 30.0], points_on(CIRCLE))
    is_outlying = np.arange(len(field.points)) < share * len(field.points)
    view = MeasuredView((field,), CIRCLE, 0.8, False)
    view._outliers_by_field[field] = SimpleNamespace(is_outlying=is_outlying)
    assert (view.outlying_points(field) == (is_outlying & is_named)).all()


@pytest.mark.parametrize("y", [-2.0, 2.0])
def test_tilts_are_estimated_from_the_mean_motion_of_a_sheet_that_rises(y):
    def estimates(z):
        first, last = np.tile([0.0, 0.0, 0.2 * z], (5, 1)), np.tile([1.0, y, z], (5, 1))
        fields = field_of(0.01, first), field_of(0.1, last)
        return MeasuredView(fields, CIRCLE, 0.8, False).registration_estimates

    tilts = estimates(20.0)
    assert tilts["tilt_x"] == pytest.approx(np.degrees(np.arctan2(-y, 16.0)))
    assert tilts["tilt_y"] == pytest.approx(np.degrees(np.arctan2(1.0, np.hypot(y, 16.0))))
    assert {"tilt_x", "tilt_y"}.isdisjoint(estimates(-20.0))
