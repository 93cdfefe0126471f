"""Increments that are solved, and what is read between them."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.solvers.membrane.solved_increments import SolvedIncrements
from bubblefit.solvers.membrane.solver import MembraneSolver

LEVELS = np.linspace(0.0, 1.0, 101)[1:]
#: Moduli that depend on the strain, MPa.
LAW = HypoelasticLaw(
    np.array([900.0, -150.0, 12.0, 14.0, 0.0, -400.0, 300.0, 120.0, 0.0, 2000.0, -900.0, 500.0])
)


def solved(response, slope, levels=LEVELS, **accuracy):
    """Return the increments that are solved where the response follows a function of the level."""
    increments = SolvedIncrements(levels, **accuracy)
    while not increments.are_complete:
        level = levels[increments.current]
        increments.accept(response(level), slope(level))
    return increments


def reading_error(increments, response, slope):
    exact = response(increments.levels)
    at = increments.solved
    reading = increments.read(exact[at], slope(increments.levels[at]))
    return np.abs(reading - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize("error", [1e-3, 1e-4, 1e-6])
def test_reading_keeps_the_accuracy(error):
    def response(x):
        return np.tanh(4 * x) + 0.2 * np.sin(12 * x)

    def slope(x):
        return 4 / np.cosh(4 * x) ** 2 + 2.4 * np.cos(12 * x)

    increments = solved(response, slope, error=error)
    assert reading_error(increments, response, slope) < error
    assert len(increments.solved) < (60 if error > 1e-5 else 101)


def test_fewer_increments_are_solved_where_the_response_is_smooth():
    increments = solved(lambda x: x + x**3, lambda x: 1 + 3 * x**2)
    assert increments.solved[:3] == [0, 1, 2]
    assert 12 <= len(increments.solved) < 20
    assert increments.solved[-1] == 99


@pytest.mark.parametrize("kink", [0.505, 0.5099, 0.5001, 0.57])
def test_every_increment_is_solved_at_a_kink(kink):
    def response(x):
        return np.minimum(x, kink)

    def slope(x):
        return np.where(x < kink, 1.0, 0.0)

    increments = solved(response, slope)
    first = int(100 * kink) - 1
    assert {first, first + 1} <= {*increments.solved}
    assert len(increments.solved) < 40
    # Of a kink within an increment of 1 % more is not known.
    assert reading_error(increments, response, slope) < 1e-4


def test_a_change_of_stability_is_found_to_the_increment():
    increments = SolvedIncrements(LEVELS)
    while not increments.are_complete:
        level = LEVELS[increments.current]
        increments.accept(level, 1.0, is_stable=not 0.355 < level < 0.725)
    assert increments.unstable.tolist() == list(range(35, 72))
    assert len(increments.solved) < 30


def test_few_increments_are_all_solved():
    increments = solved(np.sqrt, lambda x: 0.5 / np.sqrt(x), LEVELS[::9])
    assert increments.solved == list(range(12))
    values = np.random.default_rng(1).random((12, 3))
    assert increments.read(values) is values


@pytest.fixture(scope="module")
def strip():
    return bias_strip(50.0, 56.0, 0.8, increments=60, across=2, along=4, angle=30.0)


def run(model, law=LAW):
    solver = MembraneSolver()
    return solver.run_with_sensitivity(model, law, ["beta_3", "beta_11"])[0]


def test_strip_is_read_as_if_all_increments_were_solved(strip):
    chosen, full = run(strip), run(replace(strip, unloaded=True))
    assert chosen.iterations < 0.5 * full.iterations
    for name in ("load", "load_slope", "path", "path_slope"):
        values, expected = getattr(chosen, name), getattr(full, name)
        assert values.shape == expected.shape
        assert np.abs(values - expected).max() < 2e-5 * np.abs(expected).max()
    for name, reaction in full.reactions.items():
        assert chosen.reactions[name] == pytest.approx(reaction, abs=1e-5 * np.abs(full.load).max())


def test_steps_of_large_strains_follow_the_path():
    law = HypoelasticLaw.linear(500.0, 200.0, 15.0)
    model = bias_strip(20.0, 31.0, 0.8, increments=64, across=2, along=4)
    full = run(replace(model, unloaded=True), law).load
    assert np.abs(run(model, law).load - full).max() < 1e-7 * full.max()


def test_an_unloaded_strip_is_solved_at_every_increment(strip):
    levels = [*strip.elongations, *strip.elongations[-2::-1]]
    history = run(replace(strip, elongations=levels[:70], unloaded=True))
    assert history.iterations >= 2 * 70
