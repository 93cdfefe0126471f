"""How good a fit is: moduli against a known solution, and what the data could not determine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..materials.law import MODULI, HypoelasticLaw
from ..materials.positivity import GRID
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

POINTS = 61
#: A modulus less certain than this (1 sigma, relative) anywhere is said to be undetermined.
UNCERTAIN = 0.25
#: Relative uncertainty of a modulus of which nothing is known.
PRIOR = 10.0
ON_BOUND = 1e-6


def moduli_error(law: HypoelasticLaw, known: HypoelasticLaw, reached: Array) -> dict[str, float]:
    """Largest relative error of E1, E2, G12 over the strain range reached (3,)."""
    errors = {}
    for name, (_, component) in MODULI.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        errors[name] = float(
            np.max(np.abs(law.modulus(name, strain) / known.modulus(name, strain) - 1.0))
        )
    return errors


@dataclass(frozen=True, eq=False)
class Certainty:
    """1-sigma relative uncertainty of each modulus along (0 ... reached), and plain words.

    noise : of each test, in the unit of its data (mm, N).
    """

    noise: dict[str, float]
    strain: dict[str, Array]
    sigma: dict[str, Array]
    undetermined: tuple[str, ...]


def certainty(
    problem: FitProblem, best: Evaluation, law: HypoelasticLaw, reached: Array
) -> Certainty:
    """Linear propagation of the noise of every test to the moduli.

    The noise is the RMS misfit, but not less than the objective's least noise: a misfit of zero
    (computed data) does not mean that a measurement would determine everything. Assumes white
    noise; a misfit that is systematic makes the moduli less certain than this says.
    """
    assert best.jacobian is not None
    noise, sigma = _noise(problem, best)
    # The objective weighs the blocks; the covariance is that of the weighted estimate.
    j = best.jacobian
    inverse = np.linalg.pinv(j.T @ j, rcond=1e-13)
    estimator = inverse @ j.T * sigma
    strains, sigmas = _along(problem, law, reached, estimator @ estimator.T)
    first = problem.experiments[0]
    said = f"at {noise[first.name]:.2g} {first.objective.unit} noise"
    if len(problem.experiments) > 1:
        said = "with the tests' noise"
    words = [
        f"{name} is uncertain by up to {100 * relative.max():.0f} % (1 sigma {said}), "
        f"worst at strain {strains[name][relative.argmax()]:.3f}"
        for name, relative in sigmas.items()
        if relative.max() > UNCERTAIN
    ]
    return Certainty(noise, strains, sigmas, (*words, *_limited(problem, best)))


def pinned_by(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    tests: Sequence[int],
) -> dict[str, Array]:
    """1-sigma relative uncertainty of each modulus from some `tests` alone, by their numbers.

    The best estimate that those tests would allow (weights do not count), beside hardly any
    knowledge before: each modulus at the Chebyshev points to 1000 % of its own size.
    """
    assert best.jacobian is not None
    _, sigma = _noise(problem, best)
    rows = np.concatenate([np.r_[problem.rows(k)] for k in tests])
    j = best.jacobian[rows] / sigma[rows, None]
    before = PRIOR * np.maximum(np.abs(best.unknowns), 1e-3)
    covariance = np.linalg.inv(j.T @ j + np.diag(before**-2.0))
    return _along(problem, law, reached, covariance)[1]


def _noise(problem: FitProblem, best: Evaluation) -> tuple[dict[str, float], Array]:
    """Noise of each test in its unit, and of each residual (m,)."""
    misfit, scale = best.residual * problem.scale, problem.scale
    noise, sigma = {}, np.empty_like(scale)
    for k, experiment in enumerate(problem.experiments):
        rows = problem.rows(k)
        rms = float(np.sqrt(np.mean(misfit[rows] ** 2)))
        noise[experiment.name] = max(experiment.objective.least_noise, rms)
        sigma[rows] = noise[experiment.name] / scale[rows]
    return noise, sigma


def _along(
    problem: FitProblem, law: HypoelasticLaw, reached: Array, covariance: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Strains and 1-sigma relative uncertainty of each modulus, from that of the unknowns."""
    p = problem.parameters
    moved = p.to_coefficients @ covariance[: p.size, : p.size] @ p.to_coefficients.T
    strains, sigmas = {}, {}
    for name, (first, component) in MODULI.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = np.zeros((POINTS, 12))
        rows[:, first : first + 4] = law.modulus_rows(name, strain)
        rows = rows[:, p.places]
        sigma = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, moved, rows), 0.0))
        strains[name], sigmas[name] = strain, sigma / law.modulus(name, strain)
    return strains, sigmas


def _limited(problem: FitProblem, best: Evaluation) -> list[str]:
    """Moduli on their positivity margin and coefficients on their bounds."""
    p = problem.parameters
    grid, margin = p.positivity
    room = grid @ best.coefficients - margin
    words = []
    for block, name in enumerate(("G12", "E2", "E1")):
        part = slice(GRID * block, GRID * block + GRID)
        if (room[part] <= ON_BOUND * np.maximum(margin[part], 1.0)).any():
            words.append(f"{name} touches its positivity margin: the data ask for less stiffness")
    width = p.upper - p.lower
    low = best.coefficients - p.lower <= ON_BOUND * width
    high = p.upper - best.coefficients <= ON_BOUND * width
    for i in np.flatnonzero(low | high):
        end = "lower" if low[i] else "upper"
        words.append(f"beta_{p.places[i]} lies on its {end} bound")
    return words
