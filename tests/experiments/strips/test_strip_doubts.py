"""Traps made from good load curves are named; good ones raise no doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.data.curves import LoadCurve
from bubblefit.data.load_polynomials import fit_load_polynomial
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.strips.doubts import doubts_of_strips
from bubblefit.experiments.strips.strip import Strip

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
