"""One start with a method picked by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import NDArray

from ..errors import InputError
from .approach import approach
from .correction import corrected_fit
from .fit import levenberg_marquardt
from .nonlinear import NloptOptions, nlopt_minimise
from .optimum import Optimum
from .problem import FitProblem

ALGORITHMS: dict[str, Literal["slsqp", "cobyla"]] = {"slsqp": "slsqp", "cobyla": "cobyla"}
METHODS = ("lm", *ALGORITHMS)


@dataclass(frozen=True)
class FitOptions:
    """How each start is fitted; see the [fit] section of a project file.

    max_runs : of a solver that a differentiating surrogate leads to the least of its objective.
    """

    method: str = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    tolerance: float = 1e-7
    max_analyses: int = 100
    max_runs: int = 10


def fit_from(problem: FitProblem, start: NDArray, options: FitOptions) -> Optimum | None:
    """Fit from the unknowns `start`; None when the analysis at the start fails.

    Raises
    ------
    InputError : a method of another name.
    """
    if options.method == "lm":
        limits = options.tolerance, options.max_analyses
        y = approach(problem.surrogate or problem, start, *limits)
        if problem.surrogate is not None:
            return corrected_fit(problem, y, *limits, options.max_runs)
        return levenberg_marquardt(problem, y, *limits)
    if options.method in ALGORITHMS:
        nlopt_options = NloptOptions(
            ALGORITHMS[options.method],
            options.gradient if problem.surrogate is None else "differences",
            options.constraints,
        )
        return nlopt_minimise(
            problem, start, options.tolerance, options.max_analyses, nlopt_options
        )
    raise InputError(None, "method", f"{options.method!r} is not one of {', '.join(METHODS)}")
