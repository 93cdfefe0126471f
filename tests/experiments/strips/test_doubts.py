"""experiments/strips/doubts.py: limits from which load curves are doubted."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.doubts import curves_of
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

from .cases import GAUGE, GOOD_CURVES, THICKNESS, WIDTH, strip_doubts_of, strip_of_curves

A, P, F = "elongation-unit", "preload", "after-failure"
#: Elongation, load; where the gauge ends; the doubt and its numbers.
LIMITS = [
    *(([0.0, 0.5 * end, end], [0, 50, 100], gauge, None, name, f"{end / gauge:.3g} gauge lengths")
      for gauge, end, name in ((500, 1.0, A), (500, 1.01, ""), (2, 2.99, ""), (2, 3.0, A))),
    # The median of what lies within a hundredth of the elongation, on either side.
    *(([-0.04, 0.0, 0.04, 2.0, 4.0], [90.0, level, -90.0, 60.0, 100.0], 20, None, name,
       f"{level:.3g} N ({level / 100:.0%} of") for level, name in
      ((4.9, ""), (5.0, P), (-5.0, P), (-4.9, ""))),
    # The curve begins where the strip is elongated already.
    ([0.0401, 2.0, 4.0], [5.0, 60.0, 100.0], 20, None, "", ""),
    ([0.0, 2.0, 4.0], [-195.0, -100.0, 0.0], 20, None, "", ""),
    *(([0.0, 2.0, 3.0, 4.0], [0.0, 100.0, low, 20.0], 20, 3.0, name,
       f"falls from 100 to {low:.3g} N at an elongation of 3 mm")
      for low, name in ((90.0, ""), (89.9, F), (69.9, F))),
    # In the first half of the way it is an early slip, and beyond the end nobody asks.
    ([0.0, 1.0, 2.0, 4.0], [0.0, 100.0, 9.9, 200.0], 20, None, "", ""),
    ([0.0, 2.0, 3.0, 4.0], [0.0, 100.0, 9.9, 20.0], 20, 2.99, "", ""),
]  # fmt: skip


@pytest.mark.parametrize(("elongation", "load", "gauge", "end", "name", "words"), LIMITS)
def test_limits_of_strip_doubts(elongation, load, gauge, end, name, words):
    """On one bias strip, which no modulus is held against."""
    one = LoadCurve("bias", "B1", np.array(elongation), np.array(load, float), None)
    length = gauge + (elongation[-1] if end is None else end)
    found = strip_doubts_of({"bias": Strip("bias", gauge, length, None, (one,))})
    assert [d.name for d in found] == [name] * bool(name)
    assert all(words in d.text for d in found)


@pytest.mark.parametrize(("grips", "words"), [(75.0, "about 27% of"), (20.0, "by the slip in")])
def test_modulus_from_machine_travel_is_doubted(grips, words):
    curves = {d: replace(c, between_grips="Standardweg") for d, c in GOOD_CURVES.items()}
    found = strip_doubts_of({d: strip_of_curves(c) for d, c in curves.items()}, grips=grips)
    assert [(d.name, d.sure) for d in found] == [("grip-travel", False)] * 3
    for doubt, modulus in zip(found, ("E1", "E2", "G12"), strict=True):
        assert words in doubt.text and modulus in doubt.text and "'Standardweg'" in doubt.text
        assert ("gauge_length" in doubt.text) == (grips > 20.0)


def test_extensometer_that_stands_still_is_doubted():
    good = GOOD_CURVES["bias"]
    for at, end, doubt in ((9.4, 9.4, 0), (7.0, 7.0, 1), (7.0, 6.9, 0)):
        one = replace(good, elongation=np.minimum(good.elongation, at))
        found = strip_doubts_of({"bias": strip_of_curves(one, end)})
        assert {d.name for d in found} == set(["gauge-still"] * doubt)


@pytest.mark.parametrize(("low", "sure"), [(89.0, False), (70.0, False), (69.9, True)])
def test_falling_load_may_be_a_failure(low, sure):
    one = LoadCurve("bias", "1", np.array([0, 2, 3, 4.0]), np.array([0, 50, 100, low]), None)
    (found,) = strip_doubts_of({"bias": Strip("bias", GAUGE, GAUGE + 4.0, None, (one,))})
    assert (found.name, found.sure) == ("after-failure", sure)
    assert "until_largest_load" in found.text
    cut = Strip("bias", GAUGE, GAUGE + 3.0, None, (one.until_largest_load(),))
    assert not strip_doubts_of({"bias": cut})
    # One that falls slowly at first has failed all the same.
    one = replace(one, load=np.array([0, 100, 85, low]))
    assert (
        strip_doubts_of({"bias": Strip("bias", GAUGE, GAUGE + 4.0, None, (one,))})[0].sure == sure
    )


def strip_of_one_modulus(direction: str, modulus: float) -> Strip:
    """Return the load curve of one modulus in log strain, 20 mm long, 25 mm wide, 0.8 mm thick."""
    elongation = np.linspace(0.0, 4.0, 41)
    load = modulus * WIDTH * THICKNESS * np.log1p(elongation / GAUGE)
    return Strip(direction, GAUGE, 24.0, None, (LoadCurve(direction, "1", elongation, load, None),))


@pytest.mark.parametrize(
    ("direction", "modulus", "words"),
    [
        ("warp", 74.9, "74.9 MPa, and the bounds of E1 are 300 to 1.5e+03"),
        ("warp", 75.1, "75.1 MPa, where coated fabrics have 100 and more"),
        ("warp", 101.0, ""),
        ("warp", 5990.0, ""),
        ("warp", 6010.0, "6.01e+03 MPa, and the bounds of E1 are 300 to 1.5e+03"),
        ("fill", 24.9, "24.9 MPa, and the bounds of E2 are 100 to 600"),
        ("bias", 1e5, ""),
    ],
)
def test_modulus_far_from_its_bounds_is_doubted(direction, modulus, words):
    own = {direction: strip_of_one_modulus(direction, modulus)}
    found = strip_doubts_of(own)
    assert len(found) == bool(words) and all(words in d.text for d in found)
    assert not strip_doubts_of(own, expected=Expected({}))


def test_modulus_is_taken_at_half_of_the_strain():
    """At half of the last log strain, as the median of five rows: elsewhere the curve may lie."""
    good = strip_of_one_modulus("warp", 700.0).curves[0]
    load = 100.0 * good.load
    middle = int(np.argmin(np.abs(np.log1p(good.elongation / GAUGE) - 0.5 * np.log(1.2))))
    load[middle - 1 : middle + 2] = good.load[middle - 1 : middle + 2]
    strip = replace(strip_of_one_modulus("warp", 1.0), curves=(replace(good, load=load),))
    assert not strip_doubts_of({"warp": strip})
    load[middle - 1] *= 100.0
    assert strip_doubts_of({"warp": strip})


@pytest.mark.parametrize(("fill", "doubt"), [(459.0, 0), (461.0, 1)])
def test_fill_stiffer_than_the_warp_is_doubted(fill, doubt):
    both = {"warp": strip_of_one_modulus("warp", 400.0), "fill": strip_of_one_modulus("fill", fill)}
    found = strip_doubts_of(both)
    assert [(d.name, d.sure) for d in found] == [("swapped", False)] * doubt
    assert all(f"{fill:.3g} MPa, the warp's 400 MPa" in d.text for d in found)
    assert not strip_doubts_of({"fill": both["fill"]})
    assert not strip_doubts_of({**both, "warp": replace(both["warp"], curves=())})


def test_polynomial_is_sampled_at_fifty_places():
    u = np.linspace(0, 4, 9)
    strip = replace(
        strip_of_one_modulus("warp", 1.0), curves=(), polynomial=fit_load_polynomial(u, 3.0 * u, 1)
    )
    ((name, elongation, load),) = curves_of(strip)
    assert (name, len(elongation), elongation[-1]) == ("", 50, 4.0)
    assert load == pytest.approx(3.0 * elongation, abs=1e-9)
    assert curves_of(replace(strip, polynomial=None)) == []


def test_specimen_beyond_the_final_length_is_no_still_gauge():
    """A later cycle of a file may be one, which is read as a specimen."""
    curve = GOOD_CURVES["warp"]
    late = replace(curve, elongation=curve.elongation + 2.0)
    strip = replace(strip_of_curves(curve), final_length=GAUGE + 1.0, curves=(curve, late))
    assert not {d.name for d in strip_doubts_of({"warp": strip})} & {"gauge-still", "after-failure"}
