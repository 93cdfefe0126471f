"""experiments/deck/differences.py: forward differences by the digits, Broyden's update."""

from dataclasses import dataclass

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.deck.differences import ANY_LAW, DeckSolver
from bubblefit.experiments.deck.results import DeckReader
from bubblefit.solvers.base import History

from ...builders.decks import STRETCHES, bar, force
from ...support.refusals import raised


@dataclass
class RoundedBar:
    """The forces of the bar in closed form, written with six digits."""

    name = identity = "rounded"
    external = True
    runs = 0

    def run(self, deck, law):
        self.runs += 1
        c10, c01 = (float(word) for word in deck.files["job.txt"].split())
        if c10 < 0:
            raise SolverFailure("no such rubber")
        values = np.array([float(f"{f:.5e}") for f in force(STRETCHES, c10, c01)])
        none = np.zeros(3)
        rounding = np.full(len(values), 1e-6)
        return History(values, np.zeros((1, 1, 3)), none, none, load_rounding=rounding)


@pytest.fixture
def model(tmp_path, monkeypatch):
    return bar(tmp_path, monkeypatch).tests["bar"].model


def test_derivatives_of_rounded_results(model):
    solver = DeckSolver(RoundedBar())
    history, displacement = solver.run_with_sensitivity(model, ANY_LAW, ["C10", "C01", "thickness"])
    exact = 2 * (STRETCHES - STRETCHES**-2)
    assert history.load_slope[:, 0] == pytest.approx(exact, abs=3e-2)
    assert history.load_slope[:, 1] == pytest.approx(exact / STRETCHES, abs=3e-2)
    assert not history.load_slope[:, 2].any()  # the deck has no thickness: no run either
    assert solver.solver.runs == solver.runs == 3 and displacement.shape == (1, 1, 3, 3)


def test_broyden_saves_runs_until_a_point_is_asked_for_twice(model):
    solver = DeckSolver(RoundedBar())
    names = ["C10", "C01"]
    solver.run_with_sensitivity(model, ANY_LAW, names)
    near = model.with_parameters({"C10": 0.02, "C01": 0.01})
    solver.run_with_sensitivity(near, ANY_LAW, names)
    assert solver.runs == 4  # of the first Jacobian 3
    history, _ = solver.run_with_sensitivity(near, ANY_LAW, names)
    assert solver.runs == 6
    exact = 2 * (STRETCHES - STRETCHES**-2)
    assert history.load_slope[:, 0] == pytest.approx(exact, abs=3e-2)
    solver.forget()
    solver.run_with_sensitivity(model, ANY_LAW, names)
    assert solver.runs == 6  # the runs are remembered


def test_point_that_is_returned_to_is_differenced_anew(model):
    """The last trial of a fit is not its best point, of whose derivatives bands follow."""
    solver = DeckSolver(RoundedBar())
    names = ["C10", "C01"]
    solver.run_with_sensitivity(model, ANY_LAW, names)
    best = model.with_parameters({"C10": 0.02, "C01": 0.01})
    solver.run_with_sensitivity(best, ANY_LAW, names)
    solver.run_with_sensitivity(best.with_parameters({"C10": 0.01}), ANY_LAW, names)
    runs = solver.runs
    history, _ = solver.run_with_sensitivity(best, ANY_LAW, names)
    assert solver.runs == runs + 2
    exact = DeckSolver(RoundedBar()).run_with_sensitivity(best, ANY_LAW, names)[0]
    np.testing.assert_array_equal(history.load_slope, exact.load_slope)


def test_comparisons_of_a_deck_share_an_update(model):
    solver = DeckSolver(RoundedBar(), comparisons=2)
    names = ["C10", "C01"]
    best = model.with_parameters({"C10": 0.02, "C01": 0.01})
    runs = []
    for point in (model, best, best):
        slopes = [solver.run_with_sensitivity(point, ANY_LAW, names)[0] for _ in range(2)]
        np.testing.assert_array_equal(slopes[0].load_slope, slopes[1].load_slope)
        runs.append(solver.runs)
    assert runs == [3, 4, 6]


def test_step_goes_down_at_the_upper_bound(model):
    upper = model.with_parameters({"C10": 3.0 - model.values["C10"]})
    history, _ = DeckSolver(RoundedBar()).run_with_sensitivity(upper, ANY_LAW, ["C10"])
    assert history.load_slope[-1, 0] == pytest.approx(2 * (1.6 - 1.6**-2), rel=1e-2)


def test_failure_of_a_column_is_that_of_the_run(model):
    below = model.with_parameters({"C10": -model.values["C10"] - 1.0, "C01": 1.5})
    raised(SolverFailure, "no such rubber", DeckSolver(RoundedBar()).run, below, ANY_LAW)
    assert isinstance(model.reader, DeckReader)
