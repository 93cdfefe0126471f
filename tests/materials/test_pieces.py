"""materials/pieces.py: the mean modulus of an increment, its derivatives and its rows."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, map_in_range
from bubblefit.materials.pieces import by_pieces, point_modulus
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from .cases import EVERY_FORM, STRAIN_LAW_OF_FORM, integral_of_modulus, mean_of, turning_points

names = st.sampled_from(sorted(COMPONENTS))
forms = st.sampled_from(sorted(STRAIN_LAW_OF_FORM))
strains = st.floats(-0.2, 0.2)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
@example("spline", "G12", 0.2, -0.2)
@example("trilinear", "E1", 0.03, 0.01)
def test_increment_modulus_is_the_mean_over_the_increment(form, name, x, x_old):
    law = STRAIN_LAW_OF_FORM[form]
    mean, ahead, behind = mean_of(form, name, x, x_old)
    assert mean == pytest.approx(mean_of(form, name, x_old, x)[0], rel=1e-14)
    assume(abs(x - x_old) > 1e-9)
    assert mean == pytest.approx(integral_of_modulus(law, name, x_old, x) / (x - x_old), rel=1e-9)
    # Whatever the path between the two ends is made of, the moduli there bound the mean.
    way = np.concatenate([np.linspace(x_old, x, 200), turning_points(law, name)])
    way = way[(way >= min(x, x_old)) & (way <= max(x, x_old))]
    moduli = law.modulus(name, way)
    room = 1e-3 * moduli.max()
    assert moduli.min() - room <= mean <= moduli.max() + room
    # d(stress)/d(strain) is the modulus at the end of the increment, but where it jumps.
    assume(x not in turning_points(law, name))
    assert mean + (x - x_old) * ahead == pytest.approx(float(law.modulus(name, x)), rel=1e-9)
    assume(x_old not in turning_points(law, name))  # there it may jump, and the way tells
    start = float(law.modulus(name, x_old))
    assert mean - (x - x_old) * behind == pytest.approx(start, rel=1e-9)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
def test_derivatives_of_increment_modulus_against_differences(form, name, x, x_old):
    law, step = STRAIN_LAW_OF_FORM[form], 1e-6
    assume(np.abs(np.subtract.outer([x, x_old], turning_points(law, name))).min() > 2 * step)
    assume(abs(x - x_old) > 1e-3)
    _, *slopes = mean_of(form, name, x, x_old)
    size = 1e-5 * float(law.pieces[COMPONENTS[name], 0, 4]) / abs(x - x_old)
    for slope, (by_new, by_old) in zip(slopes, ((step, 0.0), (0.0, step)), strict=True):
        ends = [mean_of(form, name, x + s * by_new, x_old + s * by_old)[0] for s in (1, -1)]
        assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4, abs=size)


@settings(deadline=None)
@given(forms, names, strains, st.sampled_from([0.0, 1e-18, -1e-15, 1e-13, 1e-10, -1e-8, 1e-7]))
@example("spline", "G12", 0.015625, 1e-7)
def test_increment_modulus_of_small_increments_loses_no_digits(form, name, x, change):
    law, component, step = STRAIN_LAW_OF_FORM[form], COMPONENTS[name], 1e-7
    assume(np.abs(x - turning_points(law, name)).min() > 1e-6)
    mean, *slopes = mean_of(form, name, x + change, x)
    gauss = x + change * (0.5 + np.array([-0.5, 0.5]) / np.sqrt(3))  # the mean of any cubic
    exact = np.mean([point_modulus(law.pieces, component, at) for at in gauss])
    assert mean == pytest.approx(exact, rel=1e-12)
    half = (law.modulus(name, x + step) - law.modulus(name, x - step)) / (4 * step)
    scale = 1e-9 * float(law.pieces[component, :, 4].max()) / step
    assert slopes == pytest.approx([half, half], rel=1e-4, abs=scale)


@settings(max_examples=200, deadline=None)
@given(forms, names, strains, strains)
@example("trilinear", "E1", 0.01, 0.01)
@example("trilinear", "E1", 0.01 + 1e-13, 0.01 - 1e-13)
@example("spline", "G12", 0.0, 0.0)
@example("cubic", "E2", 0.13, 0.13)
@example("cubic", "G12", -0.2, 0.15)
def test_rows_by_piece_are_derivatives_by_coefficients(form, name, x, x_old):
    law, component = STRAIN_LAW_OF_FORM[form], COMPONENTS[name]
    weights = np.full((law.pieces.shape[1], 4), np.nan)
    first, stop = by_pieces(law.pieces, component, x, x_old, weights)
    rows = map_in_range(law.form, law.strain_range)[component, first:stop]
    mean = mean_of(form, name, x, x_old)[0]
    assert weights[first:stop, 3].sum() == pytest.approx(1.0)
    by_beta = np.einsum("ki,kij->j", weights[first:stop], rows)
    assert by_beta @ law.beta == pytest.approx(mean, rel=1e-9)


@EVERY_FORM
@pytest.mark.parametrize("name", COMPONENTS)
def test_stress_is_continuous_where_a_piece_ends(form, name):
    law = STRAIN_LAW_OF_FORM[form]
    for at in turning_points(law, name):
        for old in (-0.17, 0.0, 0.005, 0.15):
            ends = (at - 1e-12, at, at + 1e-12)
            rises = [mean_of(form, name, x, old)[0] * (x - old) for x in ends]
            assert np.ptp(rises) < 3e-12 * law.modulus(name, np.linspace(0, 0.2, 99)).max()
    for bad in ((np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan), (np.nan, 0.5)):
        assert np.isnan(mean_of(form, name, *bad)[0])
