"""Fit nuisance parameters (as offsets) of a given law, and report what data say of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..materials.forms.base import Array, components_of
from ..materials.law import HypoelasticLaw
from ..notes import Note
from .comparison import Comparison
from .descent import descend
from .nuisance import Nuisance
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .reported import UNCERTAIN, bound_reached
from .unknowns import LawBounds, Unknowns

#: MPa: the law is not looked for; these bounds only size the unknowns.
WIDE_BOUNDS = {"E1": (1e-3, 1e6), "E2": (1e-3, 1e6), "G12": (1e-3, 1e6)}


def problem_at(law: HypoelasticLaw, comparisons: Sequence[Comparison]) -> tuple[FitProblem, Array]:
    """Return a fit problem about a given law, and the unknowns that make this law.

    Parameters
    ----------
    law : HypoelasticLaw
    comparisons : sequence of Comparison
        The tests with which the law is compared.

    Returns
    -------
    FitProblem
    (unknowns,) array
        Unknowns of that law, with the nuisance parameters at their `begin`.
    """
    ends = law.strain_range.tolist()
    bounds = LawBounds.of_moduli(WIDE_BOUNDS)
    unknowns = Unknowns.of(law.form, law.nu12, ends, bounds, comparisons)
    y = unknowns.at(law.beta[list(unknowns.free)])
    return FitProblem(tuple(comparisons), law, unknowns), y


def fit_nuisance(
    problem: FitProblem,
    y: Array,
    with_jacobian: bool = False,
    *,
    tolerance: float = 1e-9,
    max_analyses: int = 40,
) -> tuple[Evaluation | None, str]:
    """Evaluate the law of given unknowns with its best-fitting nuisance parameters.

    Parameters
    ----------
    problem : FitProblem
    y : (unknowns,) array
        The law, and where the nuisance parameters begin; they stay there if the problem's solver
        gives no derivatives.
    with_jacobian : bool
        Whether to compute the Jacobian even where no nuisance parameter is fitted.
    tolerance : float
        Value of the objective e at which the fit ends.
    max_analyses : int
        Value of `problem.analyses` at which a first descent, of least squares, ends; and number of
        further analyses that a second one, of e itself, may take.

    Returns
    -------
    Evaluation or None
        None where an analysis failed.
    str
        The status with which the descent ended, "" without a descent.
    """
    if not problem.unknowns.nuisance.all or not problem.differentiates:
        return problem.evaluate(y, with_jacobian, warm=False), ""
    first = problem.evaluate(y, True)
    if first is None:
        return None, ""
    is_nuisance = np.arange(problem.unknowns.count) >= problem.unknowns.size
    # Squares lead to the optimum of e, the sum of norms, from further away.
    least_squares, _ = descend(problem, first, tolerance, max_analyses, may_change=is_nuisance)
    limit = problem.analyses + max_analyses
    return descend(
        problem,
        least_squares,
        tolerance,
        limit,
        norms=True,
        may_change=is_nuisance,
    )


NORMAL_95 = 1.96  # standard deviations to either end of a 95 % band
UNIFORM_SIGMA = 12**-0.5  # standard deviation of a uniform distribution of width one
INFORMED_SHARE = 0.9  # of a prior: if the data leave a larger share of it, they determine nothing
WORTHWHILE_CORRELATION = 0.5  # smallest correlation that is reported


@dataclass(frozen=True, kw_only=True)
class NuisanceVerdict(Nuisance):
    """A fitted nuisance parameter; with several comparisons its name begins with the comparison's.

    Attributes
    ----------
    value, sigma : float
        Estimate and standard deviation, in `unit`.
    correlation : dict of float
        Correlation with each modulus in the middle of its strains, and of a parameter of a deck
        with the others.
    """

    value: float
    sigma: float
    correlation: dict[str, float]

    @property
    def bound_reached(self) -> str:
        """Return the bound on which the value lies ("lower", "upper"), "" for none."""
        return bound_reached(self.value, self.lower, self.upper)

    @property
    def band(self) -> tuple[float, float]:
        """Return the ends of the 95 % band, within the bounds."""
        half = NORMAL_95 * self.sigma
        return max(self.value - half, self.lower), min(self.value + half, self.upper)

    @property
    def half_widths(self) -> tuple[float, float]:
        """Return how far the ends of the band are from the value."""
        lower, upper = self.band
        return self.value - lower, upper - self.value

    @property
    def determined(self) -> bool:
        """Return whether the data tell more than the prior, or the bounds, did before."""
        if self.prior is not None:
            return self.sigma < INFORMED_SHARE * self.prior
        return self.sigma < UNIFORM_SIGMA * (self.upper - self.lower)

    @property
    def words(self) -> str:
        """Return value and uncertainty, or that the data say nothing of it."""
        unit = f" {self.unit}" if self.unit else ""
        value = f"{self.value:.4g}{unit}" + (
            f", on its {self.bound_reached} bound" if self.bound_reached else ""
        )
        if self.determined:
            pairs = [("", 0.0), *self.correlation.items()]
            name, rho = max(pairs, key=lambda pair: abs(pair[1]))
            correlation = f", correlation {rho:.2f} with {name}"
            if abs(rho) < WORTHWHILE_CORRELATION:
                correlation = ""
            return f"{value}, 1 sigma {self.sigma:.2g}{unit}{correlation}"
        prior = f"it may be {self.lower:.4g} to {self.upper:.4g}{unit}"
        if self.prior is not None:
            prior = f"known to {self.prior:.2g}{unit} before"
        hint = f"; {self.hint}" if self.hint else ""
        return f"{value}: the data say nothing of it ({prior}){hint}"

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the verdict as it is written to `result.json`."""
        return {
            "value": self.value,
            "unit": self.unit,
            "sigma": self.sigma,
            "bounds": [self.lower, self.upper],
            "prior": self.prior,
            "on_bound": self.bound_reached or None,
            "determined": self.determined,
            "correlation": self.correlation,
            "verdict": self.words,
        }


def verdicts(posterior: Posterior, ends: Array) -> tuple[NuisanceVerdict, ...]:
    """Return a verdict for each nuisance parameter of a fit.

    Parameters
    ----------
    posterior : Posterior
        Distribution of the unknowns of the fit.
    ends : (3,) array
        Log strains (eps1, eps2, gamma12) up to which the moduli are known.
    """
    unknowns = posterior.unknowns
    covariance = posterior.covariance
    size = unknowns.size
    middle = 0.5 * np.asarray(ends, dtype=float)
    slopes = {
        name: unknowns.coefficient_rows(name, middle[[component]])[0] @ unknowns.to_coefficients
        for name, component in components_of(unknowns.form).items()
    }
    law_covariance = covariance[:size, :size]
    modulus_sigma = {
        name: float(np.sqrt(slope @ law_covariance @ slope)) for name, slope in slopes.items()
    }
    all_verdicts = []
    pairs = zip(unknowns.nuisance.names, unknowns.nuisance.all, strict=True)
    for k, (name, nuisance) in enumerate(pairs, start=size):
        sigma = float(np.sqrt(covariance[k, k]))
        value = float(posterior.best[k])
        correlation = {}
        for modulus, slope in slopes.items():
            product = max(sigma * modulus_sigma[modulus], 1e-300)
            correlation[modulus] = float(slope @ covariance[:size, k]) / product
        if nuisance.drawn:
            row = posterior.correlations[k, size:]
            others = zip(unknowns.nuisance.names, row.tolist(), strict=True)
            correlation |= {other: rho for other, rho in others if other != name}
        fields = {**vars(nuisance), "name": name, "correlation": correlation}
        all_verdicts.append(NuisanceVerdict(**fields, value=value, sigma=sigma))
    return tuple(all_verdicts)


def notes_of_verdicts(verdicts: Sequence[NuisanceVerdict]) -> list[Note]:
    """Return notes on nuisance parameters that the data do not determine."""
    return [
        Note(UNCERTAIN, f"{verdict.name} is {verdict.words}")
        for verdict in verdicts
        if not verdict.determined and (verdict.shared or verdict.prior is None)
    ]
