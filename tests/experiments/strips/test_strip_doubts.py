"""Traps made from good load curves are named; good ones raise no doubt."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.doubts import curves_of, doubts_of_strips
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

GAUGE, WIDTH, THICKNESS = 20.0, 25.0, 0.8
EXPECTED = Expected({"E1": (300.0, 1500.0), "E2": (100.0, 600.0), "G12": (5.0, 60.0)})
MODULI = {"warp": 700.0, "fill": 300.0, "bias": 40.0}
ENDS = {"warp": 3.0, "fill": 5.0, "bias": 10.0}


def curve(direction: str) -> LoadCurve:
    elongation = np.linspace(0.0, ENDS[direction], 60)
    strain = np.log1p(elongation / GAUGE)
    load = MODULI[direction] * WIDTH * THICKNESS * strain * (1 - 0.5 * strain)
    noise = np.random.default_rng(5).normal(0, 1.0, 60)
    return LoadCurve(direction, "1", elongation, load + noise, None)


def strip(one: LoadCurve, end: float | None = None) -> Strip:
    length = ENDS[one.direction] if end is None else end
    polynomial = fit_load_polynomial(one.elongation, one.load, 4)
    return Strip(one.direction, GAUGE, GAUGE + length, polynomial, (one, one))


GOOD = {direction: curve(direction) for direction in MODULI}
WARP, FILL = GOOD["warp"], GOOD["fill"]


def doubts(strips, thickness=THICKNESS, expected=EXPECTED, grips=75.0):
    return list(doubts_of_strips(strips, WIDTH, thickness, expected, grips))


def names(curves, **ends):
    return {d.name: d for d in doubts({d: strip(c, ends.get(d)) for d, c in curves.items()})}


def changed(direction: str, **parts):
    return {**GOOD, direction: replace(GOOD[direction], **parts)}


STILL = np.minimum(GOOD["bias"].elongation, 7.0)
BROKEN = changed("fill", load=FILL.load * np.where(np.arange(60) < 50, 1.0, 0.2))
TRAPS = {
    "percent for mm": (
        changed("bias", elongation=100 * GOOD["bias"].elongation / GAUGE),
        {"bias": 100 * ENDS["bias"] / GAUGE},
        ("elongation-unit", True, "not a strain"),
    ),
    "strain for mm": (
        changed("fill", elongation=FILL.elongation / GAUGE / 1000),
        {"fill": ENDS["fill"] / GAUGE / 1000},
        ("elongation-unit", True, "gauge lengths"),
    ),
    "kN for N": (changed("warp", load=WARP.load / 1000), {}, ("load-unit", True, "MPa")),
    "N/m for N": (
        changed("fill", load=FILL.load / (1e-3 * WIDTH)), {}, ("load-unit", True, "bounds of E2"),
    ),
    "preload": (
        changed("fill", load=FILL.load + 150.0), {}, ("preload", False, "fill, 1: the load"),
    ),
    "travel of the crosshead": (
        changed("warp", between_grips="Stroke"), {}, ("grip-travel", False, "'Stroke'"),
    ),
    "extensometer taken off": (
        changed("bias", elongation=STILL), {"bias": 7.0}, ("gauge-still", True, "at 7 mm"),
    ),
    "rows after failure": (BROKEN, {}, ("after-failure", True, "falls from")),
    "warp and fill swapped": (
        {**GOOD, "warp": replace(FILL, direction="warp"), "fill": replace(WARP, direction="fill")},
        {"warp": ENDS["fill"], "fill": ENDS["warp"]},
        ("swapped", False, "swapped"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_named(trap):
    curves, ends, (name, sure, words) = TRAPS[trap]
    found = names(curves, **ends)
    assert found[name].sure == sure and words in found[name].text, list(found)
    assert {d.name for d in found.values() if d.sure} <= {name, "load-unit"}


def test_good_curves_raise_no_doubt():
    assert not names(GOOD)
    # Rows after failure beyond the final length are none.
    assert not names(BROKEN, fill=4.0)
    # A curve known by its polynomial is looked at too.
    whole = {d: replace(strip(c), curves=()) for d, c in GOOD.items()}
    assert not doubts(whole)
    assert {d.name for d in doubts(whole, 100 * THICKNESS)} == {"load-unit"}


A, P, F = "elongation-unit", "preload", "after-failure"
#: Elongation, load; where the gauge ends; the doubt and its numbers.
NEAR = [
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


@pytest.mark.parametrize(("elongation", "load", "gauge", "end", "name", "words"), NEAR)
def test_just_below_each_limit_and_at_it(elongation, load, gauge, end, name, words):
    """On one bias strip, which no modulus is held against."""
    one = LoadCurve("bias", "B1", np.array(elongation), np.array(load, float), None)
    length = gauge + (elongation[-1] if end is None else end)
    found = doubts({"bias": Strip("bias", gauge, length, None, (one,))})
    assert [d.name for d in found] == [name] * bool(name)
    assert all(words in d.text for d in found)


@pytest.mark.parametrize(("grips", "words"), [(75.0, "about 27% of"), (20.0, "by the slip in")])
def test_what_the_travel_of_the_machine_does_to_a_modulus(grips, words):
    curves = {d: replace(c, between_grips="Standardweg") for d, c in GOOD.items()}
    found = doubts({d: strip(c) for d, c in curves.items()}, grips=grips)
    assert [(d.name, d.sure) for d in found] == [("grip-travel", False)] * 3
    for doubt, modulus in zip(found, ("E1", "E2", "G12"), strict=True):
        assert words in doubt.text and modulus in doubt.text and "'Standardweg'" in doubt.text
        assert ("gauge_length" in doubt.text) == (grips > 20.0)


def test_an_extensometer_that_stands_still_within_the_gauge():
    good = GOOD["bias"]
    for at, end, doubt in ((9.4, 9.4, 0), (7.0, 7.0, 1), (7.0, 6.9, 0)):
        one = replace(good, elongation=np.minimum(good.elongation, at))
        found = doubts({"bias": strip(one, end)})
        assert {d.name for d in found} == set(["gauge-still"] * doubt)


@pytest.mark.parametrize(("low", "sure"), [(89.0, False), (70.0, False), (69.9, True)])
def test_a_load_that_falls_may_be_a_failure(low, sure):
    one = LoadCurve("bias", "1", np.array([0, 2, 3, 4.0]), np.array([0, 50, 100, low]), None)
    (found,) = doubts({"bias": Strip("bias", GAUGE, GAUGE + 4.0, None, (one,))})
    assert (found.name, found.sure) == ("after-failure", sure)
    assert "until_largest_load" in found.text
    cut = Strip("bias", GAUGE, GAUGE + 3.0, None, (one.until_largest_load(),))
    assert not doubts({"bias": cut})
    # One that falls slowly at first has failed all the same.
    one = replace(one, load=np.array([0, 100, 85, low]))
    assert doubts({"bias": Strip("bias", GAUGE, GAUGE + 4.0, None, (one,))})[0].sure == sure


def line(direction: str, modulus: float) -> Strip:
    """Of one modulus in log strain, 20 mm long, 25 mm wide, 0.8 mm thick."""
    elongation = np.linspace(0.0, 4.0, 41)
    load = modulus * WIDTH * THICKNESS * np.log1p(elongation / GAUGE)
    return Strip(direction, GAUGE, 24.0, None, (LoadCurve(direction, "1", elongation, load, None),))


@pytest.mark.parametrize(
    ("direction", "modulus", "words"),
    [
        ("warp", 74.9, "74.9 MPa, and the bounds of E1 are 300 to 1.5e+03"),
        ("warp", 75.1, ""),
        ("warp", 5990.0, ""),
        ("warp", 6010.0, "6.01e+03 MPa, and the bounds of E1 are 300 to 1.5e+03"),
        ("fill", 24.9, "24.9 MPa, and the bounds of E2 are 100 to 600"),
        ("bias", 1e5, ""),
    ],
)
def test_a_modulus_far_from_its_bounds(direction, modulus, words):
    own = {direction: line(direction, modulus)}
    found = doubts(own)
    assert len(found) == bool(words) and all(words in d.text for d in found)
    assert not doubts(own, expected=Expected({}))


def test_the_modulus_is_taken_half_way():
    """At half of the last log strain, as the median of five rows: elsewhere the curve may lie."""
    good = line("warp", 700.0).curves[0]
    load = 100.0 * good.load
    middle = int(np.argmin(np.abs(np.log1p(good.elongation / GAUGE) - 0.5 * np.log(1.2))))
    load[middle - 1 : middle + 2] = good.load[middle - 1 : middle + 2]
    strip = replace(line("warp", 1.0), curves=(replace(good, load=load),))
    assert not doubts({"warp": strip})
    load[middle - 1] *= 100.0
    assert doubts({"warp": strip})


@pytest.mark.parametrize(("fill", "doubt"), [(459.0, 0), (461.0, 1)])
def test_a_fill_that_is_stiffer_than_the_warp(fill, doubt):
    both = {"warp": line("warp", 400.0), "fill": line("fill", fill)}
    found = doubts(both)
    assert [(d.name, d.sure) for d in found] == [("swapped", False)] * doubt
    assert all(f"{fill:.3g} MPa, the warp's 400 MPa" in d.text for d in found)
    assert not doubts({"fill": both["fill"]})
    assert not doubts({**both, "warp": replace(both["warp"], curves=())})


def test_a_polynomial_is_looked_at_in_fifty_places():
    u = np.linspace(0, 4, 9)
    strip = replace(line("warp", 1.0), curves=(), polynomial=fit_load_polynomial(u, 3.0 * u, 1))
    ((name, elongation, load),) = curves_of(strip)
    assert (name, len(elongation), elongation[-1]) == ("", 50, 4.0)
    assert load == pytest.approx(3.0 * elongation, abs=1e-9)
    assert curves_of(replace(strip, polynomial=None)) == []
