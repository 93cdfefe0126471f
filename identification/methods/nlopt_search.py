"""A search by one of NLopt's algorithms on the objective e, with linear or boolean constraints."""

from __future__ import annotations

import nlopt
import numpy as np
from numpy.typing import NDArray

from ..optimum import ANALYSES_USED_UP, CONVERGED, Optimum
from ..problem import FitProblem
from .base import FitOptions
from .nlopt_record import CONSTRAINT_TOLERANCE, BelowTolerance, NoMoreAnalyses, Record

Array = NDArray[np.float64]

FLAG_TOLERANCE = 1e-8
RELATIVE_E, RELATIVE_X = 1e-10, 1e-12


def nlopt_minimise(
    algorithm: int,
    problem: FitProblem,
    start: Array,
    options: FitOptions,
    first_step: float | None = None,
) -> Optimum | None:
    """Minimise e from the unknowns `start`; None when the analysis at the start fails.

    The returned point is the best feasible, stable one that was seen, whatever NLopt itself says.

    Parameters
    ----------
    algorithm : NLopt's number. first_step : of each bound's width; NLopt's own unless given.
    """
    problem.warm_starts = False  # e has to be a function of the point alone
    first = problem.evaluate(start, False)
    if first is None:
        return None
    record = Record(problem, first, options)
    optimiser = nlopt.opt(algorithm, len(start))

    def objective(x: Array, gradient: Array) -> float:
        look = record.at(x, gradient.size > 0)
        if gradient.size:
            gradient[:] = look.slope
        return look.value

    optimiser.set_min_objective(objective)
    x = record.variables(start)
    if options.constraints == "margin":
        _constrain(optimiser, record)
    else:
        low, high = record.box()
        x = np.clip(x, low, high)
        optimiser.set_lower_bounds(low)
        optimiser.set_upper_bounds(high)
        _flag(optimiser, record)
    optimiser.set_maxeval(options.max_analyses)
    optimiser.set_ftol_rel(RELATIVE_E)
    optimiser.set_xtol_rel(RELATIVE_X)
    if first_step is not None:
        optimiser.set_initial_step(first_step)
    try:
        optimiser.optimize(x)
        status = f"nlopt {optimiser.last_optimize_result()}"
    except BelowTolerance:
        status = CONVERGED
    except NoMoreAnalyses:
        status = ANALYSES_USED_UP
    except (nlopt.RoundoffLimited, RuntimeError, ValueError) as error:
        status = f"nlopt stopped: {type(error).__name__}"
    return Optimum(record.best, status, problem.analyses)


def _constrain(optimiser: nlopt.opt, record: Record) -> None:
    """The linear inequalities of the unknowns, as NLopt's variables see them."""
    a, c = record.problem.unknowns.inequalities
    rows = a @ record.basis
    limit = c - a @ record.origin

    def linear(result: Array, x: Array, gradient: Array) -> None:
        result[:] = limit - rows @ x
        if gradient.size:
            gradient[:] = -rows

    optimiser.add_inequality_mconstraint(linear, np.full(len(rows), CONSTRAINT_TOLERANCE))


def _flag(optimiser: nlopt.opt, record: Record) -> None:
    """Two flags without a slope: positive moduli, and an analysis that ends well (Eq. 4.9)."""

    def positive(x: Array, gradient: Array) -> float:
        gradient[:] = 0.0
        return -1.0 if record.at(x, False).positive else 1.0

    def analysed(x: Array, gradient: Array) -> float:
        gradient[:] = 0.0
        return -1.0 if record.at(x, False).analysed else 1.0

    optimiser.add_inequality_constraint(positive, FLAG_TOLERANCE)
    optimiser.add_inequality_constraint(analysed, FLAG_TOLERANCE)
