"""experiments/strips/doubts.py: limits from which load curves are doubted."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.doubts import curves_of, doubts_of_specimens
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

from .cases import ENDS, GAUGE, GOOD_CURVES, THICKNESS, WIDTH, strip_doubts_of, strip_of_curves

A, P, F = "elongation-unit", "preload", "after-failure"
STILL, AT_LIMIT, SLACK = "gauge-still", "load-limit", "slack-strip"
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
    # The load rises by a fifth over the last two thousandths of the elongation, up to the end.
    *(([0.0, 2.0, still, 3.999, 4.0, 5.0], [0.0, 50.0, first, 90.0, 100.0, 100.0], 20, 4.0, name,
       f"rises from {first:.3g} to 100 N while the elongation stands still at 4 mm")
      for still, first, name in ((3.993, 79.0, STILL), (3.993, 81.0, ""), (3.991, 79.0, ""))),
    *(([0.0, 2.0, begin, 3.95, 4.0], [0.0, 50.0, first, 100.0, 100.0], 20, None, name,
       "exactly 100 N in 3 rows, over 3% of")
      for begin, first, name in ((3.9, 100.0, AT_LIMIT), (3.93, 100.0, ""), (3.9, 99.9, ""))),
    *(([0.0, begin, 2.0, 4.0], [0.0, load, 50.0, 100.0], 20, None, name, "at 11% of")
      for begin, load, name in ((0.44, 0.19, SLACK), (0.39, 0.19, ""), (0.44, 0.21, ""))),
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


def test_rows_of_a_failure_beyond_the_end_are_doubted_where_a_polynomial_takes_them():
    """It is fitted to all rows, of which those beyond the final length are no points."""
    elongation = np.array([0, 1, 2, 3, 4, 5.0])
    one = LoadCurve("bias", "1", elongation, np.array([0, 30, 60, 90, 95, 5.0]), None)
    strips = {"bias": Strip("bias", GAUGE, GAUGE + 3.0, None, (one,))}
    assert not strip_doubts_of(strips)
    (found,) = strip_doubts_of(strips, by_points=False)
    assert (found.name, found.sure) == ("after-failure", False)
    assert 'match = "points": the polynomial' in found.text


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


def test_modulus_is_doubted_although_a_row_goes_below_no_length():
    """An elongation of less than minus the gauge length, as of a gauge that fell off."""
    curve = strip_of_one_modulus("warp", 6010.0).curves[0]
    elongation = np.append(curve.elongation, -1.5 * GAUGE)
    load = np.append(curve.load, 0.0)
    load[:5] *= 0.5
    fallen = replace(curve, elongation=elongation, load=load)
    strip = replace(strip_of_one_modulus("warp", 1.0), curves=(fallen,))
    assert any("6.01e+03 MPa" in doubt.text for doubt in strip_doubts_of({"warp": strip}))


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


FACTORS = (1.0, 1.04, 0.97)
WIDE = Expected({"E1": (0.1, 5000.0), "E2": (0.1, 5000.0)})


def specimens(direction, factors=FACTORS):
    curve = GOOD_CURVES[direction]
    return [
        replace(curve, specimen=str(k), load=factor * curve.load)
        for k, factor in enumerate(factors, 1)
    ]


def strip_of(direction, curves):
    elongation = np.concatenate([curve.elongation for curve in curves])
    load = np.concatenate([curve.load for curve in curves])
    polynomial = fit_load_polynomial(elongation, load, 4)
    return Strip(direction, GAUGE, GAUGE + ENDS[direction], polynomial, tuple(curves))


def found(**curves):
    strips = {direction: strip_of(direction, of) for direction, of in curves.items()}
    return [(d.name, d.sure, d.text) for d in doubts_of_specimens(strips)]


def test_twins_that_differ_as_specimens_do_are_not_doubted():
    assert found(**{direction: specimens(direction) for direction in GOOD_CURVES}) == []


def test_curve_saved_three_times_is_refused():
    ((name, sure, text),) = found(warp=specimens("warp", (1.0, 1.0, 1.0)))
    assert (name, sure) == ("repeated-specimen", True)
    assert "warp, 1 and warp, 2 hold the same readings" in text


def test_curve_saved_again_with_fewer_digits_is_doubted():
    first = specimens("warp", (1.0,))[0]
    second = replace(first, specimen="2", load=np.round(first.load))
    ((name, sure, text),) = found(warp=[first, second])
    assert (name, sure) == ("repeated-specimen", False) and "saved several times" in text


@pytest.mark.parametrize(("direction", "other"), [("warp", "fill"), ("warp", "bias")])
def test_exchanged_labels_are_named(direction, other):
    right, wrong = specimens(direction), specimens(other)
    right[1], wrong[1] = wrong[1], right[1]
    doubts = found(**{direction: right, other: wrong})
    assert {name for name, _, _ in doubts} == {"odd-specimen"}
    texts = " ".join(text for _, _, text in doubts)
    assert f"{direction}, 2" in texts and f"like those of the {other}" in texts


def test_slip_without_a_drop_is_named():
    curves = specimens("warp")
    slipped = curves[2].elongation + np.where(np.arange(60) > 20, 1.0, 0.0)
    curves[2] = replace(curves[2], elongation=slipped)
    ((name, sure, text),) = found(warp=curves)
    assert (name, sure) == ("odd-specimen", False) and "warp, 3" in text


def test_of_two_specimens_that_differ_both_are_named():
    ((name, _, text),) = found(warp=specimens("warp", (1.0, 0.5)))
    assert name == "odd-specimen" and "warp, 1 and warp, 2 differ by 33%" in text


@pytest.mark.parametrize(("factor", "unit"), [(9.81, "kgf"), (4.45, "lbf"), (1000.0, "kN")])
def test_force_in_another_unit_under_a_heading_of_newtons_is_doubted(factor, unit):
    # A stiff fabric within wide bounds of its moduli.
    curves = [replace(c, load=0.55 * c.load / factor) for c in specimens("warp")]
    wide = strip_doubts_of({"warp": strip_of("warp", curves)}, expected=WIDE)
    texts = [d.text for d in wide if d.name == "force-unit"]
    assert len(texts) == 3 and all(f"if they are {unit}" in text for text in texts)
    good = strip_doubts_of({"warp": strip_of("warp", specimens("warp"))}, expected=WIDE)
    assert [d.name for d in good] == []
