"""What a fit knows of its unknowns, on a linear problem whose answer is a formula."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bubblefit.identification.blocks import Blocks
from bubblefit.identification.bounds import LawBounds
from bubblefit.identification.noise import Noise
from bubblefit.identification.nuisance import Nuisance, NuisanceOf
from bubblefit.identification.posterior import Posterior
from bubblefit.identification.problem import Evaluation
from bubblefit.identification.propagation import posterior_of
from bubblefit.identification.unknowns import Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
BOUNDS = LawBounds.of_entries(
    [1.0, 50.0, 50.0], [100.0, 1000.0, 1500.0], {"E1": 5.0, "E2": 5.0, "G12": 0.5}
)
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], BOUNDS),
    nuisance=NuisanceOf({"linear": (OFFSET,)}),
)
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
TRUTH = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.3)
SIZES, SIGMA = (300, 200), np.array([0.05, 0.4])


@dataclass
class Linear:
    """A problem  r = J (y - truth) - noise  of two blocks; all that propagation asks of one."""

    unknowns: Unknowns
    blocks: Blocks


PROBLEM = Linear(UNKNOWNS, Blocks(SIZES))
RANDOM = np.random.default_rng(8)
JACOBIAN = RANDOM.standard_normal((sum(SIZES), 4))
ROWS = SIGMA[PROBLEM.blocks.of]


def noise(rows: np.ndarray = ROWS) -> Noise:
    return Noise({}, {}, rows, rows)


def evaluation(y: np.ndarray, drawn: np.ndarray) -> Evaluation:
    residual = JACOBIAN @ (y - TRUTH) - drawn
    return Evaluation(y, y[:3], residual, PROBLEM.blocks.value(residual), JACOBIAN, ())


def best_of(drawn: np.ndarray) -> np.ndarray:
    """The least of |r1| + |r2|, by weighting with the inverse norms in turn."""
    y = TRUTH
    for _ in range(30):
        r = JACOBIAN @ (y - TRUTH) - drawn
        w = 1.0 / np.sqrt(PROBLEM.blocks.norms(r))[PROBLEM.blocks.of]
        y = y - np.linalg.lstsq(w[:, None] * JACOBIAN, w * r, rcond=None)[0]
    return np.asarray(y)


def test_the_covariance_is_that_of_the_fits_to_drawn_noise() -> None:
    """And that of the formula: blocks weighted with the inverse of their norms."""
    drawn = ROWS * np.random.default_rng(3).standard_normal((1500, len(ROWS)))
    found = np.array([best_of(one) for one in drawn])
    said = posterior_of(
        PROBLEM, evaluation(best_of(drawn[0]), drawn[0]), Noise({}, {}, ROWS, 0.5 * ROWS)
    )  # type: ignore[arg-type]
    assert found.std(axis=0) == pytest.approx(said.sigma, rel=0.06)
    w = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.of]
    gain = np.linalg.inv(JACOBIAN.T @ (w[:, None] * JACOBIAN)) @ JACOBIAN.T * w
    formula = (gain * ROWS) @ (gain * ROWS).T
    assert said.covariance == pytest.approx(formula, rel=0.1, abs=0.05 * np.abs(formula).max())
    assert said.centre == pytest.approx(said.best, abs=1e-6)


def test_of_the_coefficients() -> None:
    """In MPa, from one place; correlations are theirs; the nuisance follows in mm."""
    posterior = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())  # type: ignore[arg-type]
    t = UNKNOWNS.to_coefficients
    expected = t @ posterior.covariance[:3, :3] @ t.T
    assert posterior.of_law == pytest.approx(expected)
    assert posterior.labels == (*UNKNOWNS.labels, "offset")
    assert posterior.coefficients[3, 3] == posterior.covariance[3, 3]
    sigma = np.sqrt(np.diag(posterior.coefficients))
    assert posterior.correlations * sigma * sigma[:, None] == pytest.approx(posterior.coefficients)
    assert np.diag(posterior.correlations) == pytest.approx(np.ones(4))


def test_an_exact_fit_weighs_its_blocks_by_the_noise_to_reckon_with() -> None:
    exact = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())  # type: ignore[arg-type]
    w = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.of]
    gain = np.linalg.inv(JACOBIAN.T @ (w[:, None] * JACOBIAN)) @ JACOBIAN.T * w
    assert exact.covariance == pytest.approx((gain * ROWS) @ (gain * ROWS).T)
    nothing = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise(0 * ROWS))  # type: ignore[arg-type]
    assert not nothing.covariance.any()


def test_the_centre_lies_where_the_data_ask_for_it() -> None:
    """A best fit held by a bound: the least without it is outside."""
    held = TRUTH - [0.02, 0.0, 0.0, 0.0]
    posterior = posterior_of(PROBLEM, evaluation(held, 0 * ROWS), noise())  # type: ignore[arg-type]
    assert posterior.centre == pytest.approx(TRUTH, abs=1e-12)
    assert (posterior.best == held).all()


def test_laws_are_drawn_within_the_bounds() -> None:
    """One unknown lies on its bound, which cuts off half of what the data leave."""
    y = np.append(UNKNOWNS.at(np.array([1.0, 250.0, 400.0]))[:3], 2.0)
    covariance = np.diag([0.02, 1e-4, 1e-4, 0.1]) ** 2
    posterior = Posterior(UNKNOWNS, y, y, covariance)
    drawn = posterior.sample(2000, np.random.default_rng(0))
    a, c = UNKNOWNS.inequalities
    assert (drawn @ a.T >= c - 1e-7).all()
    assert drawn[:, 3].max() <= 2.0 + 1e-9 and drawn[:, 3].std() == pytest.approx(0.0603, rel=0.08)
    laws = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert len(laws) == 50 and all(law.nu12 == LAW.nu12 for law in laws)
    shear = np.array([law.modulus("G12", np.zeros(1))[0] for law in laws])
    assert shear.min() >= 1.0 - 1e-7 and shear.std() > 0.1
    same = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert all((one.beta == two.beta).all() for one, two in zip(laws, same, strict=True))
