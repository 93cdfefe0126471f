"""The one stiffness that data tell which do not tell warp from fill.

Heights at the centre of a circular sheet are such data: laws along a valley, from E1 above E2 to E1
below E2, fit them alike. All of them have about the curve of one balanced law, E1 = E2, which is
therefore what the data tell. Its modulus is the geometric mean of E1 and E2 within 2 %, if E1 is up
to 2.5 times E2; at 4 times it is 11 % above. (With a given nu12, warp and fill are exchanged with
slightly different moduli.)
"""

from __future__ import annotations

import numpy as np
import scipy

from ..notes import Note, NoteKind, Objection
from .bounded_step import bounded_step
from .linear import PRIOR
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus, reported_moduli

ONE_STIFFNESS = NoteKind(
    "one stiffness",
    weight=18.5,
    objection=Objection(
        "heights at the centre of a circular sheet tell one stiffness, and not warp from fill",
        "add gauges off the apex along warp and fill, strips, or an elliptic rim (bubblefit plan "
        'ranks them), or fit a law of E1 = E2: [law] symmetry = "balanced"',
        unusable=True,
    ),
)
STEPS = 5  # of Gauss and Newton, which start from the best fit
DAMPING = 1e-2  # of the squares of steps of the unknowns, which are of the order of one
EQUALITY = 1e8  # weight of the squared difference of E1 and E2, over their size


def balanced_modulus(
    problem: FitProblem, best: Evaluation, noise: Noise, end: float
) -> ReportedModulus | None:
    """Return the modulus of the law with E1 = E2 that fits the data best, with its band.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit, from which the search starts.
    noise : Noise
    end : float
        Largest log strain of the modulus.

    Returns
    -------
    ReportedModulus or None
        None where an analysis fails.
    """
    unknowns = problem.unknowns
    strain = np.linspace(0.0, end, 11)
    difference = unknowns.modulus_rows("E1", strain) - unknowns.modulus_rows("E2", strain)
    difference /= float(np.abs(difference @ best.unknowns).max() + np.abs(difference).max())
    basis = scipy.linalg.null_space(difference, rcond=1e-9)
    y = basis @ (basis.T @ best.unknowns)
    sigma = noise.residual_sigma
    equality = EQUALITY * difference.T @ difference
    slopes = np.zeros((len(sigma), len(y)))
    for _ in range(STEPS):
        evaluation = problem.evaluate(y, True)
        if evaluation is None or evaluation.jacobian is None:
            return None
        slopes = evaluation.jacobian / sigma[:, None]
        hessian = slopes.T @ slopes + DAMPING * np.eye(len(y)) + equality
        gradient = slopes.T @ (evaluation.residual / sigma) + equality @ y
        step = bounded_step(unknowns, hessian, gradient, y)
        if step is None:
            return None
        y = y + step
    along = slopes @ basis
    precision = along.T @ along + np.eye(basis.shape[1]) / PRIOR**2
    covariance = basis @ np.linalg.inv(precision) @ basis.T
    posterior = Posterior(unknowns, y, y, covariance)
    return reported_moduli(posterior, unknowns.law(problem.law, y), {"E1": strain})["E1"]


def note_of_one_stiffness(modulus: ReportedModulus | None) -> Note:
    """Return the note on data that do not tell warp from fill, with the stiffness they tell."""
    words = "heights at the centre of a circular sheet do not tell warp from fill"
    if modulus is not None:
        values = [
            f"{modulus.value[k]:.4g} MPa ({modulus.lower[k]:.4g} to {modulus.upper[k]:.4g}) at "
            f"{100 * modulus.strain[k]:.2g} %"
            for k in (0, -1)
        ]
        words += (
            f"; they tell one stiffness, that of a balanced sheet with E1 = E2: "
            f"{' and '.join(values)} of strain. It is about the geometric mean of E1 and E2 unless "
            "E1 is several times E2"
        )
    return Note(ONE_STIFFNESS, words)
