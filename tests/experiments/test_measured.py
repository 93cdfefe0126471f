"""experiments/measured.py: parts of a test, their masks, errors of cards, residuals of strains."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.forward import CardRun
from bubblefit.experiments.measured import (
    PreparedParts,
    StrainObjective,
    compared,
    errors_of_cards,
)
from bubblefit.solvers.base import History

LOAD = np.linspace(1.0, 4.0, 4)[:, None] * [1.0, 0.5]
STRAIN = np.array([[0.01, 0.0], [0.02, -0.001], [0.03, -0.002], [0.04, -0.004]])
HISTORY = History(np.zeros(1), np.zeros((1, 1, 3)), np.zeros(3), np.zeros(3))


class Modelled(StrainObjective):
    off = np.array([0.001, -0.0005])

    def modelled(self, history):
        return self.strain + self.off

    def jacobian(self, history, slope):
        return self.in_blocks(slope)


def test_residual_of_strains_is_relative_to_the_largest_of_a_column():
    objective = Modelled(LOAD, STRAIN, None, 2.0, None)
    residual = objective.residual(HISTORY).reshape(2, 4)
    expected = 2.0 * Modelled.off / ([0.04, 0.004] * np.sqrt([4, 4]))
    np.testing.assert_allclose(residual, np.tile(expected, (4, 1)).T)
    assert objective.sizes == (4, 4)


def test_residual_of_strains_is_relative_to_a_given_scale():
    objective = Modelled(LOAD, STRAIN, 0.1, 1.0, 0.0002)
    residual = objective.residual(HISTORY).reshape(2, 4)
    np.testing.assert_allclose(residual[0], 0.001 / 0.1 / 2)
    assert objective.least_noise == pytest.approx(0.02) and objective.noise_is == "given"


def test_errors_of_strains_are_in_percent():
    objective = Modelled(LOAD, STRAIN, None, 1.0, None)
    np.testing.assert_allclose(objective.rms(HISTORY), [0.1, 0.05])
    np.testing.assert_allclose(
        objective.residual(HISTORY) * objective.scale, np.repeat([0.1, -0.05], 4)
    )


def test_strains_are_shifted_by_the_difference_of_two_solvers():
    objective = Modelled(LOAD, STRAIN, None, 1.0, None)
    shifted = objective.shifted(HISTORY, HISTORY)
    np.testing.assert_array_equal(shifted.strain, STRAIN)
    assert shifted is not objective and shifted.load is objective.load


def parts(**loads):
    matched = {name: SimpleNamespace(load=np.array(load)) for name, load in loads.items()}
    return PreparedParts(SimpleNamespace(name="t", matched=matched, reach="far"))


def test_masks_leave_out_one_part_at_a_time():
    prepared = parts(warp=[1, 2, 3], fill=[1, 2])
    masks = prepared.masks_without_each("direction")["direction"]
    assert list(masks) == ["warp", "fill"]
    assert [mask.tolist() for mask in masks["fill"].values()] == [[True] * 3, [False] * 2]
    assert parts(warp=[1]).masks_without_each("direction") == {}
    assert prepared.reach({}) == "far"


def test_parts_without_a_point_are_not_matched():
    prepared = parts(warp=[1, 2], fill=[1, 2])
    assert list(prepared.matched_parts(None)) == ["warp", "fill"]
    masks = {"t: warp": np.array([False, False]), "t: fill": np.array([False, True])}
    assert list(prepared.matched_parts(masks)) == ["fill"]


def test_errors_of_cards_name_runs_that_failed():
    runs = {
        ("good", "t"): CardRun(None, HISTORY),
        ("bad", "t"): CardRun(None, SolverFailure("no equilibrium")),
        ("unmatched", "t"): CardRun(None, HISTORY),
    }
    values = iter([{"rms": 1.5}, {}])
    numbers, lines, good = errors_of_cards(runs, lambda _: next(values), lambda n: f"{n['rms']} %")
    assert numbers == {"good": {"rms": 1.5}, "bad": {"failed": "no equilibrium"}, "unmatched": {}}
    assert lines == ["good: 1.5 %", "bad: failed: no equilibrium"]
    assert list(good) == ["good", "unmatched"]


def test_compared_values_stand_beside_each_other():
    table = compared("strain", [1.0, 2.0], [1.5, 1.0], "%", row=[0, 1])
    assert table.difference.tolist() == [0.5, -1.0] and table.unit.tolist() == ["%", "%"]
    assert table.row.tolist() == [0, 1]
