"""Traps made from good load curves are named; good ones raise no doubt."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.kinds import Expected
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.doubts import curves_of, doubts_of_strips
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

GAUGE, WIDTH, THICKNESS = 20.0, 25.0, 0.8
EXPECTED = Expected({"E1": (300.0, 1500.0), "E2": (100.0, 600.0), "G12": (5.0, 60.0)})
MODULI = {"warp": 700.0, "fill": 300.0, "bias": 40.0}
ENDS = {"warp": 3.0, "fill": 5.0, "bias": 10.0}


def curve(direction: str, specimen: str = "1") -> LoadCurve:
    elongation = np.linspace(0.0, ENDS[direction], 60)
    strain = np.log1p(elongation / GAUGE)
    load = MODULI[direction] * WIDTH * THICKNESS * strain * (1 - 0.5 * strain)
    rng = np.random.default_rng(5)
    return LoadCurve(direction, specimen, elongation, load + rng.normal(0, 1.0, 60), None)


def strip(one: LoadCurve, end: float | None = None) -> Strip:
    length = ENDS[one.direction] if end is None else end
    polynomial = fit_load_polynomial(one.elongation, one.load, 4)
    return Strip(one.direction, GAUGE, GAUGE + length, polynomial, (one, one))


GOOD = {direction: curve(direction) for direction in MODULI}


def names(curves, **ends):
    strips = {d: strip(c, ends.get(d)) for d, c in curves.items()}
    found = doubts_of_strips(strips, WIDTH, THICKNESS, EXPECTED)
    return {doubt.name: doubt for doubt in found}


def changed(direction: str, **parts):
    return {**GOOD, direction: replace(GOOD[direction], **parts)}


def broken() -> LoadCurve:
    load = GOOD["fill"].load.copy()
    load[50:] *= 0.2
    return replace(GOOD["fill"], load=load)


WARP, FILL = GOOD["warp"], GOOD["fill"]
TRAPS = {
    "percent for mm": (
        changed("bias", elongation=100 * GOOD["bias"].elongation / GAUGE),
        {"bias": 100 * ENDS["bias"] / GAUGE},
        ("elongation-unit", True, "not a strain"),
    ),
    "strain for mm": (
        changed("fill", elongation=FILL.elongation / GAUGE / 1000, load=FILL.load),
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
    "rows after failure": ({**GOOD, "fill": broken()}, {}, ("after-failure", True, "falls from")),
    "warp and fill swapped": (
        {
            "warp": replace(GOOD["fill"], direction="warp"),
            "fill": replace(GOOD["warp"], direction="fill"),
        },
        {"warp": ENDS["fill"], "fill": ENDS["warp"]},
        ("swapped", False, "swapped"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_named(trap):
    curves, ends, (name, sure, words) = TRAPS[trap]
    found = names(curves, **ends)
    assert name in found, (trap, list(found))
    assert found[name].sure == sure and words in found[name].text, found[name].text
    assert {d.name for d in found.values() if d.sure} <= {name, "load-unit"}


def test_good_curves_raise_no_doubt():
    assert not names(GOOD)


def test_rows_after_failure_beyond_the_final_length_are_no_doubt():
    assert not names({**GOOD, "fill": broken()}, fill=4.0)


def test_a_curve_known_by_its_polynomial_is_looked_at_too():
    whole = {d: strip(c) for d, c in GOOD.items()}
    assert not doubts_of_strips(
        {d: replace(s, curves=()) for d, s in whole.items()}, WIDTH, THICKNESS, EXPECTED
    )
    found = doubts_of_strips(
        {d: replace(s, curves=()) for d, s in whole.items()}, WIDTH, 100 * THICKNESS, EXPECTED
    )
    assert {d.name for d in found} == {"load-unit"}


# Just below each limit and at it, and what is said to the last word


def made(
    elongation: list[float], load: list[float], end: float | None = None, gauge: float = 20.0
) -> dict[str, str]:
    """Names and words on one bias strip, which no modulus is held against."""
    one = LoadCurve("bias", "B1", np.array(elongation), np.array(load), None)
    length = gauge + (one.elongation[-1] if end is None else end)
    found = doubts_of_strips(
        {"bias": Strip("bias", gauge, length, None, (one,))}, WIDTH, THICKNESS, EXPECTED
    )
    return {doubt.name: doubt.text for doubt in found}


@pytest.mark.parametrize(
    ("gauge", "end", "doubt"), [(500.0, 1.0, 1), (500.0, 1.01, 0), (2.0, 2.99, 0), (2.0, 3.0, 1)]
)
def test_where_a_curve_ends(gauge, end, doubt):
    words = (
        f"bias, B1: the curve ends at an elongation of {end / gauge:.3g} gauge lengths: is it a "
        "length in the unit that is said (not percent, not a strain), and is the gauge length "
        "right?"
    )
    found = made([0.0, 0.5 * end, end], [0.0, 50.0, 100.0], gauge=gauge)
    assert found == {"elongation-unit": words} if doubt else found == {}


@pytest.mark.parametrize(("level", "doubt"), [(4.9, 0), (5.0, 1), (-5.0, 1), (-4.9, 0)])
def test_a_load_where_nothing_is_elongated(level, doubt):
    """The median of what lies within a hundredth of the elongation, on either side."""
    words = (
        f"bias, B1: the load is {level:.3g} N ({level / 100:.0%} of the largest) where the curve "
        "begins: a preload, or a zero that was not set; begin the elongation where the load does"
    )
    found = made([-0.04, 0.0, 0.04, 2.0, 4.0], [90.0, level, -90.0, 60.0, 100.0])
    assert found == {"preload": words} if doubt else found == {}
    # The curve begins where the strip is elongated already.
    assert made([0.0401, 2.0, 4.0], [level, 60.0, 100.0]) == {}
    assert made([0.0, 2.0, 4.0], [level - 200, -100.0, 0.0]) == {}


@pytest.mark.parametrize(("low", "doubt"), [(70.0, 0), (69.9, 1)])
def test_a_load_that_falls(low, doubt):
    words = (
        f"bias, B1: the load falls from 100 to {low:.3g} N at an elongation of 3 mm: rows after "
        "failure; cut them off, or say a shorter final_length"
    )
    found = made([0.0, 2.0, 3.0, 4.0], [0.0, 100.0, low, 20.0], end=3.0)
    assert found == {"after-failure": words} if doubt else found == {}
    # In the first half of the way it is an early slip, and beyond the end nobody asks.
    assert made([0.0, 1.0, 2.0, 4.0], [0.0, 100.0, low - 60, 200.0]) == {}
    assert made([0.0, 2.0, 3.0, 4.0], [0.0, 100.0, low - 60, 20.0], end=2.99) == {}


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
    found = doubts_of_strips({direction: line(direction, modulus)}, WIDTH, THICKNESS, EXPECTED)
    text = (
        f"{direction}, 1: load over strain is a modulus of about {words}: are load and elongation "
        "in the units that are said, and are width and thickness right?"
    )
    assert [d.text for d in found] == [text] * bool(words)
    assert not doubts_of_strips(
        {direction: line(direction, modulus)}, WIDTH, THICKNESS, Expected({})
    )


def test_the_modulus_is_taken_half_way():
    """At half of the last log strain, as the median of five rows: elsewhere the curve may lie."""
    good = line("warp", 700.0).curves[0]
    load = 100.0 * good.load
    middle = int(np.argmin(np.abs(np.log1p(good.elongation / GAUGE) - 0.5 * np.log(1.2))))
    load[middle - 1 : middle + 2] = good.load[middle - 1 : middle + 2]
    strip = replace(line("warp", 1.0), curves=(replace(good, load=load),))
    assert not doubts_of_strips({"warp": strip}, WIDTH, THICKNESS, EXPECTED)
    load[middle - 1] *= 100.0
    assert doubts_of_strips({"warp": strip}, WIDTH, THICKNESS, EXPECTED)


@pytest.mark.parametrize(("fill", "doubt"), [(459.0, 0), (461.0, 1)])
def test_a_fill_that_is_stiffer_than_the_warp(fill, doubt):
    both = {"warp": line("warp", 400.0), "fill": line("fill", fill)}
    words = (
        f"the fill's modulus is about {fill:.3g} MPa, the warp's 400 MPa, and the bounds have the "
        "warp stiffer: warp and fill seem to be swapped"
    )
    found = doubts_of_strips(both, WIDTH, THICKNESS, EXPECTED)
    assert [(d.name, d.sure, d.text) for d in found] == [("swapped", False, words)] * doubt
    assert not doubts_of_strips({"fill": both["fill"]}, WIDTH, THICKNESS, EXPECTED)
    empty = {"warp": replace(both["warp"], curves=()), "fill": both["fill"]}
    assert not doubts_of_strips(empty, WIDTH, THICKNESS, EXPECTED)


def test_a_polynomial_is_looked_at_in_fifty_places():
    strip = replace(line("warp", 1.0), curves=(), polynomial=fit_load_polynomial(
        np.linspace(0, 4, 9), 3.0 * np.linspace(0, 4, 9), 1))  # fmt: skip
    ((name, elongation, load),) = curves_of(strip)
    assert (name, len(elongation), elongation[-1]) == ("", 50, 4.0)
    assert load == pytest.approx(3.0 * elongation, abs=1e-9)
    assert curves_of(replace(strip, polynomial=None)) == []
