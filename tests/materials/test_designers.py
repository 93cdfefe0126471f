"""materials/designers.py: designers' constants of load paths and of a law."""

import dataclasses

import numpy as np
import pytest
from bubblefit.materials.designers import (
    RATIOS,
    SHARES,
    DesignersConstants,
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

from ..builders.biaxial_tests import BENT_LAW, THICKNESS
from ..support.refusals import complaint_with

#: Published for a glass/PTFE fabric with free Poisson's ratios (test T2, 2 to 30 kN/m).
FREE = DesignersConstants(1188.0, 864.0, 0.73, 0.69)
FALLING = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
RECIPROCAL = DesignersConstants.of_stiffness([[1000.0, 400.0], [400.0, 800.0]])


def paths(constants, ratios=RATIOS, offset=0.0):
    loads = {ratio: np.outer(np.linspace(2, 30, 15), shares(ratio)) for ratio in ratios}
    return [line_of(r, load, constants.strain(load) + offset) for r, load in loads.items()]


def test_stiffness_and_compliance_forms_are_inverse():
    c = RECIPROCAL
    got = (c.warp, c.fill, c.nu_warp, c.nu_fill)
    np.testing.assert_allclose(got, (800.0, 640.0, 0.4, 0.5), rtol=1e-9)
    np.testing.assert_allclose(c.stiffness, [[1000, 400], [400, 800]], rtol=1e-12)
    np.testing.assert_allclose(c.compliance @ c.stiffness, np.eye(2), atol=1e-12)
    assert c.reciprocal and c.stable and not FREE.reciprocal and FREE.stable
    # nu_warp is how much the warp contracts when the fill is pulled.
    strain = FREE.strain([[0.0, 10.0], [10.0, 0.0]])
    wanted = [[-0.73 * 10 / 864, 10 / 864], [10 / 1188, -0.69 * 10 / 1188]]
    np.testing.assert_allclose(strain, wanted, rtol=1e-6)


@pytest.mark.parametrize("options", every_option(paths(RECIPROCAL)), ids=str)
def test_options_find_the_constants_of_computed_paths(options):
    found = evaluate(paths(RECIPROCAL, offset=0.013), options)
    np.testing.assert_allclose(
        four_constants(found.constants), four_constants(RECIPROCAL), rtol=1e-9
    )
    assert found.squares < 1e-20 and max(found.rms.values()) < 1e-10


def four_constants(constants):
    return dataclasses.astuple(constants)[:4]


@settings(max_examples=40, deadline=None)
@given(*[st.floats(50, 5000)] * 2, *[st.floats(-0.3, 0.9)] * 2)
def test_any_free_constants_are_found(a, b, first, second):
    c = DesignersConstants(a, b, first * np.sqrt(b / a), second * np.sqrt(a / b))
    for options in (Options(True, False), Options(False, False), Options(True, False, "load")):
        found = evaluate(paths(c), options).constants
        np.testing.assert_allclose(four_constants(found), four_constants(c), rtol=1e-9, atol=1e-9)


def test_paths_counted_by_options_and_their_least_squares():
    lines = paths(FREE)
    counts = {
        (o.unloaded, o.ratios): evaluate(lines, o).paths
        for o in every_option(lines) if o.minimise == "strain" and o.reciprocal
    }  # fmt: skip
    assert counts == {
        (False, ()): 8, (True, ()): 10, (False, ("1:1", "1:2")): 4, (False, ("1:1", "2:1")): 4,
        (False, ("1:1", "2:1", "1:2")): 6,
    }  # fmt: skip

    def squares(constants):
        total = 0.0
        for path in lines:
            own = 100 * (path.strain - constants.strain(path.load))
            total += float((SHARES**2).sum()) * (own[~np.array(path.unloaded)] ** 2).sum()
        return total

    # Least squares: nothing near by leaves less; and the sum is that of its definition.
    best, free = evaluate(lines, Options()), evaluate(lines, Options(reciprocal=False))
    for path in lines:
        off = np.outer(SHARES, 100 * (path.strain - best.constants.strain(path.load)))
        assert best.rms[path.ratio] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert best.squares == pytest.approx(squares(best.constants))
    for step in (np.diag([1e-6, 0]), np.diag([0, 1e-6]), np.array([[0, 1e-6], [1e-6, 0]])):
        for near in (best.constants.compliance + step, best.constants.compliance - step):
            assert squares(DesignersConstants.of_compliance(near)) > best.squares
    assert best.constants.reciprocal and not free.constants.reciprocal
    assert best.squares > free.squares + 0.1


def test_paths_that_determine_no_constants_are_refused():
    unstable = DesignersConstants(1000, 1000, 1.2, 1.1)
    assert not unstable.stable
    for words, call, *values in (
        (["two that differ"], evaluate, paths(FREE, ("1:1",)), Options()),
        (["two that differ"], evaluate, paths(FREE), Options(ratios=("3:1",))),
        (["do not change"], line_of, "1:1", np.ones((3, 2)), np.zeros((3, 2))),
        (["get shorter"], DesignersConstants.of_compliance, -np.eye(2)),
        (["no inverse"], DesignersConstants.of_stiffness, [[1, 2], [2, 1]]),
        (["1.32", "below 1"], lambda: unstable.stiffness),
        (["increase", "5 to 2"], constants_of_law, BENT_LAW, THICKNESS, 5.0, 2.0, 0.1),
        (["carries no more", "lower"], constants_of_law, FALLING, THICKNESS, 0, 90, 0.1),
    ):
        complaint_with(words, call, *values)


def test_linearisation_error_of_a_bent_law_by_ratio():
    found = constants_of_law(BENT_LAW, THICKNESS, 2.0, 25.0, 0.1)
    assert list(found.misfit) == list(RATIOS)
    assert 0.005 < min(found.misfit.values()) and max(found.misfit.values()) < 0.1
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(list(found.misfit.values())))))
    assert 1.0 < found.largest["1:0"] < 5.0
    assert len(found.alternatives) == 10 and found.evaluation.options == Options()
    bent = HypoelasticLaw([0, 0, 100.0, 30, *BENT_LAW.beta[4:]], 0.24, [0.07, 0.07, 0.1])
    own = constants_of_law(bent, THICKNESS, 2.0, 25.0, 0.1)
    assert own.constants.shear == pytest.approx(THICKNESS * 35.0)
    assert own.shear == pytest.approx((THICKNESS * 30.0, THICKNESS * 40.0))


def test_line_is_fitted_by_least_squares_with_its_residual():
    load = np.outer(np.linspace(2, 12, 11), [1.0, 0.5])
    wave = 1e-4 * np.cos(np.pi * np.arange(11))
    line = line_of("2:1", load, FREE.strain(load) + np.column_stack([wave, 0 * wave]))
    np.testing.assert_allclose(line.load, [10.0, 5.0])
    np.testing.assert_allclose(line.strain, FREE.strain([[10.0, 5.0]])[0], atol=2e-6)
    np.testing.assert_allclose(line.residual, [1e-4, 0.0], rtol=0.02, atol=1e-15)
    assert line.unloaded == (False, False) and paths(FREE, ("1:0",))[0].unloaded == (False, True)
