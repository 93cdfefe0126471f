"""materials/biaxial_patch.py: a homogeneous patch under biaxial loads."""

from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.deformation_curves import uniaxial_curve
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st

from ..builders.biaxial_tests import BENT_LAW
from ..builders.fortran import LAWS
from .cases import (
    CRIMP,
    MEMORY_LAW,
    MEMORYLESS_LAW,
    STIFF,
    crimp_law,
    load_ratio_law,
    loads_out_of_proportion,
)

RATIO_NU = 0.24
#: MPa: G12, E2 at 1:1 and its gain, E1 at 1:1 and its gain.
RATIO_BETA = (30.0, 800.0, 400.0, 1000.0, -300.0)


def test_load_ratio_law_converges_with_square_of_the_increment():
    ends = {
        n: biaxial_response(load_ratio_law(), loads_out_of_proportion(n), 1.0).strain[-1]
        for n in (4, 8, 16, 32, 1024)
    }
    off = [np.abs(ends[n] - ends[1024]).max() for n in (4, 8, 16, 32)]
    orders = np.log2(np.array(off[:-1]) / off[1:])
    assert (orders > 1.9).all() and (orders < 2.1).all()
    assert off[1] < 5e-4 * ends[1024].max()


def test_crimp_returns_after_a_closed_path_of_stress():
    corners = [(0, 0), (20, 0), (20, 30), (0, 30), (0, 0)]
    shares = np.linspace(0.0, 1.0, 50)[1:, None]
    way = np.vstack([a + (np.subtract(b, a)) * shares for a, b in pairwise(corners)])
    flat = crimp_law(STIFF, 0.0)
    end = biaxial_response(flat, way + 1e-12, 1.0).strain[-1]
    np.testing.assert_allclose(end, 0.0, atol=1e-6)


TURNING = np.array([[5.0, 1], [10, 3], [12, 8], [12, 12], [6, 12], [2, 8]])
#: Law, its beta, nu12, loads, step of beta and of others, room, and entries that move nothing.
HISTORIES = (
    (
        load_ratio_law,
        np.array(RATIO_BETA),
        RATIO_NU,
        np.concatenate([loads_out_of_proportion(3), [[10.0, 1.0], [2.0, 8.0]]]),
        (1e-2, 1e-6),
        (1e-7, 1e-13),
        {"beta_0"},
    ),
    (crimp_law, CRIMP, 0.2, TURNING, (1e-3, 1e-5), (1e-6, 1e-12), {"beta_0", "beta_1", "beta_2"}),
)


@pytest.mark.parametrize(
    ("case", "name"),
    [(case, name) for case in HISTORIES
     for name in (*(f"beta_{i}" for i in range(len(case[1]))), "nu12", "thickness")],
)  # fmt: skip
def test_derivatives_of_a_patch_through_its_history(case, name):
    make, beta, nu, loads, steps, (share, least), none = case
    step = steps[not name.startswith("beta")]

    def strain(by):
        moved = beta + by * np.array([name == f"beta_{i}" for i in range(len(beta))])
        law = make(moved, nu + by * (name == "nu12"))
        return biaxial_response(law, loads, 0.8 + by * (name == "thickness")).strain

    found = biaxial_response(make(), loads, 0.8, [name])
    assert found.reached == len(loads)
    slope = (strain(step) - strain(-step)) / (2 * step)
    room = share * np.abs(slope).max() + least
    np.testing.assert_allclose(found.slope[..., 0], slope, atol=room)
    assert (np.abs(slope).max() > 0) == (name not in none)


THICKNESS_MM = 0.8


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
@pytest.mark.parametrize("pulled", [0, 1])
def test_patch_loaded_along_a_yarn_is_a_strip(name, pulled):
    law, ends = LAWS[name], np.linspace(0, 0.1, 41)[1:]
    strain, stress = uniaxial_curve(law, pulled, ends, "nominal")
    loads = np.zeros((len(ends), 2))
    loads[:, pulled] = stress * THICKNESS_MM
    found = biaxial_response(law, loads, THICKNESS_MM)
    assert found.reached == len(ends)
    np.testing.assert_allclose(found.elongation[:, pulled], strain, rtol=2e-5)


@pytest.mark.parametrize("change", ["constant", "incompressible"])
def test_patch_loads_are_forces_over_the_undeformed_width(change):
    law = HypoelasticLaw(BENT_LAW.beta, 0.24, BENT_LAW.strain_range, change)
    loads = np.outer(np.linspace(1, 30, 10), [1.0, 0.6])
    found = biaxial_response(law, loads, THICKNESS_MM)
    stretch = np.exp(found.strain)
    thickness = THICKNESS_MM if change == "constant" else THICKNESS_MM / stretch.prod(axis=1)
    force = found.stress * stretch[:, ::-1] * np.reshape(thickness, (-1, 1))
    np.testing.assert_allclose(force, loads, rtol=1e-11)


@settings(max_examples=25, deadline=None)
@given(
    e=st.tuples(*[st.floats(200.0, 2000.0)] * 4),
    nu=st.floats(0.01, 0.4),
    ratio=st.tuples(st.floats(0.0, 1.0), st.floats(0.1, 1.0)),
    change=st.sampled_from(["constant", "incompressible"]),
)
def test_derivatives_of_a_patch_against_differences(e, nu, ratio, change):
    beta = np.zeros(12)
    beta[[3, 7, 6, 11, 10]] = 30.0, e[0], 10 * (e[1] - e[0]), e[2], 10 * (e[3] - e[2])
    loads = np.outer(np.linspace(1, 15, 6), ratio)
    names = ("beta_6", "beta_7", "beta_10", "beta_11", "nu12", "thickness", "beta_3")

    def response(moved, name=""):
        entry = np.array([f"beta_{i}" == name for i in range(12)])
        law = HypoelasticLaw(
            beta + moved * entry, nu + moved * (name == "nu12"), [0.1, 0.1, 0.1], change
        )
        return biaxial_response(law, loads, THICKNESS_MM + moved * (name == "thickness"), names)

    found = response(0.0)
    if found.reached < len(loads):
        return
    for j, name in enumerate(names[:-1]):
        of_beta = name.startswith("beta")
        step, room, floor = (1e-3, 2e-7, 2e-12) if of_beta else (1e-6, 1e-6, 0.0)
        slope = (response(step, name).strain - response(-step, name).strain) / (2 * step)
        atol = room * abs(slope).max() + floor
        np.testing.assert_allclose(found.slope[:, :, j], slope, atol=atol, err_msg=name)
    assert (found.slope[:, :, -1] == 0).all()  # there is no shear


def test_even_stretch_is_unstable_beyond_stiffness_against_uneven_stretch():
    """To first order an uneven stretch adds C11 - C12 = E / (1 + nu), and the stress takes it."""
    e, nu = 100.0, 0.6
    law = HypoelasticLaw.linear(e, e, 5.0, nu)
    loads = np.outer(np.linspace(1, 110, 110), [1.0, 1.0])
    found = biaxial_response(law, loads, THICKNESS_MM)
    assert found.reached == len(loads)
    stable = found.stress[:, 0] < e / (1 + nu)
    assert 20 < stable.sum() < 90
    np.testing.assert_array_equal(found.stable, stable)
    assert biaxial_response(BENT_LAW, np.outer([5.0, 30.0], [1.0, 1.0]), THICKNESS_MM).stable.all()


def test_patch_under_rising_loads_needs_no_memory():
    loads = np.outer(np.linspace(1.0, 8.0, 5), [1.0, 0.5])
    response, forgetful = (
        biaxial_response(law, loads, 0.8) for law in (MEMORY_LAW, MEMORYLESS_LAW)
    )
    assert response.reached == 5
    np.testing.assert_array_equal(response.strain, forgetful.strain)
