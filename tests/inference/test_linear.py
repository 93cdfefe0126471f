"""inference/linear.py: posterior of a linearised fit."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bubblefit.inference.comparison import ErrorColumns
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.mesh_limit import FineMeshLimit
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.objective import Blocks
from bubblefit.inference.problem import Evaluation
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms import polynomial as forms

from .cases import CONSTANT_BOUNDS

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], CONSTANT_BOUNDS),
    nuisance=NuisanceUnknowns({"linear": (OFFSET,)}),
)
TRUTH = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.3)
SIZES, SIGMA = (300, 200), np.array([0.05, 0.4])


@dataclass
class Linear:
    """A problem  r = J (y - truth) - noise  of two blocks; all that propagation asks of one."""

    unknowns: Unknowns
    blocks: Blocks
    is_exchangeable: bool = False


PROBLEM = Linear(UNKNOWNS, Blocks(SIZES))
RANDOM = np.random.default_rng(8)
JACOBIAN = RANDOM.standard_normal((sum(SIZES), 4))
ROWS = SIGMA[PROBLEM.blocks.block_of]
#: The covariance of estimates whose blocks are weighted with the inverse of their norms.
WEIGHT = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.block_of]
GAIN = np.linalg.inv(JACOBIAN.T @ (WEIGHT[:, None] * JACOBIAN)) @ JACOBIAN.T * WEIGHT
FORMULA = (GAIN * ROWS) @ (GAIN * ROWS).T


NO_ERRORS = ErrorColumns.independent(np.zeros((len(ROWS), 0)))


def noise(rows=ROWS):
    return Noise({}, {}, rows, rows, NO_ERRORS)


def posterior_of(problem, best, by):
    return posteriors_of(problem, best, by)[0]


def evaluation(y, drawn):
    residual = JACOBIAN @ (y - TRUTH) - drawn
    return Evaluation(y, y[:3], residual, PROBLEM.blocks.value(residual), JACOBIAN, ())


def best_of(drawn):
    """The least of |r1| + |r2|, by weighting with the inverse norms in turn."""
    y = TRUTH
    for _ in range(12):
        r = JACOBIAN @ (y - TRUTH) - drawn
        w = 1.0 / np.sqrt(PROBLEM.blocks.norms(r))[PROBLEM.blocks.block_of]
        y = y - np.linalg.lstsq(w[:, None] * JACOBIAN, w * r, rcond=None)[0]
    return np.asarray(y)


def test_posterior_covariance_is_that_of_fits_to_drawn_noise():
    drawn = ROWS * np.random.default_rng(3).standard_normal((800, len(ROWS)))
    found = np.array([best_of(one) for one in drawn])
    said = posterior_of(
        PROBLEM,
        evaluation(best_of(drawn[0]), drawn[0]),
        Noise({}, {}, ROWS, 0.5 * ROWS, NO_ERRORS),
    )
    assert found.std(axis=0) == pytest.approx(np.sqrt(np.diag(said.covariance)), rel=0.08)
    assert said.covariance == pytest.approx(FORMULA, rel=0.1, abs=0.05 * np.abs(FORMULA).max())
    assert said.centre == pytest.approx(said.best, abs=1e-6)


def test_posterior_of_an_exact_fit_weighs_blocks_by_smallest_noise():
    exact = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())
    assert exact.covariance == pytest.approx(FORMULA)
    t = UNKNOWNS.to_coefficients
    assert exact.coefficient_covariance[:3, :3] == pytest.approx(t @ exact.covariance[:3, :3] @ t.T)
    assert exact.labels == (*UNKNOWNS.labels, "offset")
    assert exact.coefficient_covariance[3, 3] == exact.covariance[3, 3]
    sigma = np.sqrt(np.diag(exact.coefficient_covariance))
    assert exact.correlations * sigma * sigma[:, None] == pytest.approx(
        exact.coefficient_covariance
    )
    nothing = posterior_of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise(0 * ROWS))
    assert not nothing.covariance.any()
    held = TRUTH - [0.02, 0.0, 0.0, 0.0]
    posterior = posterior_of(PROBLEM, evaluation(held, 0 * ROWS), noise())
    assert posterior.centre == pytest.approx(TRUTH, abs=1e-12)
    assert (posterior.best == held).all()


def test_posterior_of_the_fine_mesh_is_shifted_by_its_step():
    y, error = TRUTH + 0.01, JACOBIAN @ np.full(4, -0.02)
    point = evaluation(y, 0 * ROWS)
    limit = FineMeshLimit(np.full(4, 0.02), point.residual, error)
    own, fine = posteriors_of(PROBLEM, point, noise(), limit)
    assert own.best == pytest.approx(y) and own.centre == pytest.approx(TRUTH)
    assert fine is not None and fine.best == pytest.approx(y + 0.02)
    assert fine.centre == pytest.approx(TRUTH + 0.02)
    assert fine.covariance - own.covariance == pytest.approx(np.full((4, 4), 0.002**2))
