"""experiments/deck/solvers.py: derivatives by differences, and by a bubble and a strip of ours."""

from dataclasses import dataclass

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.deck.model import DeckModel
from bubblefit.experiments.deck.results import DeckReader, FieldReading, Probe, QuantityReading
from bubblefit.experiments.deck.solvers import ANY_LAW, DeckSolver, EmbeddedSolver
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.decks import STRETCHES, bar, bar_project, force
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


def test_step_goes_up_below_the_upper_bound(model, monkeypatch):
    decks = []
    run = RoundedBar.run
    monkeypatch.setattr(RoundedBar, "run", lambda *a: decks.append(a[1]) or run(*a))
    DeckSolver(RoundedBar()).run_with_sensitivity(model, ANY_LAW, ["C10"])
    plain, shifted = (float(deck.files["job.txt"].split()[0]) for deck in decks)
    assert shifted > plain == pytest.approx(model.values["C10"])


def test_failure_of_a_column_is_that_of_the_run(model):
    below = model.with_parameters({"C10": -model.values["C10"] - 1.0, "C01": 1.5})
    raised(SolverFailure, "no such rubber", DeckSolver(RoundedBar()).run, below, ANY_LAW)
    assert isinstance(model.reader, DeckReader)


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
BUBBLE = BubbleModel(disk_mesh(100.0, 12, "quarter"), 0.81, (0.01, 0.03))
LEVELS = np.array([10.0, 30.0, 20.0])
FREE = [f"beta_{i}" for i in (3, 7, 11)]


def embedded(folder, model, *readings, times=()):
    reader = DeckReader(readings, "job.frd")
    deck = DeckModel(folder, "deck.inp.j2", {}, {}, "", 0.81, reader)
    return EmbeddedSolver(MembraneSolver(), model, reader, times), deck


def test_slopes_of_what_is_read_of_a_bubble_are_exact(tmp_path):
    apex = QuantityReading(Probe("time", scale=30.0), Probe("displacement", (0, 0, 0), 2), LEVELS)
    places = BUBBLE.mesh.points[[1, 2, 4]]
    field = FieldReading("ALL", ((1 / 3, 2, places), (1.0, 0, places)))
    solver, deck = embedded(tmp_path, BUBBLE, apex, field)
    history, _ = solver.run_with_sensitivity(deck, LAW, FREE)
    inflated = MembraneSolver().run(BUBBLE, LAW)
    assert history.load[[0, 1]] == pytest.approx(inflated.displacement[:, 0, 2])
    assert history.load[3:6] == pytest.approx(inflated.displacement[0, [1, 2, 4], 2])
    for number, place in enumerate((3, 7, 11)):
        beta = LAW.beta.copy()
        beta[place] += 0.1
        change = solver.run(deck, LAW.with_beta(beta)).load - history.load
        largest = np.abs(history.load_slope[:, number]).max()
        assert 10 * change == pytest.approx(history.load_slope[:, number], abs=2e-3 * largest)


def test_strip_is_read_by_elongation_and_whole_load(tmp_path):
    strip = straight_strip("warp", 20.0, 21.0, 0.81, increments=4, across=2, along=4)
    pulled = QuantityReading(
        Probe("displacement", "GRIP", 1, scale=-2.0),
        Probe("reaction", "GRIP", 1, scale=-2.0),
        np.array([0.5, 1.0]),
    )
    solver, deck = embedded(tmp_path, strip, pulled)
    history, _ = solver.run_with_sensitivity(deck, LAW, FREE[2:])
    whole = MembraneSolver().run(strip, LAW).load
    assert history.load == pytest.approx(whole[[1, 3]])
    assert history.load_slope[:, 0] == pytest.approx(history.load / 800.0, rel=1e-6)


def test_times_are_one_for_each_load(tmp_path):
    reading = QuantityReading(Probe("time"), Probe("displacement", (0, 0, 0), 2), np.ones(1))
    solver, deck = embedded(tmp_path, BUBBLE, reading, times=[1, 2, 3])
    with pytest.raises(SolverFailure, match="surrogate_times for 2 loads of the surrogate, got 3"):
        solver.run(deck, LAW)


@pytest.mark.parametrize("surrogate", ["bubble", "bar"])
def test_surrogate_is_a_bubble_or_a_strip_of_the_project(tmp_path, monkeypatch, surrogate):
    line = f'surrogate = "{surrogate}"\n[deck.parameters]'
    path = bar_project(tmp_path, monkeypatch, [("[deck.parameters]", line)])
    with pytest.raises(InputError, match="surrogate: expected the name of a bubble of the project"):
        read_project(path)
