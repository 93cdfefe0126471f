"""How good a fit is: moduli against a known solution, and what the data could not determine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..materials.law import MODULI, HypoelasticLaw
from ..materials.positivity import GRID
from .problem import Evaluation, FieldProblem

Array = NDArray[np.float64]

POINTS = 61
#: White noise of a displacement component assumed where the data are exact, mm.
NOISE = 0.05
#: A modulus less certain than this (1 sigma, relative) anywhere is said to be undetermined.
UNCERTAIN = 0.25
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
    """1-sigma relative uncertainty of each modulus along (0 ... reached), and plain words."""

    noise_mm: float
    strain: dict[str, Array]
    sigma: dict[str, Array]
    undetermined: tuple[str, ...]


def certainty(
    problem: FieldProblem, best: Evaluation, law: HypoelasticLaw, reached: Array
) -> Certainty:
    """Linear propagation of displacement noise to the moduli.

    The noise is the RMS misfit in mm, but not less than 0.05 mm: a misfit of zero (computed data)
    does not mean that a measurement would determine everything. Assumes white noise; a misfit
    that is systematic makes the moduli less certain than this says.
    """
    assert best.jacobian is not None
    scale = np.concatenate(
        [
            np.repeat(s, len(t.displacement))
            for t, s in zip(problem.objective.targets, problem.objective.scales, strict=True)
        ]
    )
    misfit = best.residual * scale
    noise = max(NOISE, float(np.sqrt(np.mean(misfit**2))))
    # The objective weighs the blocks; the covariance is that of the weighted estimate.
    j = best.jacobian
    inverse = np.linalg.pinv(j.T @ j, rcond=1e-13)
    estimator = inverse @ j.T / scale[None, :]
    covariance = noise**2 * estimator @ estimator.T
    p = problem.parameters
    moved = p.to_coefficients @ covariance[: p.size, : p.size] @ p.to_coefficients.T
    strains, sigmas, words = {}, {}, []
    for name, (first, component) in MODULI.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = np.zeros((POINTS, 12))
        rows[:, first : first + 4] = np.vander(strain, 4)
        rows = rows[:, p.places]
        sigma = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, moved, rows), 0.0))
        relative = sigma / law.modulus(name, strain)
        strains[name], sigmas[name] = strain, relative
        weak = np.flatnonzero(relative > UNCERTAIN)
        if len(weak):
            words.append(
                f"{name} is uncertain by up to {100 * relative.max():.0f} % (1 sigma at "
                f"{noise:.2g} mm noise), worst at strain {strain[relative.argmax()]:.3f}"
            )
    words += _limited(problem, best)
    return Certainty(noise, strains, sigmas, tuple(words))


def _limited(problem: FieldProblem, best: Evaluation) -> list[str]:
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
