"""materials/admissibility.py: positive moduli, and work of a closed path of strain."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.admissibility import (
    check_positive,
    closed_path,
    is_positive,
    smallest_modulus,
)
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.forms.base import EVEN, GRID
from bubblefit.materials.law import HypoelasticLaw
from scipy.integrate import quad

from ..support.refusals import complaint
from .cases import STIFF, crimp_law, load_ratio_law


def test_load_ratio_law_with_a_modulus_not_positive_at_some_ratio_is_refused():
    falling = load_ratio_law(
        (30.0, 800.0, 0.0, 1000.0, 1500.0)
    )  # E1 < 0 where the warp carries little
    assert falling.modulus("E1", 0.0) == 1000.0
    assert falling.modulus("E1", 0.0, 0.0) == pytest.approx(1000.0 - 1500.0 * EVEN)
    assert is_positive(load_ratio_law()) and not is_positive(falling)
    MaterialCard(load_ratio_law(), 0.8)
    assert "E1 is -60.66 MPa" in complaint(MaterialCard, falling, 0.8)
    along_fill = np.array([[0.0, 10.0]])
    assert biaxial_response(falling, along_fill, 0.8).reached == 0
    assert biaxial_response(falling, along_fill[:, ::-1], 0.8).reached == 1


def test_cubic_positive_on_the_grid_hardly_dips_between():
    """The bound stated at GRID, and cubics that come within a factor of three of it."""
    fine = np.vander(np.linspace(0, 1, 30 * (GRID - 1) + 1), 4)
    coarse = fine[::30]
    random = np.random.default_rng(5)
    nodes = 0.5 * (1 - np.cos((2 * np.arange(4) + 1) * np.pi / 8))
    worst = 0.0
    for beta in random.uniform(-1, 1, (4000, 4)) @ np.linalg.inv(np.vander(nodes, 4)).T:
        beta[3] -= (coarse @ beta).min()  # touches zero on the grid
        whole = fine @ beta
        worst = max(worst, -whole.min() / whole.max())
    assert 0.007 / 3 < worst < 0.007


def test_smallest_modulus_is_exact_between_strains_of_the_grid():
    # A dip below zero that is 2e-4 of strain wide, and lies at no strain of a grid.
    dip = 0.0437
    beta = np.zeros(12)
    beta[4:8] = 0.0, 1e6, -2e6 * dip, 1e6 * dip**2 - 0.01
    beta[[3, 11]] = 10.0, 500.0
    law = HypoelasticLaw(beta, 0.2, [0.1, 0.1, 0.1])
    smallest, strain = smallest_modulus(law, "E2")
    assert (smallest, strain) == (pytest.approx(-0.01, abs=1e-9), pytest.approx(dip))
    assert not is_positive(law) and "E2 is -0.01 MPa at 4.37 %" in complaint(check_positive, law)
    above = replace(law, beta=beta + 0.02 * (np.arange(12) == 7))
    assert is_positive(above)
    # Before the dip the card holds.
    assert is_positive(replace(law, strain_range=[0.1, 0.04, 0.1]))


def test_smallest_modulus_of_a_trilinear_law_is_that_of_a_region():
    regions = HypoelasticLaw.trilinear(
        (500, 400, 300), (90, -1, 80), (9, 8, 7), [[0.01, 0.03]] * 3, strain_range=[0.1] * 3
    )
    assert smallest_modulus(regions, "E2")[0] == -1.0
    assert smallest_modulus(regions, "E1")[0] == 300.0


def test_work_of_a_closed_path_in_closed_form(tmp_path):
    """Closed form of E1 constant, E2 = c + k eps2: a^2 (D11(b) - D11(0)) / 2 + a (b D12(b) - int
    D12); none without coupling, of constants, and of crimp alone."""
    a, b, nu, e1, c, k = 0.1, 0.08, 0.3, 500.0, 200.0, 4000.0
    beta = np.zeros(12)
    beta[[3, 6, 7, 11]] = 20.0, k, c, e1

    def d11(x):
        return e1 / (1 - nu**2 * (c + k * x) / e1)

    def d12(x):
        return nu * (c + k * x) / (1 - nu**2 * (c + k * x) / e1)

    exact = a**2 / 2 * (d11(b) - d11(0)) + a * (b * d12(b) - quad(d12, 0, b)[0])
    law = HypoelasticLaw(beta, nu, [0.2] * 3)
    found = closed_path(law, (a, b), increments=400)
    assert found.work == pytest.approx(exact, rel=1e-5) and 0.01 < found.share < 1
    assert closed_path(law, (a, b)).work == pytest.approx(exact, rel=1e-3)
    for none in (replace(law, nu12=0.0), HypoelasticLaw.linear(e1, c, 20.0), crimp_law(STIFF)):
        assert abs(closed_path(none, (a, b), 400).share) < 2e-5
    assert abs(closed_path(crimp_law()).share) > 1e-3
    card = MaterialCard(law, 0.8)
    card.write(tmp_path / "card.toml")
    assert card.closed_path.ends == (0.2, 0.2)
    assert card.closed_path.words in (tmp_path / "card.toml").read_text()
