"""Information of measured values: it adds up, and nuisance takes its share of it."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.comparison import Nuisance
from bubblefit.inference.linear import Asked, information, summary
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.law import HypoelasticLaw

LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)
UNKNOWNS = Unknowns.of(
    LAW.form, 0.24, [0.1] * 3,
    LawBounds.of_moduli({"E1": (1.0, 900.0), "E2": (1.0, 900.0), "G12": (0.1, 90.0)}),
)  # fmt: skip
Y = UNKNOWNS.at(LAW.beta[list(UNKNOWNS.free)])


def asked() -> Asked:
    """Constant moduli; the unknowns are G12, E2, E1, each in a unit of its own."""
    return Asked(UNKNOWNS, LAW, Y, np.array([0.1, 0.1, 0.05]))


def test_nuisance_is_what_the_whole_covariance_says_it_is() -> None:
    """The inverse of what is left is the law's part of the covariance of all unknowns."""
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


def test_values_that_only_a_nuisance_explains_say_nothing() -> None:
    """A slope that is the same as that of an unknown offset (all but free) is lost."""
    slopes = np.column_stack([np.ones(9), np.arange(9.0), np.ones(9)])
    left = information(slopes, 1.0, (Nuisance("offset", -1e6, 1e6, "mm"),))
    assert left[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert left[1, 1] == pytest.approx(60.0)


def test_a_modulus_of_which_nothing_is_known_is_unknown() -> None:
    """Without any test 1000 % of each; with E2 known to 2 % the others stay unknown."""
    nothing = asked().sigma(np.zeros((3, 3)))
    for name in ("E1", "E2", "G12"):
        np.testing.assert_allclose(nothing[name], 10.0, rtol=1e-9)
    one = np.diag([0.0, (0.02 * Y[1]) ** -2, 0.0])
    found = summary(asked().sigma(one))
    assert found["E2"] == pytest.approx(0.02, rel=1e-4)
    assert [found["E1"], found["G12"]] == pytest.approx([10.0, 10.0])


def test_a_direction_of_which_nothing_is_known_is_unknown() -> None:
    """Only the product E1 G12 is measured: neither is known, however well the product is."""
    slope = np.array([[1 / Y[0], 0.0, 1 / Y[2]]])
    known = information(slope, 1e-3) + np.diag([0.0, (0.01 * Y[1]) ** -2, 0.0])
    found = summary(asked().sigma(known))
    assert [found["E1"], found["G12"]] == pytest.approx([10 / np.sqrt(2)] * 2, rel=1e-4)
    assert found["E2"] == pytest.approx(0.01, rel=1e-4)


def test_the_figure_of_a_curve_is_the_root_of_its_mean_square() -> None:
    assert summary({"E1": np.array([3.0, 4.0])}) == {"E1": pytest.approx(np.sqrt(12.5))}
