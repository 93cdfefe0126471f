"""experiments/cycles/memory_fit.py: laws with memory fitted to histories, cycles predicted."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bubblefit import cycles
from bubblefit.experiments.cycles.evaluation import evaluate_history
from bubblefit.experiments.cycles.memory_fit import CycleFit, fit_cycles, left_out
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw, law_slopes
from bubblefit.materials.memory import Memory, own_stress
from bubblefit.readers.histories import LoadHistory, read_history


def test_known_history_gives_its_law_back():
    knots, level = np.linspace(0.0, 0.08, 6), 5.0
    memory = Memory((0.45, 0.55, 0.3), (1.7, 1.6, 1.5), (1.2, 1.3, 1.0), (4.0, 2.0, 0.0))
    tangents = {0: [900.0, 500, 400, 600, 800, 900], 1: [300.0, 250, 200, 220, 300, 350]}
    form = Spline.at([knots.tolist()] * 2 + [[0.0, 1.0]])
    law = HypoelasticLaw(np.array([15.0, 15.0, *tangents[1], *tangents[0]]), 0.24,
                         [0.08, 0.08, 1.0], form=form, memory=memory)  # fmt: skip
    for pulled in (0, 1):
        turns, strain = [0.0, 0.05, 0.018, 0.05, 0.016, 0.08, 0.025], []
        for a, b in pairwise(turns):
            strain += np.linspace(a, b, 41)[1:].tolist()
        slopes = law_slopes(law, [], 1.0)
        stress, _ = own_stress(law.compiled, pulled, np.array(strain), slopes)
        history = LoadHistory(Path(f"{pulled}.csv"), np.r_[0.0, level, level + stress],
                              np.r_[-0.01, 0.0, strain])  # fmt: skip
        found = fit_cycles(evaluate_history(history, level), 6)
        assert found.knots == pytest.approx(knots)
        assert found.stiffness == pytest.approx(tangents[pulled], rel=1e-6)
        own = memory.constants[4 * pulled : 4 * pulled + 4]
        assert found.memory == pytest.approx(own, rel=1e-6)
        assert found.load == pytest.approx(history.load[found.rows], abs=1e-6)


def test_derivatives_of_a_history_with_slips_are_those_of_differences(plain_history_file):
    evaluated = evaluate_history(read_history(plain_history_file), 100.0)
    problem = CycleFit(evaluated, knots=4, leave=0)
    slips = [1e-3] * len(problem.slipped)
    x = np.array([1.1, 0.8, 0.9, 1.2, 0.4, 1.6, 0.5, 0.3, *slips])
    jacobian = problem.jacobian(x)
    assert jacobian.shape[1] == len(x) == 10
    for k, step in enumerate(1e-5 * np.eye(len(x))):
        difference = (problem.residual(x + step) - problem.residual(x - step)) / 2e-5
        atol = 1e-4 * np.abs(difference).max()
        np.testing.assert_allclose(jacobian[:, k], difference, atol=atol, err_msg=f"{k}")


def test_left_out_cycles_of_straps_and_cords_are_predicted(shared_data):
    """Straps, of which the extensometer slips, and typical cords: stiffness, permanent strain."""
    count = 0
    for path in sorted((shared_data / "webbing").glob("*.csv")):
        if not path.stem.startswith(("st_", "cord_typ")):
            continue
        cord = path.stem.startswith("cord")
        table = left_out(cycles(path, reference_load=89.0 if cord else 178.0).histories[0])
        assert table["cycle"].tolist() == ([2, 3] if cord else [2])
        assert table["EA_loading_off_percent"].abs().max() < 10
        assert table["EA_unloading_off_percent"].abs().max() < 10
        assert table["permanent_strain_off"].abs().max() < 0.001
        count += 1
    assert count >= 6


def test_slip_before_a_later_cycle_is_found_and_predicted_without_it(tmp_path):
    memory, form = [0.45, 1.7, 1.2, 4.0], Spline.at([[0.0, 0.08], [0.0, 1.0], [0.0, 1.0]])
    law = HypoelasticLaw([1.0, 1, 1, 1, 600, 600], 0.0, [0.08, 1, 1], form=form,
                         memory=Memory.of([*memory, *[0, 1, 1, 0] * 2]))  # fmt: skip
    turns = pairwise([0.0, 0.05, 0.018, 0.05, 0.016, 0.08, 0.025])
    strain = np.concatenate([np.linspace(a, b, 41)[1:] for a, b in turns])
    stress, _ = own_stress(law.compiled, 0, strain, law_slopes(law, [], 1.0))
    shown = strain - 0.002 * (np.arange(len(strain)) >= 79)
    history = LoadHistory(Path("slip.csv"), np.r_[0.0, 5.0, 5.0 + stress], np.r_[-0.01, 0.0, shown])
    one = evaluate_history(history, 5.0)
    found = fit_cycles(one, 6)
    assert found.memory == pytest.approx(memory, rel=1e-4)
    assert found.slip == pytest.approx({2: 0.002, 3: 0.0}, abs=1e-7)
    assert found.stiffness == pytest.approx(600.0, rel=1e-4)
    row = left_out(one, 6).iloc[0]
    # Readings are 0.0008 apart.
    assert row["cycle"] == 2 and row["permanent_strain_off"] == pytest.approx(0.002, abs=5e-5)
    assert abs(row["EA_loading_off_percent"]) < 0.5 and abs(row["EA_unloading_off_percent"]) < 0.5
