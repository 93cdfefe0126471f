"""The one stiffness that data tell which do not tell warp from fill.

Heights at the centre of a circular sheet are such data: laws along a valley, from E1 above E2 to E1
below E2, fit them alike. All of them have about the curve of one balanced law, E1 = E2, which is
therefore what the data tell. Its modulus is the geometric mean of E1 and E2 within 2 %, if E1 is up
to 2.5 times E2; at 4 times it is 11 % above. (With a given nu12, warp and fill are exchanged with
slightly different moduli.) It falls with G12, by 3 % where this is an eighth of E, 12 % at two
thirds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ..materials.forms.base import Array
from ..notes import Note, NoteKind, Objection
from .bounded_step import bounded_step
from .linear import PRIOR
from .noise import Noise
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus

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


@dataclass(frozen=True)
class BalancedSearch:
    """Settings of the search for balanced laws, each with a shear modulus of its own.

    G12 changes the stiffness by percents, and heights at the centre hardly tell it.
    """

    shear_moduli: int = 5  # evenly spaced logarithms between the bounds of G12
    least_laws: int = 3  # a sheet that is too soft in shear may have no equilibrium
    max_steps: int = 8  # of Gauss and Newton, for each
    damping: float = 1e-2  # of the squares of steps of the unknowns, which are of the order of one
    converged: float = 1e-4  # largest last step of an unknown
    equality: float = 1e8  # weight of a squared difference of moduli over their size
    draws: int = 1000


SEARCH = BalancedSearch()


@dataclass(frozen=True, eq=False)
class BalancedLaw:
    """The balanced law of one shear modulus that fits best.

    Attributes
    ----------
    shear_modulus : float, MPa
    misfit : float
        Sum of squares of the residuals over their noise.
    modulus, sigma : (n,) arrays, MPa
        E1 = E2 along the strain, and its standard deviation by the noise.
    """

    shear_modulus: float
    misfit: float
    modulus: Array
    sigma: Array


def balanced_modulus(
    problem: FitProblem, best: Evaluation, noise: Noise, end: float
) -> ReportedModulus | None:
    """Return the modulus of laws with E1 = E2 that fit the data, with its band.

    G12 may be any between its bounds: its logarithm counts as evenly distributed but for the data.

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
        None where analyses fail.
    """
    unknowns = problem.unknowns
    strain = np.linspace(0.0, end, 11)
    smallest, largest = (unknowns.modulus_limits("G12", np.zeros(1), sign)[0] for sign in (-1, 1))
    shear_moduli = np.geomspace(max(smallest, 1e-3 * largest), largest, SEARCH.shear_moduli)
    laws: list[BalancedLaw] = []
    y = best.unknowns
    for shear_modulus in shear_moduli:
        fit = _balanced_fit(problem, y, noise.residual_sigma, strain, shear_modulus)
        if fit is not None:
            y, law = fit
            laws.append(law)
    if len(laws) < SEARCH.least_laws:
        return None
    samples = _samples(laws)
    return ReportedModulus.of_samples(strain, np.median(samples, axis=0), samples, "E1", unknowns)


def _balanced_fit(
    problem: FitProblem, y: Array, sigma: Array, strain: Array, shear_modulus: float
) -> tuple[Array, BalancedLaw] | None:
    """Return the unknowns of the balanced law of a constant G12 that fits best, and the law."""
    unknowns = problem.unknowns
    warp = unknowns.modulus_rows("E1", strain)
    shear = unknowns.modulus_rows("G12", strain) / shear_modulus
    difference = (warp - unknowns.modulus_rows("E2", strain)) / (warp @ y).mean()
    equations = np.concatenate([difference, shear])
    values = np.repeat([0.0, 1.0], len(strain))
    equality = SEARCH.equality * equations.T @ equations
    y = y + np.linalg.lstsq(equations, values - equations @ y, rcond=1e-9)[0]
    basis = scipy.linalg.null_space(equations, rcond=1e-9)
    misfit = np.inf
    for _ in range(SEARCH.max_steps):
        evaluation = problem.evaluate(y, True)
        if evaluation is None or evaluation.jacobian is None:
            return None
        residual = evaluation.residual / sigma
        slopes = evaluation.jacobian / sigma[:, None]
        misfit = float(residual @ residual)
        hessian = slopes.T @ slopes + SEARCH.damping * np.eye(len(y)) + equality
        step = bounded_step(unknowns, hessian, slopes.T @ residual, y)
        if step is None:
            return None
        y = y + step
        if np.abs(step).max() < SEARCH.converged:
            break
    along = slopes @ basis
    precision = along.T @ along + np.eye(basis.shape[1]) / PRIOR**2
    rows = warp @ basis
    variance = ((rows @ np.linalg.inv(precision)) * rows).sum(axis=1)
    return y, BalancedLaw(shear_modulus, misfit, warp @ y, np.sqrt(variance))


def _samples(laws: Sequence[BalancedLaw]) -> Array:
    """Return samples (draws, n) of the modulus, between laws by the logarithm of G12."""
    random = np.random.default_rng(0)
    places = np.log([law.shear_modulus for law in laws])
    drawn = np.linspace(places[0], places[-1], SEARCH.draws)
    misfit = np.interp(drawn, places, [law.misfit for law in laws])
    weight = np.exp(-0.5 * (misfit - misfit.min()))
    drawn = random.choice(drawn, SEARCH.draws, p=weight / weight.sum())
    rows = [np.hstack([law.modulus, law.sigma]) for law in laws]
    curves = scipy.interpolate.PchipInterpolator(places, rows)
    modulus, sigma = np.split(curves(drawn), 2, axis=1)
    return modulus + sigma * random.standard_normal((len(drawn), 1))


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
            "; they tell one stiffness, that of a balanced sheet with E1 = E2 and any G12 between "
            f"its bounds: {' and '.join(values)} of strain. It is about the geometric mean of E1 "
            "and E2 unless E1 is several times E2"
        )
    return Note(ONE_STIFFNESS, words)
