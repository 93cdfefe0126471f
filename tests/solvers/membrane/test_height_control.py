"""Large strains: a rubber balloon, soft disks to and beyond the largest pressure."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.bubble import inflate_to_heights
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS = 50.0
END = 1.2  # log strain


def rubber(shear_modulus=1.0, nu12=0.49, knots=13):
    """Return an isotropic spline law fitted to the equal biaxial curve of a neo-Hookean material.

    Its Cauchy stress is mu (l^2 - l^-4) at the stretch l.
    """
    ends = [END, END, END * (1 + nu12)]
    form = symmetric(form_named("spline", {"knots": knots}, ends), "isotropic", nu12)
    strain = np.linspace(0.0, END, 200)
    stretch = np.exp(strain)
    modulus = (1 - nu12) * shear_modulus * (2 * stretch**2 + 4 * stretch**-4)
    law = HypoelasticLaw(np.ones(knots), nu12, ends, "incompressible", form)
    beta = np.linalg.lstsq(law.modulus_rows("E1", strain), modulus, rcond=None)[0]
    return law.with_beta(beta)


def test_pressure_of_a_neo_hookean_balloon_is_largest_at_its_stretch():
    strain = np.linspace(0.0, 0.6, 601)
    stress = np.zeros((1, 3))
    state = np.zeros((1, 3))
    pressures = []
    law = rubber()
    for value in strain[1:]:
        end = np.array([[value, value, 0.0]])
        stress, _ = law.increment(state, end, stress)
        state = end
        pressures.append(stress[0, 0] * np.exp(-3 * value))  # 2 sigma t / r
    stretch = np.exp(strain[1 + int(np.argmax(pressures))])
    assert stretch == pytest.approx(7 ** (1 / 6), rel=0.01)


def disk(pressures):
    mesh = disk_mesh(RADIUS, 48, "quarter")
    return BubbleModel(mesh, 1.0, pressures, default_increments(pressures))


def test_soft_disk_rises_to_1_2_radii_through_its_largest_pressure():
    heights = RADIUS * np.arange(0.2, 1.51, 0.1)
    pressures, displacements = inflate_to_heights(disk([1e-3]), rubber(), heights)
    np.testing.assert_allclose(displacements[:, :, 2].max(axis=1), heights)
    top = int(np.argmax(pressures))
    assert 0 < top < len(heights) - 1 and heights[top] == pytest.approx(1.2 * RADIUS, rel=0.1)
    # The same equilibria as by pressure, below the largest.
    rising = pressures[1:8:2]
    by_pressure = MembraneSolver().run(disk(rising), rubber()).displacement[:, :, 2].max(axis=1)
    np.testing.assert_allclose(by_pressure, heights[1:8:2], rtol=2e-3)


def test_largest_pressure_is_said_where_a_run_by_pressure_ends():
    with pytest.raises(SolverFailure, match="no equilibrium at 45 kPa") as failure:
        MembraneSolver().run(disk([0.03, 0.045]), rubber())
    words = str(failure.value)
    maximum = float(words.partition("maximum, ")[2].partition(" kPa")[0])
    pressures, _ = inflate_to_heights(disk([1e-3]), rubber(), RADIUS * np.arange(0.2, 1.3, 0.1))
    assert maximum == pytest.approx(1e3 * pressures.max(), rel=0.01) and "\n" not in words


def test_sheet_of_constant_thickness_passes_a_hemisphere():
    law = HypoelasticLaw.linear(1.0, 1.0, 1 / 2.8, 0.4)
    pressures = np.linspace(0.01, 0.045, 5)
    history = MembraneSolver().run(disk(pressures), law)
    assert history.displacement[-1, :, 2].max() > 1.6 * RADIUS
    assert history.strain_max[0] > 0.9  # over 140 % of length


def test_height_without_equilibrium_is_refused():
    with pytest.raises(SolverFailure, match="no equilibrium of"):
        inflate_to_heights(disk([1e-3]), rubber(), [1.0e4])
