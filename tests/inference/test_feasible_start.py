"""inference/starts.py: the first admissible start that can be analysed."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from bubblefit.errors import NoFeasibleStart
from bubblefit.inference.feasible_start import feasible_start
from bubblefit.inference.law_bounds import LawBounds
from bubblefit.inference.starts import RandomStarts, SobolStarts
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import raised
from .cases import CUBIC, LAW, MARGINS, MODEL, Failing, bubble_problem, first_start, fitted_by_lm


def random_starts(unknowns, number, count):
    return np.array(list(islice(RandomStarts().candidates(unknowns, 1, number), count)))


def test_sobol_point_that_fails_is_replaced_by_a_random_start():
    some = list(islice(SobolStarts().candidates(CUBIC, 1, 3), 3))
    np.testing.assert_array_equal(some[1:], random_starts(CUBIC, 3, 2))


def test_problem_begins_where_its_starts_say():
    # A problem begins where its starts say, by default at random.
    for starts in (SobolStarts(), RandomStarts(), None):
        fit = bubble_problem()
        fit.starts = starts or fit.starts
        expected = CUBIC.at(first_start(starts or RandomStarts(), 2))
        np.testing.assert_allclose(feasible_start(fit, 1, 2), expected)


def test_feasible_starts_are_feasible_and_reproducible():
    fit, again = bubble_problem(), bubble_problem()
    a, c = CUBIC.inequalities
    seen = []
    for number in (3, 1, 2):
        y = feasible_start(fit, 1, number)
        assert (a @ y >= c).all()
        assert fit.evaluate(y, False) is not None
        seen.append(y)
    fitted_by_lm(again, feasible_start(again, 1, 4), 1e-3, 10)
    again.reset()
    for number, y in zip((1, 2, 3), (seen[1], seen[2], seen[0]), strict=True):
        assert (feasible_start(again, 1, number) == y).all()
    assert not np.allclose(seen[0], seen[1])
    assert not np.allclose(feasible_start(fit, 2, 1), seen[1])


def test_bounds_without_positive_moduli_give_no_start():
    lower, upper = (end.copy() for end in CUBIC.box)
    lower[7], upper[7] = 0.1, 1.0  # E2 at zero strain below the margin of 5 MPa
    bounds = LawBounds(MARGINS, None, np.array(lower), np.array(upper))
    raised(
        NoFeasibleStart,
        "bounds",
        feasible_start,
        bubble_problem(replace(CUBIC, bounds=bounds)),
        1,
        0,
    )


@pytest.mark.parametrize("how", ["failure", "nan"])
def test_analyses_that_always_fail_give_no_start(how):
    fit = bubble_problem()
    fit.comparisons[0].solver = Failing(lambda run: True, how)
    raised(NoFeasibleStart, "analysis failed", feasible_start, fit, 1, 0)
    assert fit.analyses == 50

    fit = bubble_problem()
    fit.comparisons[0].solver = Failing(lambda run: run <= 2, how)
    assert not (feasible_start(fit, 1, 0) == feasible_start(bubble_problem(), 1, 0)).all()
    assert fit.analyses == 3


def test_unstable_equilibria_are_reported_and_not_started_from():
    soft = LAW.with_beta(np.concatenate([[0.0, 0.0, 0.0, 3.0], LAW.beta[4:]]))
    history = MembraneSolver().run(MODEL, soft)
    differentiated, _ = MembraneSolver().run_with_sensitivity(MODEL, soft)
    assert history.stable is False and differentiated.stable is False
    assert MembraneSolver().run(MODEL, LAW).stable is True
    fit = bubble_problem()
    point = fit.evaluate(CUBIC.at(soft.beta), False)
    assert not point.stable and fit.last_unstable == 1
    assert point.status == "unstable equilibrium at 186 kPa, 251 kPa, 300 kPa"
    fit.comparisons[0].must_be_stable = False
    point = fit.evaluate(CUBIC.at(soft.beta), False)
    assert point.stable and point.status == "ok" and fit.last_unstable == 1
    fit = bubble_problem()
    for number in range(12):
        fit.reset()
        assert fit.evaluate(feasible_start(fit, 1, number), False).stable
