"""A given law in a fit: only its nuisance (offsets, the sheet's surface) is fitted to the tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .comparison import Comparison
from .descent import descend
from .law_bounds import LawBounds
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

#: MPa: the law is not looked for; these bounds only size the unknowns.
WIDE_BOUNDS = {"E1": (1e-3, 1e6), "E2": (1e-3, 1e6), "G12": (1e-3, 1e6)}


def problem_at(law: HypoelasticLaw, comparisons: Sequence[Comparison]) -> tuple[FitProblem, Array]:
    """Return comparisons with a given law as a problem.

    Parameters
    ----------
    law : HypoelasticLaw
    comparisons : sequence of Comparison

    Returns
    -------
    FitProblem
    (unknowns,) array
        The unknowns of the law, nuisance at its beginning.
    """
    ends = law.strain_range.tolist()
    bounds = LawBounds.of_moduli(WIDE_BOUNDS)
    unknowns = Unknowns.of(law.form, law.nu12, ends, bounds, comparisons)
    y = unknowns.at(law.beta[list(unknowns.free)])
    return FitProblem(tuple(comparisons), law, unknowns), y


def evaluate_law(problem: FitProblem, y: Array, with_jacobian: bool = False) -> Evaluation | None:
    """Evaluate the law of given unknowns with its best-fitting nuisance.

    Parameters
    ----------
    problem : FitProblem
    y : (unknowns,) array
        Its nuisance stays where the problem's solver gives no derivatives.
    with_jacobian : bool
        Whether to differentiate where nothing is fitted.

    Returns
    -------
    Evaluation or None
        None where an analysis failed.
    """
    return fit_nuisance(problem, y, with_jacobian)[0]


def fit_nuisance(
    problem: FitProblem,
    y: Array,
    with_jacobian: bool = False,
    *,
    tolerance: float = 1e-9,
    max_analyses: int = 40,
) -> tuple[Evaluation | None, str]:
    """Fit the nuisance to the tests with the law of given unknowns.

    Parameters
    ----------
    problem : FitProblem
    y : (unknowns,) array
    with_jacobian : bool
        Whether to differentiate where nothing is fitted.
    tolerance : float
        Value of e at which the fit ends.
    max_analyses : int
        Of the problem by the end of a first descent, and further ones in a second.

    Returns
    -------
    Evaluation or None
        See `evaluate_law`.
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
    return descend(problem, least_squares, tolerance, limit, norms=True, may_change=is_nuisance)
