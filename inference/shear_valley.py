"""Bands of E1 and E2 where the data leave the shear modulus open.

Heights of a few gauges hardly tell G12, on which E1 and E2 depend along a curved valley: no normal
distribution about one law describes it. A law is therefore fitted at each of some values of G12
between its bounds. The logarithm of G12 counts as evenly distributed but for the misfit of these
laws, about each of which E1 and E2 are normal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ..materials.forms.base import SHEAR, Array
from ..materials.law import HypoelasticLaw
from .bounded_step import bounded_step
from .linear import PRIOR
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus


@dataclass(frozen=True)
class ShearSearch:
    """Settings of the search for laws, each with a shear modulus of its own."""

    shear_moduli: int = 5  # evenly spaced logarithms between the bounds of G12
    least_laws: int = 3  # a sheet that is too soft in shear may have no equilibrium
    max_steps: int = 8  # of Gauss and Newton, for each
    damping: float = 1e-2  # of the squares of steps of the unknowns, which are of the order of one
    converged: float = 1e-4  # largest last step of an unknown
    equality: float = 1e8  # weight of a squared difference of moduli over their size
    draws: int = 1000


SEARCH = ShearSearch()


@dataclass(frozen=True, eq=False)
class ShearLaw:
    """The law of one shear modulus that fits best.

    Attributes
    ----------
    shear_modulus : float, MPa
    misfit : float
        Sum of squares of the residuals over their noise.
    moduli, sigma : dict of (n,) arrays, MPa
        E1 and E2 along their strains, and their standard deviations by the noise.
    """

    shear_modulus: float
    misfit: float
    moduli: Mapping[str, Array]
    sigma: Mapping[str, Array]


def laws_by_shear(
    problem: FitProblem,
    best: Evaluation,
    sigma: Array,
    strains: Mapping[str, Array],
    *,
    is_balanced: bool = False,
) -> list[ShearLaw]:
    """Return the best laws for shear moduli between their bounds; few or none where it fails.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit, from which the search starts.
    sigma : (m,) array
        Noise of the residuals.
    strains : mapping of (n,) arrays
        Log strains of E1 and of E2.
    is_balanced : bool
        Whether E1 = E2 is demanded.
    """
    smallest, largest = (
        float(problem.unknowns.modulus_limits(SHEAR, np.zeros(1), sign)[0]) for sign in (-1.0, 1.0)
    )
    shear_moduli = np.geomspace(max(smallest, 1e-3 * largest), largest, SEARCH.shear_moduli)
    laws: list[ShearLaw] = []
    y = best.unknowns
    for shear_modulus in shear_moduli:
        equations, values = _equations(problem, y, strains["E1"], shear_modulus, is_balanced)
        fit = _fit(problem, y, sigma, equations, values)
        if fit is None:
            continue
        y, misfit, covariance = fit
        rows = {name: problem.unknowns.modulus_rows(name, x) for name, x in strains.items()}
        moduli = {name: r @ y for name, r in rows.items()}
        variances = {name: ((r @ covariance) * r).sum(axis=1) for name, r in rows.items()}
        deviations = {name: np.sqrt(variance) for name, variance in variances.items()}
        laws.append(ShearLaw(float(shear_modulus), misfit, moduli, deviations))
    return laws if len(laws) >= SEARCH.least_laws else []


def _equations(
    problem: FitProblem, y: Array, strain: Array, shear_modulus: float, is_balanced: bool
) -> tuple[Array, Array]:
    """Return rows and values of rows @ y = values: a constant G12, and E1 = E2 if demanded."""
    unknowns = problem.unknowns
    rows = unknowns.modulus_rows(SHEAR, strain) / shear_modulus
    values = np.ones(len(rows))
    if is_balanced:
        warp = unknowns.modulus_rows("E1", strain)
        difference = (warp - unknowns.modulus_rows("E2", strain)) / (warp @ y).mean()
        rows = np.concatenate([rows, difference])
        values = np.concatenate([values, np.zeros(len(difference))])
    return rows, values


def _fit(
    problem: FitProblem, y: Array, sigma: Array, equations: Array, values: Array
) -> tuple[Array, float, Array] | None:
    """Return the best unknowns with these equations, their misfit and covariance."""
    equality = SEARCH.equality * equations.T @ equations
    y = y + np.linalg.lstsq(equations, values - equations @ y, rcond=1e-9)[0]
    for _ in range(SEARCH.max_steps):
        evaluation = problem.evaluate(y, True)
        if evaluation is None or evaluation.jacobian is None:
            return None
        residual = evaluation.residual / sigma
        slopes = evaluation.jacobian / sigma[:, None]
        hessian = slopes.T @ slopes + SEARCH.damping * np.eye(len(y)) + equality
        step = bounded_step(problem.unknowns, hessian, slopes.T @ residual, y)
        if step is None:
            return None
        y = y + step
        if np.abs(step).max() < SEARCH.converged:
            break
    basis = scipy.linalg.null_space(equations, rcond=1e-9)
    along = slopes @ basis
    precision = along.T @ along + np.eye(basis.shape[1]) / PRIOR**2
    return y, float(residual @ residual), basis @ np.linalg.inv(precision) @ basis.T


def samples_over_shear(laws: Sequence[ShearLaw], name: str) -> Array:
    """Return samples (draws, n) of E1 or E2, MPa, between laws by the logarithm of G12."""
    random = np.random.default_rng(0)
    places = np.log([law.shear_modulus for law in laws])
    logarithms = np.linspace(places[0], places[-1], SEARCH.draws)
    misfit = np.interp(logarithms, places, [law.misfit for law in laws])
    weight = np.exp(-0.5 * (misfit - misfit.min()))
    draws = random.choice(logarithms, SEARCH.draws, p=weight / weight.sum())
    rows = [np.hstack([law.moduli[name], law.sigma[name]]) for law in laws]
    curves = scipy.interpolate.PchipInterpolator(places, rows)
    modulus, sigma = np.split(curves(draws), 2, axis=1)
    return np.asarray(modulus + sigma * random.standard_normal((len(draws), 1)))


def moduli_over_shear(
    problem: FitProblem,
    best: Evaluation,
    sigma: Array,
    law: HypoelasticLaw,
    strains: Mapping[str, Array],
    mesh: Mapping[str, Array] | None,
) -> dict[str, ReportedModulus]:
    """Return E1 and E2 of a law with their bands over all G12; empty where analyses fail.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit.
    sigma : (m,) array
        Noise of the residuals.
    law : HypoelasticLaw
        The law that is reported.
    strains : mapping of (n,) arrays
        Log strains of E1 and of E2.
    mesh : mapping of (n,) arrays or None
        Relative change of the moduli to the limit of ever finer meshes.
    """
    strains = {name: strains[name] for name in ("E1", "E2")}
    laws = laws_by_shear(problem, best, sigma, strains)
    moduli = {}
    for name, strain in strains.items() if laws else ():
        samples = samples_over_shear(laws, name) * (1.0 if mesh is None else 1.0 + mesh[name])
        value = law.modulus(name, strain)
        moduli[name] = ReportedModulus.of_samples(strain, value, samples, name, problem.unknowns)
    return moduli
