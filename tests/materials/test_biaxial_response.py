"""A patch of the law under biaxial loads: closed forms, exact derivatives, where it ends."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response, uniaxial_curve
from hypothesis import given, settings
from hypothesis import strategies as st

from ..biaxial_files import BENT
from ..fortran_build import LAWS

T = 0.8


def test_small_loads_give_the_strains_of_orthotropic_elasticity():
    law = HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24)
    loads = 1e-6 * np.array([[3.0, 2.0]])
    strain = biaxial_response(law, loads, T).strain[0] / 1e-6
    wanted = np.array([3.0 / 1000 - 0.24 * 2.0 / 1000, 2.0 / 800 - 0.24 * 3.0 / 1000]) / T
    np.testing.assert_allclose(strain, wanted, rtol=1e-5)


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
@pytest.mark.parametrize("pulled", [0, 1])
def test_a_load_along_one_yarn_is_a_strip(name, pulled):
    law, ends = LAWS[name], np.linspace(0, 0.1, 41)[1:]
    strain, stress = uniaxial_curve(law, pulled, ends, "nominal")
    loads = np.zeros((len(ends), 2))
    loads[:, pulled] = stress * T
    found = biaxial_response(law, loads, T)
    assert found.reached == len(ends)
    np.testing.assert_allclose(found.elongation[:, pulled], strain, rtol=2e-5)


@pytest.mark.parametrize("change", ["constant", "incompressible"])
def test_loads_are_forces_over_the_width_before_the_test(change):
    law = HypoelasticLaw(BENT.beta, 0.24, BENT.strain_range, change)
    loads = np.outer(np.linspace(1, 30, 10), [1.0, 0.6])
    found = biaxial_response(law, loads, T)
    stretch = np.exp(found.strain)
    thickness = T if change == "constant" else T / stretch.prod(axis=1)
    across = stretch[:, ::-1]
    force = found.stress * across * np.reshape(thickness, (-1, 1))
    np.testing.assert_allclose(force, loads, rtol=1e-11)


moduli = st.floats(200.0, 2000.0)


@settings(max_examples=25, deadline=None)
@given(
    e=st.tuples(moduli, moduli, moduli, moduli),
    nu=st.floats(0.01, 0.4),
    ratio=st.tuples(st.floats(0.0, 1.0), st.floats(0.1, 1.0)),
    change=st.sampled_from(["constant", "incompressible"]),
)
def test_derivatives_by_beta_and_nu12_are_those_of_differences(e, nu, ratio, change):
    beta = np.zeros(12)
    beta[[3, 7, 6, 11, 10]] = 30.0, e[0], 10 * (e[1] - e[0]), e[2], 10 * (e[3] - e[2])
    loads = np.outer(np.linspace(1, 15, 6), ratio)

    def law(b=beta, n=nu):
        return HypoelasticLaw(b, n, [0.1, 0.1, 0.1], change)

    names = ("beta_6", "beta_7", "beta_10", "beta_11", "nu12", "beta_3", "thickness")
    found = biaxial_response(law(), loads, T, names)
    if found.reached < len(loads):
        return
    for j, place in enumerate((6, 7, 10, 11)):
        step = np.zeros(12)
        step[place] = 1e-3
        ahead = biaxial_response(law(beta + step), loads, T).strain
        behind = biaxial_response(law(beta - step), loads, T).strain
        slope = (ahead - behind) / 2e-3
        np.testing.assert_allclose(
            found.slope[:, :, j], slope, atol=2e-7 * np.abs(slope).max() + 2e-12
        )
    ends = [biaxial_response(law(n=nu + step), loads, T).strain for step in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(found.slope[:, :, 4], slope, atol=1e-6 * np.abs(slope).max())
    assert (found.slope[:, :, 5] == 0).all()  # there is no shear
    ends = [biaxial_response(law(), loads, T + step).strain for step in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(found.slope[:, :, 6], slope, atol=1e-6 * np.abs(slope).max())


def test_many_increments_change_nothing_but_by_the_coupling():
    few, many = (np.outer(np.linspace(0, 30, n + 1)[1:], [1.0, 0.5]) for n in (7, 700))
    ends = [biaxial_response(BENT, loads, T).strain[-1] for loads in (few, many)]
    np.testing.assert_allclose(*ends, rtol=1e-4)


def test_unloading_goes_back_the_same_way():
    up = np.outer(np.linspace(0, 30, 31)[1:], [1.0, 0.5])
    found = biaxial_response(BENT, np.concatenate([up, up[-2::-1]]), T).strain
    np.testing.assert_allclose(found[-1], found[0], atol=2e-6)


def test_where_the_law_softens_there_is_no_equilibrium():
    falling = HypoelasticLaw(
        [0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08, 0.08, 0.1]
    )
    loads = np.outer(np.linspace(1, 60, 60), [1.0, 1.0])
    found = biaxial_response(falling, loads, T)
    assert 10 < found.reached < 60
    assert np.isfinite(found.strain[: found.reached]).all()
    assert np.isnan(found.strain[found.reached :]).all()


def test_an_even_stretch_is_unstable_where_the_stress_is_more_than_an_uneven_one_adds():
    """To first order an uneven stretch adds C11 - C12 = E / (1 + nu), and the stress takes it."""
    e, nu = 100.0, 0.6
    law = HypoelasticLaw.linear(e, e, 5.0, nu)
    loads = np.outer(np.linspace(1, 110, 110), [1.0, 1.0])
    found = biaxial_response(law, loads, T)
    assert found.reached == len(loads)
    stable = found.stress[:, 0] < e / (1 + nu)
    assert 20 < stable.sum() < 90
    np.testing.assert_array_equal(found.stable, stable)
    assert biaxial_response(BENT, np.outer([5.0, 30.0], [1.0, 1.0]), T).stable.all()
