"""Where starts begin: the same by number, even by Sobol, and where earlier ones were good."""

from __future__ import annotations

import pickle
import sys
from itertools import islice
from typing import Any

import numpy as np
import pytest
from bubblefit.inference.search import feasible_start
from bubblefit.inference.unknowns import (
    ProposedStarts,
    RandomStarts,
    SobolStarts,
    _places,
    allowed,
    coefficients_at,
    dimensions,
)
from scipy.stats import qmc

from ..complaints import complaint
from .cases import CONSTANT, CUBIC, problem


def first(starts: Any, number: int, seed: int = 1, unknowns: Any = CUBIC) -> np.ndarray:
    return next(iter(starts.candidates(unknowns, seed, number)))


def test_a_start_of_a_sequence_is_its_point_whichever_others_there_are() -> None:
    """The allowed points of one sequence, in its order, one a start."""
    sequence = qmc.Sobol(dimensions(CUBIC), seed=7)
    points = coefficients_at(CUBIC, sequence.random(2048))
    good = points[allowed(CUBIC, points)]
    assert 20 < len(good) < 1000  # they are sought in several batches
    for number in (0, 1, 5, 19, len(good) - 1):
        np.testing.assert_array_equal(first(SobolStarts(), number, 7), good[number])
    assert not np.allclose(first(SobolStarts(), 0, 8), good[0])


def test_a_point_that_cannot_be_analysed_is_replaced_by_a_random_one() -> None:
    some = list(islice(SobolStarts().candidates(CUBIC, 1, 3), 3))
    np.testing.assert_array_equal(some[1:], list(islice(RandomStarts().candidates(CUBIC, 1, 3), 2)))


def test_a_sequence_is_more_even_than_chance() -> None:
    def unevenness(starts: Any) -> float:
        lower, upper = CONSTANT.box
        points = np.array([first(starts, n, unknowns=CONSTANT) for n in range(32)])
        return float(qmc.discrepancy((points - lower) / (upper - lower)))

    assert unevenness(SobolStarts()) < 0.5 * unevenness(RandomStarts())


def test_a_problem_begins_where_it_says() -> None:
    fit, even = problem(), problem()
    even.starts = SobolStarts()
    np.testing.assert_allclose(feasible_start(even, 1, 2), CUBIC.at(first(SobolStarts(), 2)))
    np.testing.assert_allclose(feasible_start(fit, 1, 2), CUBIC.at(first(RandomStarts(), 2)))


# Proposed ones

#: A valley at E2 = 400 MPa, whatever the others: objectives of earlier evaluations.
GRID = np.array([[g, e2, e1] for g in (5.0, 20.0, 80.0) for e2 in np.geomspace(60, 900, 12)
                 for e1 in (100.0, 500.0, 1400.0)])  # fmt: skip


def valley(coefficients: np.ndarray) -> np.ndarray:
    return np.abs(np.log(coefficients[:, 1] / 400.0)) + 1e-3


def proposed(coefficients: np.ndarray = GRID) -> ProposedStarts:
    return ProposedStarts(coefficients, valley(coefficients))


def test_a_proposed_start_is_the_most_promising_of_its_own_candidates() -> None:
    starts = proposed()
    mine = np.array(list(islice(RandomStarts().candidates(CONSTANT, 1, 4), 64)))
    expected = starts.predicted(CONSTANT, mine)
    found = list(islice(starts.candidates(CONSTANT, 1, 4), 66))
    np.testing.assert_array_equal(found[:64], mine[np.argsort(expected, kind="stable")])
    np.testing.assert_array_equal(  # then those that come anyway
        found[64:], list(islice(RandomStarts().candidates(CONSTANT, 1, 4), 66))[64:]
    )


def test_proposed_starts_lie_in_the_valley_and_differ() -> None:
    starts = np.array([first(proposed(), n, unknowns=CONSTANT) for n in range(8)])
    random = np.array([first(RandomStarts(), n, unknowns=CONSTANT) for n in range(8)])
    assert np.median(valley(starts)) < 0.3 * np.median(valley(random))
    assert len(np.unique(starts[:, 0])) == len(np.unique(starts[:, 2])) == 8


def test_what_is_predicted_where_something_is_known_is_that() -> None:
    np.testing.assert_allclose(
        proposed().predicted(CONSTANT, GRID[:5]), np.log10(valley(GRID[:5])), rtol=1e-12
    )


def test_few_evaluations_do_and_perfect_ones() -> None:
    one = ProposedStarts(GRID[:1], np.zeros(1))  # an objective of zero has no logarithm
    assert np.isfinite(one.predicted(CONSTANT, GRID)).all()
    assert len(list(islice(one.candidates(CONSTANT, 1, 0), 3))) == 3


def test_proposals_cross_the_border_of_a_process() -> None:
    starts = proposed()
    here = first(starts, 3, unknowns=CONSTANT)  # makes its regression
    there = first(pickle.loads(pickle.dumps(starts)), 3, unknowns=CONSTANT)
    np.testing.assert_array_equal(here, there)


def test_without_scikit_learn_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    said = complaint(ProposedStarts, GRID, valley(GRID))
    assert said == (
        "fit.starts_from: scikit-learn is not installed; pip install 'bubblefit[proposals]'"
    )


def test_places_are_the_logarithms_of_moduli_of_any_form() -> None:
    """Twice the moduli is the same step everywhere."""
    some = np.array(list(islice(RandomStarts().candidates(CUBIC, 1, 0), 4)))
    np.testing.assert_allclose(
        _places(CUBIC, 2 * some) - _places(CUBIC, some), np.log(2.0), rtol=1e-6
    )
