"""Field: scales of coordinates that are wrong, and reference pictures taken under pressure.

Sources: DICe, MultiDIC and DuoDIC issues on calibration plates whose spacing was entered as their
width or in inches; questions on reference images of inflated specimens (pyvale, DICe forums).
"""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.doubts import doubts_of
from bubblefit.experiments.bubble.findings import notes_of_slack
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.meshes.disk import Outline

from ..builders.bubbles import CIRCLE, FABRIC, THICKNESS, for_each_field, with_clamp


def scaled(fields, factor):
    change = lambda f: replace(  # noqa: E731
        f, points=factor * f.points, displacement=factor * f.displacement
    )
    return for_each_field(change)(fields)


def doubts_by_name(fields, outline=CIRCLE, **view):
    found = doubts_of(
        MeasuredView(tuple(fields), outline, THICKNESS, False, expected=FABRIC, **view)
    )
    return {doubt.name: doubt for doubt in found}


def test_radius_of_the_clamp_is_compared_with_the_one_by_a_ruler(clean_bubble):
    fields = scaled(with_clamp(clean_bubble), 0.9)
    clamp = Outline.circle(90.0)
    assert "radius" not in doubts_by_name(fields, clamp)
    found = doubts_by_name(fields, clamp, nominal_radius=100.0)["radius"]
    assert found.sure and "90 mm in the files and 100 mm" in found.text
    assert "wrong by a factor of 0.9" in found.text
    assert "radius" not in doubts_by_name(fields, clamp, nominal_radius=91.0)


def test_remedy_of_another_radius_asks_for_a_ruler(clean_bubble):
    found = doubts_by_name(scaled(with_clamp(clean_bubble), 0.9))["radius"]
    assert "measure it with a ruler" in found.text
    assert 'radius = "clamp" with a nominal_radius' in found.text


@pytest.mark.parametrize(
    ("factor", "cause"),
    [(2.54, "inches for centimetres"), (1 / 2.54, "inches"), (0.9, None)],
)
def test_usual_factors_of_a_scale_are_named(clean_bubble, factor, cause):
    fields = scaled(with_clamp(clean_bubble), factor)
    clamp = Outline.circle(100.0 * factor)
    text = doubts_by_name(fields, clamp, nominal_radius=100.0)["radius"].text
    assert ("(" in text.split("factor of")[1]) == bool(cause) and (cause or "") in text


@pytest.mark.parametrize("factor", [1 / 7, 7.0])
def test_points_that_reach_a_seventh_or_seven_radii_are_an_error(clean_bubble, factor):
    (found,) = doubts_by_name(scaled(clean_bubble, factor)).values()
    assert (found.name, found.sure) == ("length-unit", True)


@pytest.mark.parametrize(("height", "is_doubted"), [(2.0, False), (8.0, True), (-8.0, False)])
def test_dome_in_the_reference_picture_is_doubted(clean_bubble, height, is_doubted):
    with_dome = for_each_field(
        lambda f: replace(f, z=height * np.clip(1 - (f.points**2).sum(axis=1) / 1e4, 0, None))
    )
    names = doubts_by_name(with_dome(with_clamp(clean_bubble)))
    assert ("loaded-reference" in names) == is_doubted
    if is_doubted:
        assert "from_pressure" in names["loaded-reference"].text


@pytest.mark.parametrize(("slack", "is_noted"), [(0.4, False), (-0.1, False), (-0.5, True)])
def test_slack_below_zero_is_no_usual_slack(slack, is_noted):
    notes = notes_of_slack({"slack_percent": [slack, 0.1]})
    assert [note.kind for note in notes] == ["negative slack"] * is_noted
    assert not is_noted or "-0.50 % in warp" in str(notes[0])
    assert notes_of_slack({"slack_percent": None}) == []
