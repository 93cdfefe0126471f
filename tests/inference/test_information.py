"""inference/posterior.py: information on the law that measured values carry, beside nuisance."""

import numpy as np
import pytest
from bubblefit.inference.information import information
from bubblefit.inference.law_bounds import LawBounds
from bubblefit.inference.linear import PRIOR
from bubblefit.inference.nuisance import Nuisance
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.law import HypoelasticLaw

INFORMATION_LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)
UNKNOWNS = Unknowns.of(
    INFORMATION_LAW.form, 0.24, [0.1] * 3,
    LawBounds.of_moduli({"E1": (1.0, 900.0), "E2": (1.0, 900.0), "G12": (0.1, 90.0)}),
)  # fmt: skip
Y = UNKNOWNS.at(INFORMATION_LAW.beta[list(UNKNOWNS.free)])


def test_information_without_nuisance_is_inverse_of_marginal_covariance():
    random = np.random.default_rng(1)
    slopes, sigma = random.standard_normal((40, 5)), random.uniform(0.5, 2.0, 40)
    offsets = (Nuisance("a", -2.0, 2.0, "mm", prior=0.3), Nuisance("b", -1e-2, 1e-2, "kPa"))
    # The second may lie anywhere within ten times the width of its bounds.
    before = np.diag([0.0, 0.0, 0.0, 0.3**-2, 0.2**-2])
    rows = slopes / sigma[:, None]
    whole = np.linalg.inv(rows.T @ rows + before)
    left = information(slopes, sigma, offsets)
    np.testing.assert_allclose(np.linalg.inv(left), whole[:3, :3], rtol=1e-9)
    # And it is less than without nuisance.
    alone = information(slopes[:, :3], sigma)
    np.testing.assert_allclose(alone, rows[:, :3].T @ rows[:, :3], rtol=1e-12)
    assert (np.linalg.eigvalsh(alone - left) > 0).all()


def test_values_explained_by_free_nuisance_carry_no_information():
    slopes = np.column_stack([np.ones(9), np.arange(9.0), np.ones(9)])
    left = information(slopes, 1.0, (Nuisance("offset", -1e6, 1e6, "mm"),))
    assert left[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert left[1, 1] == pytest.approx(60.0)


def test_information_on_a_product_determines_no_factor():
    """Each of G12, E2 and E1 is known to 1000 % before; E1 G12 and E2 are measured."""
    before = Posterior(UNKNOWNS, Y, Y, np.diag(PRIOR * Y) ** 2)
    slope = np.array([[1 / Y[0], 0.0, 1 / Y[2]]])
    known = information(slope, 1e-3) + np.diag([0.0, (0.01 * Y[1]) ** -2, 0.0])
    sigma = np.sqrt(np.diag(before.with_information(known).covariance)) / Y
    assert sigma == pytest.approx([10 / np.sqrt(2), 0.01, 10 / np.sqrt(2)], rel=1e-4)
