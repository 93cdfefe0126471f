"""experiments/deck/embedded.py: readings of a bubble and a strip of ours, and their slopes."""

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.deck.embedded import EmbeddedSolver
from bubblefit.experiments.deck.model import DeckModel
from bubblefit.experiments.deck.results import DeckReader, FieldReading, Probe, QuantityReading
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.decks import bar_project

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
