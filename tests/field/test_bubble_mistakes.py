"""Field: mistakes that people make in the files of a bubble, and good bubbles."""

import re
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble.doubts import doubts_of
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import Outline

from ..builders.bubbles import (
    BUBBLE_MISTAKES,
    CIRCLE,
    DOUBTED_LAW,
    FABRIC,
    THICKNESS,
    TURN,
    columns,
    deformed,
    doubts_by_name,
    for_each_field,
    in_camera,
    inflated_bubble,
    noisy,
)
from ..builders.projects import fit_setup


@pytest.mark.parametrize("angle", [0.0, 90.0, 30.0])
def test_elliptic_sheet_in_its_place_raises_no_doubt(angle):
    outline, off = (Outline(120.0, 80.0, a) for a in (angle, angle - 12.0))
    fields = noisy(inflated_bubble(DOUBTED_LAW, outline), 0.02)
    assert not doubts_by_name(fields, outline=outline)
    (turned,) = doubts_by_name(fields, outline=off).values()
    assert turned.name == "turned" and f"not {off.angle:.3g}:" in turned.text
    assert f"{angle:.3g} degrees from x" in turned.text or angle in (0.0, 90.0)
    assert [*doubts_by_name(columns(1 / 25.4)(fields), outline=outline)] == ["length-unit"]


@pytest.mark.parametrize("trap", BUBBLE_MISTAKES)
def test_mistake_is_named_and_raises_no_other_sure_doubt(clean_bubble, trap):
    change, name, sure, words = BUBBLE_MISTAKES[trap]
    found = doubts_by_name(change(clean_bubble))
    assert found[name].sure == sure and words in found[name].text, found
    assert {doubt.name for doubt in found.values() if doubt.sure} <= {name}


GOOD = {
    "soft in shear": (HypoelasticLaw.linear(700.0, 300.0, 3.0), {}),
    "stiff": (HypoelasticLaw.linear(1400.0, 450.0, 60.0), {}),
    "balanced": (HypoelasticLaw.linear(400.0, 400.0, 20.0), {}),
    "fill a little stiffer": (HypoelasticLaw.linear(380.0, 420.0, 20.0), {}),
    "small": (DOUBTED_LAW, {"outline": Outline.circle(30.0), "pressures": (0.05, 0.2, 0.6)}),
    "large": (DOUBTED_LAW, {"outline": Outline.circle(400.0), "pressures": (0.005, 0.02, 0.08)}),
    "thin": (DOUBTED_LAW, {"thickness": 0.2, "pressures": (0.005, 0.02, 0.07)}),
    "low pressures": (DOUBTED_LAW, {"pressures": (0.004, 0.01, 0.02)}),
    "one pressure": (DOUBTED_LAW, {"pressures": (0.2,)}),
}


@pytest.mark.parametrize("kind", GOOD)
def test_good_bubbles_of_many_fabrics_raise_no_doubt(kind):
    law, other = GOOD[kind]
    fields = noisy(inflated_bubble(law, **other), 0.02)
    assert not doubts_by_name(fields, **{k: v for k, v in other.items() if k != "pressures"})


def test_good_bubble_with_lost_points_or_noise_raises_no_doubt(clean_bubble):
    half = [
        replace(f, points=f.points[::2], displacement=f.displacement[::2], z=None)
        for f in clean_bubble
    ]
    x, y = clean_bubble[-1].points.T
    seen = (np.hypot(x, y) < 60.0) | (y < 0.0)  # the rim is lost on one side as it rises
    lost = replace(clean_bubble[-1], points=clean_bubble[-1].points[seen], z=None,
                   displacement=clean_bubble[-1].displacement[seen])  # fmt: skip
    one_sided = [*clean_bubble[:-1], lost]
    for fields in (
        clean_bubble,
        half,
        one_sided,
        noisy(clean_bubble, 0.05),
        [replace(f, z=None) for f in clean_bubble],
    ):
        assert not doubts_by_name(fields)


@pytest.mark.parametrize(("off", "doubt"), [(1.0, False), (2.0, True)])
def test_sheet_off_the_centre_is_doubted_without_its_clamp(clean_bubble, off, doubt):
    fields = noisy(in_camera(TURN("z", 0.0), (0.0, off, 0.0))(clean_bubble), 0.02)
    assert [*doubts_by_name(fields)] == ["off-centre"] * doubt


def test_state_recorded_twice_is_doubted(clean_bubble):
    """Alike but for the noise, which may let the centre sink a little."""
    for seed in range(3):
        again = noisy(clean_bubble, 0.02 + 0.01 * seed)[1]
        fields = (
            *clean_bubble[:2],
            replace(again, pressure=clean_bubble[2].pressure),
            clean_bubble[3],
        )
        (doubt,) = doubts_by_name(fields).values()
        assert (doubt.name, doubt.sure) == ("repeated-frame", True)
        assert "60 kPa" in doubt.text and "150 kPa" in doubt.text


@pytest.mark.parametrize(("share", "size"), [(0.0, 0.0), (0.02, 5.0), (0.02, 40.0), (0.002, 5.0)])
def test_gross_outliers_are_counted(clean_bubble, share, size):
    rng, fields = np.random.default_rng(3), noisy(clean_bubble, 0.03)
    count = round(share * len(clean_bubble[0].points))
    for field in fields:
        some = rng.choice(np.flatnonzero(np.hypot(*field.points.T) < 90), count, replace=False)
        field.displacement[some, 2] += size * rng.choice([-1.0, 1.0], count)
    found = doubts_by_name(fields)
    assert [*found] == ["outliers"] * (count > 0)
    if count:
        assert f"{count} of " in found["outliers"].text and not found["outliers"].sure
        most = re.search(r"up to (\S+) mm", found["outliers"].text)[1]
        assert float(most) == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize("size", [5.0, 10.0, 15.0])
def test_outliers_of_one_sense_do_not_hide_each_other(clean_bubble, size):
    rng, fields = np.random.default_rng(3), noisy(clean_bubble, 0.01)
    count = round(0.08 * len(clean_bubble[0].points))
    for field in fields:
        inner = np.flatnonzero(np.hypot(*field.points.T) < 90)
        field.displacement[rng.choice(inner, count, replace=False), 2] += size
    assert f"{count} of " in doubts_by_name(fields)["outliers"].text


@pytest.mark.parametrize(("height", "doubt"), [(0.0, False), (0.5, False), (4.0, True)])
def test_measured_heights_taken_for_flat_are_doubted(clean_bubble, height, doubt):
    """A dome on a sheet that is tilted and far from the camera's zero: the plane is no shape."""
    z = (
        height * (1 - (clean_bubble[0].points ** 2).sum(axis=1) / 1e4)
        + 0.01 * clean_bubble[0].points[:, 0]
    )
    fields = for_each_field(lambda f: replace(f, z=z))(noisy(clean_bubble, 0.02))
    for flat in (True, False):
        found = doubts_of(MeasuredView(fields, CIRCLE, THICKNESS, False, flat, expected=FABRIC))
        assert [one.name for one in found] == ["flat-sheet"] * (doubt and flat)


@pytest.mark.parametrize("after", [False, True])
def test_frames_that_lost_parts_of_the_rim_are_compared_by_places(clean_bubble, after):
    """Two with equally many points, of which row by row few are the same."""
    angle = np.arctan2(*clean_bubble[0].points.T[::-1])
    rim = np.hypot(*clean_bubble[0].points.T) > 70
    high, low = (np.flatnonzero(rim & (sign * angle > 0.6))[:90] for sign in (1, -1))
    every = np.arange(len(rim))
    kept = [every, *(np.setdiff1d(every, own) for own in (high, low, high))]
    fields = [
        replace(f, points=f.points[own], displacement=f.displacement[own], z=None)
        for f, own in zip(noisy(clean_bubble, 0.01), kept, strict=True)
    ]
    assert len(fields[2].points) == len(fields[3].points) < 0.9 * len(rim)
    found = doubts_by_name(for_each_field(deformed, False)(fields) if after else fields)
    assert ("deformed-coordinates" in found) == after
    assert not after or "100% of dx and dy" in found["deformed-coordinates"].text


def test_bar_given_as_mpa_in_python_is_doubted_with_its_factor(clean_bubble):
    """Within the bounds of coated fabrics by less than four times, and no pressure is absurd."""
    points = [field.frame.points for field in clean_bubble]
    displacements = [field.displacement for field in clean_bubble]
    pressures = [10 * field.pressure for field in clean_bubble]
    bubble = bf.Bubble(points, displacements, pressures, radius=100.0)
    project = bf.Project.of([bubble], bf.Law("constant"), fabric=bf.Fabric("made", THICKNESS))
    (judgement,) = bf.check(project).judgements
    (doubt,) = [doubt for doubt in judgement.doubts if doubt.name == "pressure-unit"]
    assert not doubt.sure and "divided by 10 (bar given as MPa)" in doubt.text


def targets_of(fields, displacements):
    """Targets of a fit to the points of some fields with other displacements."""
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    pressures = [field.pressure for field in fields]
    bubble = bf.Bubble(points, displacements, pressures, radius=100.0, elements=48)
    project = bf.Project.of([bubble], bf.Law("constant"), fabric=bf.Fabric("made", THICKNESS))
    (prepared,) = fit_setup(project).tests
    return prepared.targets


def test_bad_points_along_a_line_are_left_out_of_the_fit(clean_bubble):
    """3 mm off along a diagonal, of points whose sigma is normal."""
    fields = noisy(clean_bubble, 0.02)
    displacements = [field.displacement.copy() for field in fields]
    clean = targets_of(fields, displacements)
    x, y = fields[0].points.T
    is_bad = (np.abs(x - y) < 3.0) & (np.hypot(x, y) < 90.0)
    for displacement in displacements:
        displacement[is_bad, 2] += 3.0
    for target, good in zip(targets_of(fields, displacements), clean, strict=True):
        assert len(good.displacement) == len(is_bad)
        assert target.displacement == pytest.approx(good.displacement[~is_bad])
    # Of more than a tenth of a frame it is not known which are wrong.
    displacements[0][::5, 2] += 3.0
    assert len(targets_of(fields, displacements)[0].displacement) == len(is_bad)
