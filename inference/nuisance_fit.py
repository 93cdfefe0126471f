"""Compare a given law with tests: only the nuisance parameters (as offsets) are fitted."""

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


def evaluate_law(problem: FitProblem, y: Array, with_jacobian: bool = False) -> Evaluation | None:
    """Evaluate the law of given unknowns with its best-fitting nuisance parameters.

    Parameters
    ----------
    problem : FitProblem
    y : (unknowns,) array
        Its nuisance parameters are kept if the problem's solver gives no derivatives.
    with_jacobian : bool
        Whether to compute the Jacobian even where no nuisance parameter is fitted.

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
    """Fit the nuisance parameters to the tests with the law of given unknowns.

    Parameters
    ----------
    problem : FitProblem
    y : (unknowns,) array
        The law, and where the nuisance parameters begin.
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
