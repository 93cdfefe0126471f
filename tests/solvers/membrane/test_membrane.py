"""solvers/membrane/membrane.py: residual, increments and tangent of a membrane of quads."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw

from .cases import distorted_grid, plane_membrane

LAW = HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)


@pytest.fixture
def membrane():
    points, quads, *_ = distorted_grid(4, 5, 20.0, 30.0)
    rim = np.flatnonzero(
        (np.abs(points[:, :2] - points[:, :2].min(axis=0)) < 1e-9).any(axis=1)
        | (np.abs(points[:, :2] - points[:, :2].max(axis=0)) < 1e-9).any(axis=1)
    )
    held = (3 * rim[:, None] + np.arange(3)).ravel()
    return plane_membrane(points, quads, LAW, held)


def test_membrane_at_rest_is_in_equilibrium_without_stress(membrane):
    membrane.unbalance(np.zeros_like(membrane.reference), 0.0, with_tangent=True)
    assert membrane.iterations == 1
    np.testing.assert_allclose(membrane.stress_new, 0.0, atol=1e-12)
    np.testing.assert_allclose(membrane.residual, 0.0, atol=1e-12)


def test_residual_is_measured_by_the_largest_pressure_force(membrane):
    still = np.zeros_like(membrane.reference)
    ratios = [membrane.unbalance(still, pressure, with_tangent=False) for pressure in (0.1, 0.2)]
    # Without stress the pressure alone is out of balance, however large it is.
    assert ratios[0] == pytest.approx(ratios[1])
    area = membrane.elements.area.sum()
    assert membrane.residual[2::3].sum() == pytest.approx(-0.2 * area)


def test_deformation_without_valid_stress_has_an_infinite_residual(membrane):
    u = np.zeros_like(membrane.reference)
    u[0] = np.nan
    assert membrane.unbalance(u, 0.1, with_tangent=False) == np.inf


def test_strain_and_stress_start_the_next_increment_only_if_accepted(membrane):
    u = 0.01 * membrane.reference
    membrane.unbalance(u, 0.0, with_tangent=False)
    assert membrane.stress_new.any() and not membrane.stress_old.any()
    membrane.accept()
    np.testing.assert_array_equal(membrane.stress_old, membrane.stress_new)
    np.testing.assert_allclose(membrane.strain_old[..., :2], np.log(1.01))
    membrane.unbalance(0 * u, 0.0, with_tangent=False)
    np.testing.assert_allclose(membrane.stress_new, 0.0, atol=1e-12)
    assert membrane.strain_old.any()


def test_thickness_is_that_of_each_quad(membrane):
    assert membrane.section.shape == (len(membrane.quads),)
    assert (membrane.section == membrane.thickness).all()


def test_entries_of_held_unknowns_are_not_added(membrane):
    before = membrane.tangent.data.copy()
    membrane.add(np.array([0, -1, 0]), np.array([1.0, 5.0, 2.0]))
    assert membrane.tangent.data[0] == before[0] + 3.0
    np.testing.assert_array_equal(membrane.tangent.data[1:], before[1:])


def test_singular_tangent_is_a_limit_point(membrane):
    membrane.tangent.data[:] = 0.0
    with pytest.raises(SolverFailure, match="singular: a limit point"):
        membrane.factor()


def test_equilibrium_under_pressure_balances_it(membrane):
    stretched = 0.01 * membrane.reference
    u = membrane.equilibrium(stretched, 0.01)
    assert u is not None
    assert membrane.unbalance(u, 0.01, with_tangent=False) < 1e-9
