"""What a fit knows of its unknowns, on a linear problem whose answer is a formula."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bubblefit.inference.comparison import Blocks, Nuisance, NuisanceOf
from bubblefit.inference.discretisation import Limit
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.posterior import Posterior, bands_of
from bubblefit.inference.problem import Evaluation
from bubblefit.inference.unknowns import LawBounds, Unknowns
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


def of(problem: Linear, best: Evaluation, by: Noise) -> Posterior:
    return posteriors_of(problem, best, by)[0]  # type: ignore[arg-type]


def evaluation(y: np.ndarray, drawn: np.ndarray) -> Evaluation:
    residual = JACOBIAN @ (y - TRUTH) - drawn
    return Evaluation(y, y[:3], residual, PROBLEM.blocks.value(residual), JACOBIAN, ())


def best_of(drawn: np.ndarray) -> np.ndarray:
    """The least of |r1| + |r2|, by weighting with the inverse norms in turn."""
    y = TRUTH
    for _ in range(12):
        r = JACOBIAN @ (y - TRUTH) - drawn
        w = 1.0 / np.sqrt(PROBLEM.blocks.norms(r))[PROBLEM.blocks.of]
        y = y - np.linalg.lstsq(w[:, None] * JACOBIAN, w * r, rcond=None)[0]
    return np.asarray(y)


def test_the_covariance_is_that_of_the_fits_to_drawn_noise() -> None:
    """And that of the formula: blocks weighted with the inverse of their norms."""
    drawn = ROWS * np.random.default_rng(3).standard_normal((800, len(ROWS)))
    found = np.array([best_of(one) for one in drawn])
    said = of(PROBLEM, evaluation(best_of(drawn[0]), drawn[0]), Noise({}, {}, ROWS, 0.5 * ROWS))
    assert found.std(axis=0) == pytest.approx(said.sigma, rel=0.08)
    w = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.of]
    gain = np.linalg.inv(JACOBIAN.T @ (w[:, None] * JACOBIAN)) @ JACOBIAN.T * w
    formula = (gain * ROWS) @ (gain * ROWS).T
    assert said.covariance == pytest.approx(formula, rel=0.1, abs=0.05 * np.abs(formula).max())
    assert said.centre == pytest.approx(said.best, abs=1e-6)


def test_of_the_coefficients() -> None:
    """In MPa, from one place; correlations are theirs; the nuisance follows in mm."""
    posterior = of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())
    t = UNKNOWNS.to_coefficients
    expected = t @ posterior.covariance[:3, :3] @ t.T
    assert posterior.of_law == pytest.approx(expected)
    assert posterior.labels == (*UNKNOWNS.labels, "offset")
    assert posterior.coefficients[3, 3] == posterior.covariance[3, 3]
    sigma = np.sqrt(np.diag(posterior.coefficients))
    assert posterior.correlations * sigma * sigma[:, None] == pytest.approx(posterior.coefficients)
    assert np.diag(posterior.correlations) == pytest.approx(np.ones(4))


def test_an_exact_fit_weighs_its_blocks_by_the_noise_to_reckon_with() -> None:
    exact = of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())
    w = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.of]
    gain = np.linalg.inv(JACOBIAN.T @ (w[:, None] * JACOBIAN)) @ JACOBIAN.T * w
    assert exact.covariance == pytest.approx((gain * ROWS) @ (gain * ROWS).T)
    nothing = of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise(0 * ROWS))
    assert not nothing.covariance.any()


def test_the_centre_lies_where_the_data_ask_for_it() -> None:
    """A best fit held by a bound: the least without it is outside."""
    held = TRUTH - [0.02, 0.0, 0.0, 0.0]
    posterior = of(PROBLEM, evaluation(held, 0 * ROWS), noise())
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


def test_of_a_finer_model() -> None:
    """Its own best unknowns, their centre by its own residual, and a tenth of the way as doubt."""
    y, error = TRUTH + 0.01, JACOBIAN @ np.full(4, -0.02)
    point = evaluation(y, 0 * ROWS)
    limit = Limit(np.full(4, 0.02), point.residual, error)
    own, fine = posteriors_of(PROBLEM, point, noise(), limit)  # type: ignore[arg-type]
    assert own.best == pytest.approx(y) and own.centre == pytest.approx(TRUTH)
    assert fine is not None and fine.best == pytest.approx(y + 0.02)
    assert fine.centre == pytest.approx(TRUTH + 0.02)
    assert fine.covariance - own.covariance == pytest.approx(np.full((4, 4), 0.002**2))


def test_bands_hold_their_share_and_the_law_itself() -> None:
    """Of an unbounded modulus 1.96 sigma to both sides; of one on its bound to one side only."""
    y = np.append(UNKNOWNS.at(np.array([1.0, 250.0, 400.0]))[:3], 0.0)
    posterior = Posterior(UNKNOWNS, y, y, np.diag([0.02, 1e-2, 1e-2, 0.1]) ** 2)
    strains = {name: np.array([0.0, 0.05]) for name in ("E1", "E2", "G12")}
    law = HypoelasticLaw.linear(400.0, 250.0, 1.0)
    bands = bands_of(posterior, law, strains)
    sizes = dict(zip(("G12", "E2", "E1"), np.diag(UNKNOWNS.to_coefficients), strict=True))
    for name, value in (("E1", 400.0), ("E2", 250.0)):
        wide = 1.96 * 1e-2 * sizes[name]
        assert bands[name] == pytest.approx(
            np.array([[value - wide] * 2, [value + wide] * 2]), abs=0.15 * wide
        )
    lower, upper = bands["G12"]
    assert lower == pytest.approx([1.0, 1.0], abs=1e-9)
    half_normal = 2.241 * 0.02 * sizes["G12"]
    assert upper - 1.0 == pytest.approx([half_normal] * 2, rel=0.15)
    other = HypoelasticLaw.linear(600.0, 250.0, 1.0)
    assert bands_of(posterior, other, strains)["E1"][1] == pytest.approx([600.0, 600.0])
