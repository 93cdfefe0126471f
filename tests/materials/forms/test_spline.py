"""materials/forms/spline.py: splines and tri-linear moduli."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, ORDER, form_named
from bubblefit.materials.forms.polynomial import CUBIC, LINEAR
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from scipy.interpolate import CubicSpline

from ...builders.fortran import BREAKS, MODULI
from ...builders.laws import TABLE_4_2
from ...support.refusals import complaint
from ..cases import FORM_KNOTS, LAW_OF_FORM, NO_RANGE

CUBIC_BETA = 1e3 * np.array(TABLE_4_2)
FORM_RANGE = [0.11, 0.12, 0.13]


def test_spline_is_the_not_a_knot_spline_through_its_values():
    law, start = LAW_OF_FORM["spline"], 0
    for modulus in ORDER:
        knots, end = FORM_KNOTS[COMPONENTS[modulus]], FORM_RANGE[COMPONENTS[modulus]]
        values = law.beta[start : start + len(knots)]
        start += len(knots)
        strain = np.linspace(0, min(end, knots[-1]), 300)
        expected = CubicSpline(knots, values)(strain)
        assert law.modulus(modulus, strain) == pytest.approx(expected, rel=1e-11)
        inside = [knot for knot in knots if knot <= end]
        assert law.modulus(modulus, inside) == pytest.approx(values[: len(inside)], rel=1e-12)
    assert not law.jumps and LAW_OF_FORM["trilinear"].jumps


def test_spline_of_four_knots_or_more_contains_any_cubic():
    cubic = HypoelasticLaw(CUBIC_BETA, strain_range=FORM_RANGE)
    for count in (4, 5, 9, 20):
        form = form_named("spline", {"knots": count}, FORM_RANGE)
        assert form.size == 3 * count
        assert form.labels[0] == "G12 at 0.000" and form.labels[-1] == "E1 at 0.110"
        beta = [cubic.modulus(m, form.knots[COMPONENTS[m]]) for m in ORDER]
        law = HypoelasticLaw(np.ravel(beta), strain_range=FORM_RANGE, form=form)
        strain = np.linspace(-0.05, 0.2, 99)
        for modulus in ORDER:
            same = pytest.approx(cubic.modulus(modulus, strain), rel=1e-9)
            assert law.modulus(modulus, strain) == same


def test_spline_of_two_knots_is_a_line_and_held_beyond_the_last():
    form = Spline.at([[0.0, 0.1], [0.0, 0.05, 0.1], [0.0, 0.1]])
    law = HypoelasticLaw(np.array([10.0, 20, 100, 150, 100, 300, 500]), form=form)
    assert law.E1([0.0, 0.05, 0.1, 0.7]) == pytest.approx([300, 400, 500, 500])
    assert law.E2([0.025, 0.05, 3.0]) == pytest.approx([137.5, 150, 100])
    assert law.G12([-0.05, -0.2]) == pytest.approx([15, 20])


def test_number_of_knots_requires_a_strain_range():
    assert "strain range" in complaint(form_named, "spline", {"knots": 4}, NO_RANGE)
    mixed = {"knots": {"warp": [0.0, 0.05, 0.11], "fill": 4, "shear": 2}}
    assert form_named("spline", mixed, FORM_RANGE).size == 9
    same = form_named("spline", {"knots": [0.0, 0.05, 0.1]}, NO_RANGE)
    assert same.knots == ((0.0, 0.05, 0.1),) * 3
    surplus = np.array([1.0, 2.0, *CUBIC_BETA[2:4]] + [0.0, 0.0, 1.0, 1.0] * 2)
    assert "beta_0, beta_1" in complaint(HypoelasticLaw, surplus, form=LINEAR)
    assert "expected 13" in complaint(HypoelasticLaw, CUBIC_BETA, form=LAW_OF_FORM["spline"].form)


WARP_MODULUS, FILL_MODULUS, SHEAR_MODULUS, NU = 300.0, 220.0, 5.0, 0.24
CONSTANT_LAW = HypoelasticLaw.linear(WARP_MODULUS, FILL_MODULUS, SHEAR_MODULUS, NU)
TRILINEAR_LAW = HypoelasticLaw.trilinear(*MODULI, BREAKS, NU)
VALUES = dict(zip(("E1", "E2", "G12"), MODULI, strict=True))


def test_trilinear_law_has_steps_at_its_breaks():
    assert list(TRILINEAR_LAW.beta) == [0, 40, 14, 20, 0, 240, 110, 140, 0, 900, 450, 800]
    assert (
        TRILINEAR_LAW.form.name == "trilinear"
        and TRILINEAR_LAW.with_beta(2 * TRILINEAR_LAW.beta).form == TRILINEAR_LAW.form
    )
    assert HypoelasticLaw(TRILINEAR_LAW.beta).form == CUBIC
    assert TRILINEAR_LAW.jumps and not HypoelasticLaw(TRILINEAR_LAW.beta).jumps
    assert CONSTANT_LAW.with_beta(2 * CONSTANT_LAW.beta).nu12 == CONSTANT_LAW.nu12
    for array in (
        TRILINEAR_LAW.form.breaks,
        TRILINEAR_LAW.pieces,
        TRILINEAR_LAW.beta,
        CONSTANT_LAW.beta,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[:1] = 1.0
    for name, (a, b) in zip(COMPONENTS, BREAKS, strict=True):
        low, *_ = VALUES[name]
        strains = np.array(
            [[0.0, 0.5 * a, a], [1.0001 * a, 0.5 * (a + b), b], [1.0001 * b, 0.3, 5]]
        )
        expected = np.repeat(np.transpose([VALUES[name]]), 3, axis=1)
        assert (TRILINEAR_LAW.modulus(name, strains) == expected).all()
        assert (TRILINEAR_LAW.modulus(name, -strains) == (expected if name == "G12" else low)).all()
    stress, tangent = TRILINEAR_LAW.increment(np.zeros(3), [0.01, np.nan, 0.0], np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()
    law = HypoelasticLaw.trilinear(MODULI[0], (140.0, -300.0, 240.0), MODULI[2], BREAKS, NU)
    assert np.isfinite(law.increment(np.zeros(3), [0.0, 0.02, 0.0], np.zeros(3))[0]).all()
    assert np.isnan(law.increment(np.zeros(3), [0.0, 0.05, 0.0], np.zeros(3))[0]).all()


BAD_BREAKS = [
    np.zeros((3, 2)), [[0.03, 0.01]] * 3, [[0.01, 0.01]] * 3, [[-0.01, 0.01]] * 3,
    [[0.01, np.inf]] * 3, [[0.01, np.nan]] * 3, [[0.01, 0.02]] * 2, [0.01, 0.02],
    [[0.01, 0.02], [0.01], [0.01, 0.02]], "none",
]  # fmt: skip


@pytest.mark.parametrize("breaks", BAD_BREAKS)
def test_bad_breaks_are_refused(breaks):
    assert "breaks" in complaint(HypoelasticLaw.trilinear, *MODULI, breaks)
