"""experiments/strips/twins.py: specimens that are copies, mislabelled, slipped, or in kgf.

Sources: questions on mixed labels and on grips that slip in forums of test houses; kgf under a
heading of N in exports of machines that were set up for tensile strength in kgf/5cm.
"""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.twins import doubts_of_specimens
from bubblefit.readers.curves import fit_load_polynomial

from .cases import ENDS, GAUGE, GOOD_CURVES, strip_doubts_of

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
