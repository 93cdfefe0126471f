"""Profile likelihood: the ends of a linear modulus, and words for what is uneven."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.inference.likelihood import BOUND, THRESHOLD, ProfileSide
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.optimum import NOT_THE_CARD
from bubblefit.runs.profile import NOT_CLOSED, Profile, Target, profile

from ..builders.closed_forms import PROFILED, STRAIN
from ..builders.projects import STRIP_MODULI


def test_profile_of_linear_modulus_ends_at_its_sigma(project):
    """A load is linear in a constant modulus: -2 log L is a parabola, and nothing is curved."""
    told, strain = [], STRAIN["one"]
    found = profile(project, {"E1": [0.05], "E2": [0.0]}, PROFILED, "one",
                    progress=lambda *event: told.append(event))  # fmt: skip
    for one, direction in zip(found.profiles, ("warp", "fill"), strict=True):
        best = np.mean(STRIP_MODULI["one"][direction])
        off = np.concatenate([20 * (m - best) * strain for m in STRIP_MODULI["one"][direction]])
        scatter = project.tests["one"].strips[direction].scatter
        noise = max(float(np.sqrt(np.mean(off**2))), scatter)
        sigma = noise / np.sqrt(np.mean((20 * strain) ** 2))
        assert one.best == pytest.approx(best, rel=1e-5)
        assert one.sigma == pytest.approx(sigma, rel=5e-3)
        away = np.sqrt(THRESHOLD) * sigma
        assert one.ends == pytest.approx((best - away, best + away), rel=1e-4)
        values, ratios = (np.array(v) for v in one.curve)
        assert (np.diff(values) > 0).all() and len(values) >= 7
        np.testing.assert_allclose(ratios, ((values - best) / sigma) ** 2, atol=0.01)
        assert one.asymmetry == pytest.approx(1.0, abs=1e-3) and "asymmetric" not in one.words
        # Four places and no refits: one analysis each, at a linear problem.
        assert one.analyses <= 2 * len(values)
    assert not found.notes  # the card's moduli are near the optimum's
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    assert told[-1][:2] == (4, 4) and "E1 at 5 % of strain" in {name for _, _, name in told}


def test_strain_beyond_those_reached_is_refused_in_percent(project):
    message = r"E1 is fitted up to 12 % of strain .*; got 50 %"
    with pytest.raises(InputError, match=message):
        profile(project, {"E1": [0.5]}, PROFILED, "one")


def test_profile_that_meets_its_bounds_is_not_closed(project):
    far = replace(PROFILED, law=HypoelasticLaw.linear(360.0, 190.0, 10.0, 0.0))
    found = profile(project, {"G12": []}, far, "one")
    (one,) = found.profiles
    assert one.ends == (None, None) and one.numbers["lower_MPa"] is None
    assert one.lower_side.reason == one.upper_side.reason == BOUND
    assert one.allowed == pytest.approx((5.0, 200.0), rel=1e-6)
    assert [one.lower_side.values[-1], one.upper_side.values[-1]] == pytest.approx(
        [5.0, 200.0], rel=1e-6
    )
    assert [note.kind for note in found.notes] == [NOT_THE_CARD, NOT_CLOSED, NOT_CLOSED]
    assert "moved E1 by -8.3 %" in found.notes[0] and "5 MPa" in found.notes[1]


def test_uneven_profile_is_put_in_words():
    below = ProfileSide((10.0, 9.0, 8.0), (0.0, 1.0, 4.0), "", 2)
    above = ProfileSide((10.0, 12.0, 14.0), (0.0, 1.0, 4.0), "", 2)
    one = Profile(
        Target("G12", 0.02, label="G12"), 10.0, 1.0, (8.0, 12.0), below, above, (1.0, 99.0)
    )
    assert "(the fit's band 8 to 12)" in one.words
    root = np.sqrt(THRESHOLD)
    assert one.ends == pytest.approx((10 - root, 10 + 2 * root), rel=0.01)
    assert one.asymmetry == pytest.approx(2.0)
    assert one.interval == "G12 at 2 % of strain is 8.04 to 13.92 MPa (95 %)"
    at_best = ProfileSide((10.0, 10.0), (0.0, 9.0), "", 2)
    for sides in ({"lower_side": at_best}, {"upper_side": at_best}):
        assert replace(one, **sides).asymmetry is None
    assert one.words.endswith("; asymmetric: 1.96 below, 3.92 above")
    better = replace(one, upper_side=ProfileSide((10.0, 12.0), (0.0, -3.0), "bound", 2))
    assert {note.kind for note in better.notes} == {NOT_THE_CARD, NOT_CLOSED}
