"""Designers' constants: both forms, least squares on computed paths, and of laws."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from bubblefit.materials.designers import (
    POINTS,
    RATIOS,
    DesignersConstants,
    LinearPath,
    Options,
    constants_of_law,
    evaluate,
    every_option,
    line_of,
    shares,
)
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st

from ...biaxial_files import BENT, THICKNESS
from ...complaints import complaint_with

#: Published for a glass/PTFE fabric with free Poisson's ratios (test T2, 2 to 30 kN/m).
FREE = DesignersConstants(1188.0, 864.0, 0.73, 0.69)
RECIPROCAL = DesignersConstants.of_stiffness([[1000.0, 400.0], [400.0, 800.0]])


def paths(constants: DesignersConstants, ratios=RATIOS, offset=0.0) -> list[LinearPath]:
    found = []
    for ratio in ratios:
        load = np.outer(np.linspace(2, 30, 15), shares(ratio))
        found.append(line_of(ratio, load, constants.strain(load) + offset))
    return found


def test_the_direct_form_is_the_inverse_of_the_other():
    c = RECIPROCAL
    got = (c.warp, c.fill, c.nu_warp, c.nu_fill)
    np.testing.assert_allclose(got, (800.0, 640.0, 0.4, 0.5), rtol=1e-9)
    np.testing.assert_allclose(c.stiffness, [[1000, 400], [400, 800]], rtol=1e-12)
    np.testing.assert_allclose(c.compliance @ c.stiffness, np.eye(2), atol=1e-12)
    assert c.reciprocal and c.stable and not FREE.reciprocal and FREE.stable


def test_nu_warp_is_how_much_the_warp_contracts_when_the_fill_is_pulled():
    strain = FREE.strain([[0.0, 10.0], [10.0, 0.0]])
    assert strain[0, 0] / strain[0, 1] == pytest.approx(-0.73)
    assert strain[1, 1] / strain[1, 0] == pytest.approx(-0.69)
    assert strain[0, 1] == pytest.approx(10 / 864) and strain[1, 0] == pytest.approx(10 / 1188)


@pytest.mark.parametrize("options", every_option(paths(RECIPROCAL)), ids=str)
def test_every_option_finds_the_constants_of_computed_paths(options):
    found = evaluate(paths(RECIPROCAL, offset=0.013), options)
    got, wanted = (dataclasses.astuple(c)[:4] for c in (found.constants, RECIPROCAL))
    np.testing.assert_allclose(got, wanted, rtol=1e-9)
    assert found.squares < 1e-20 and max(found.rms.values()) < 1e-10


@settings(max_examples=40, deadline=None)
@given(
    stiffness=st.tuples(st.floats(50, 5000), st.floats(50, 5000)),
    share=st.tuples(st.floats(-0.3, 0.9), st.floats(-0.3, 0.9)),
)
def test_free_constants_are_found_whatever_they_are(stiffness, share):
    a, b = stiffness
    c = DesignersConstants(a, b, share[0] * np.sqrt(b / a), share[1] * np.sqrt(a / b))
    for options in (Options(True, False), Options(False, False), Options(True, False, "load")):
        found = evaluate(paths(c), options).constants
        got, wanted = dataclasses.astuple(found)[:4], dataclasses.astuple(c)[:4]
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)


def test_which_paths_count_and_their_squares():
    lines = paths(FREE)
    counts = {
        (o.unloaded, o.ratios): evaluate(lines, o).paths
        for o in every_option(lines) if o.minimise == "strain" and o.reciprocal
    }  # fmt: skip
    assert counts == {
        (False, ()): 8, (True, ()): 10, (False, ("1:1", "1:2")): 4, (False, ("1:1", "2:1")): 4,
        (False, ("1:1", "2:1", "1:2")): 6,
    }  # fmt: skip
    # Least squares: nothing near by leaves less; and the sum is that of its definition.
    best = evaluate(lines, Options())
    shares = np.arange(1, POINTS + 1) / POINTS
    for ratio, load, strain in ((p.ratio, p.load, p.strain) for p in lines):
        own = 100 * (strain - best.constants.strain(load))
        off = np.outer(shares, own)
        assert best.rms[ratio] == pytest.approx(np.sqrt(np.mean(off**2)))

    def squares(constants):
        total = 0.0
        for path in lines:
            own = 100 * (path.strain - constants.strain(path.load))
            for yarn, unloaded in enumerate(path.unloaded):
                total += 0.0 if unloaded else float((shares**2).sum()) * own[yarn] ** 2
        return total

    assert best.squares == pytest.approx(squares(best.constants))
    c = best.constants.compliance
    for step in (np.diag([1e-6, 0]), np.diag([0, 1e-6]), np.array([[0, 1e-6], [1e-6, 0]])):
        for sign in (1, -1):
            near = DesignersConstants.of_compliance(c + sign * step)
            assert squares(near) > best.squares


def test_reciprocity_costs_squares_and_is_kept():
    lines = paths(FREE)
    tied, free = evaluate(lines, Options()), evaluate(lines, Options(reciprocal=False))
    assert tied.constants.reciprocal and not free.constants.reciprocal
    assert tied.squares > free.squares + 0.1


def test_a_line_goes_by_least_squares_and_tells_what_it_leaves():
    load = np.outer(np.linspace(2, 12, 11), [1.0, 0.5])
    wave = 1e-4 * np.cos(np.pi * np.arange(11))
    line = line_of("2:1", load, FREE.strain(load) + np.column_stack([wave, 0 * wave]))
    wanted = FREE.strain(load[-1:] - load[:1])[0]
    np.testing.assert_allclose(line.load, [10.0, 5.0])
    np.testing.assert_allclose(line.strain, wanted, atol=2e-6)
    np.testing.assert_allclose(line.residual, [1e-4, 0.0], rtol=0.02, atol=1e-15)
    assert line.unloaded == (False, False) and paths(FREE, ("1:0",))[0].unloaded == (False, True)


def test_paths_that_settle_no_constants_are_refused():
    complaint_with(["two that differ"], evaluate, paths(FREE, ("1:1",)), Options())
    complaint_with(["two that differ"], evaluate, paths(FREE), Options(ratios=("3:1",)))
    complaint_with(["do not change"], line_of, "1:1", np.ones((3, 2)), np.zeros((3, 2)))
    complaint_with(["get shorter"], DesignersConstants.of_compliance, -np.eye(2))
    complaint_with(["no inverse"], DesignersConstants.of_stiffness, [[1, 2], [2, 1]])
    unstable = DesignersConstants(1000, 1000, 1.2, 1.1)
    assert not unstable.stable
    complaint_with(["1.32", "below 1"], lambda: unstable.stiffness)


# --- of laws ------------------------------------------------------------------------------------


def test_a_linear_law_gives_its_own_constants_at_small_loads():
    law = HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24)
    found = constants_of_law(law, THICKNESS, 0.0, 1e-3, 0.1)
    c = found.constants
    got = (c.warp, c.fill, c.nu_fill, c.nu_warp, c.shear)
    np.testing.assert_allclose(got, (800, 640, 0.24, 0.24 * 0.8, 24.0), rtol=1e-5)
    assert found.rms < 1e-7 and found.shear == (24.0, 24.0)


def test_what_is_lost_of_a_bent_law_is_told_by_ratio():
    found = constants_of_law(BENT, THICKNESS, 2.0, 25.0, 0.1)
    assert list(found.lost) == list(RATIOS)
    assert 0.005 < min(found.lost.values()) and max(found.lost.values()) < 0.1
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(list(found.lost.values())))))
    assert 1.0 < found.largest["1:0"] < 5.0
    assert len(found.others) == 10 and found.evaluation.options == Options()
    bent = HypoelasticLaw([0, 0, 100.0, 30, *BENT.beta[4:]], 0.24, [0.07, 0.07, 0.1])
    own = constants_of_law(bent, THICKNESS, 2.0, 25.0, 0.1)
    assert own.constants.shear == pytest.approx(THICKNESS * 35.0)
    assert own.shear == pytest.approx((THICKNESS * 30.0, THICKNESS * 40.0))


def test_loads_that_a_law_does_not_carry_are_refused():
    complaint_with(["increase", "5 to 2"], constants_of_law, BENT, THICKNESS, 5.0, 2.0, 0.1)
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    complaint_with(["carries no more", "lower"], constants_of_law, falling, THICKNESS, 0, 90, 0.1)
