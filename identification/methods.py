"""One start with a method picked by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from numpy.typing import NDArray

from ..errors import InputError
from .fit import levenberg_marquardt
from .nonlinear import NloptOptions, nlopt_minimise
from .optimum import Optimum
from .problem import FieldProblem

ALGORITHMS: dict[str, Literal["slsqp", "cobyla"]] = {"slsqp": "slsqp", "cobyla": "cobyla"}
METHODS = ("lm", *ALGORITHMS)


@dataclass(frozen=True)
class FitOptions:
    """How each start is fitted; see the [fit] section of a project file."""

    method: str = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    tolerance: float = 1e-7
    max_analyses: int = 100


def fit_from(problem: FieldProblem, start: NDArray, options: FitOptions) -> Optimum | None:
    """Fit from the unknowns `start`; None when the analysis at the start fails.

    Raises
    ------
    InputError : a method of another name.
    """
    if options.method == "lm":
        return levenberg_marquardt(problem, start, options.tolerance, options.max_analyses)
    if options.method in ALGORITHMS:
        nlopt_options = NloptOptions(
            ALGORITHMS[options.method], options.gradient, options.constraints
        )
        return nlopt_minimise(
            problem, start, options.tolerance, options.max_analyses, nlopt_options
        )
    raise InputError(None, "method", f"{options.method!r} is not one of {', '.join(METHODS)}")
