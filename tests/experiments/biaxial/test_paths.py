"""experiments/biaxial/paths.py: load ratios and cycles."""

import numpy as np
import pytest
from bubblefit.experiments.biaxial.paths import (
    USUAL_RATIOS,
    canonical_ratio,
    evaluated_paths,
    find_cycles,
    nearest_ratio,
)
from bubblefit.materials.designers import shares
from hypothesis import given
from hypothesis import strategies as st

from ...builders.biaxial_tests import FIVE_RATIOS, load_cycle
from ...support.refusals import complaint_with


@pytest.mark.parametrize(
    ("plain", "names"),
    [
        ("2:1", ["2:1", "2/1", " 4 : 2 ", "1:0.5", "1:0,5", "30:15"]), ("0:1", ["0:3"]),
        ("1:0", ["2:0"]), ("1:1", ["5:5"]), ("1:0.37", ["1:0.37"]),
    ],
)  # fmt: skip
def test_load_ratios_have_one_name(plain, names):
    assert {canonical_ratio(name) for name in names} == {plain}
    assert shares("1:2") == (0.5, 1.0) and shares("0:1") == (0.0, 1.0)
    for wrong in ("", "one to two", "0:0", "-1:2", "1:2:3"):
        complaint_with(["2:1"], canonical_ratio, wrong)


@given(st.sampled_from(USUAL_RATIOS), st.floats(0.5, 500.0))
def test_loads_have_the_nearest_ratio(name, size):
    assert nearest_ratio([size * x for x in shares(name)]) == name
    # Loads between the ratios have their own numbers.
    assert nearest_ratio([30.0, 27.0]) == "1:1" and nearest_ratio([30.0, 24.7]) == "1:0.82"
    assert nearest_ratio([20.0, -0.1]) == "1:0" and nearest_ratio([0.5, 30.0]) == "0:1"


def test_cycles_begin_and_end_where_loads_turn(biaxial_table):
    cycles = find_cycles(biaxial_table.load, biaxial_table.ratio)
    expected = [(ratio, k + 1, n) for k, ratio in enumerate(FIVE_RATIOS) for n in (1, 2, 3)]
    assert [(c.ratio, c.phase, c.number) for c in cycles] == expected
    starts = len(load_cycle()) * np.arange(len(cycles))
    assert [(c.number_in_file - 1, c.first) for c in cycles] == list(enumerate(starts))
    assert [c.last for c in cycles] == list(starts + 29)
    # Without names they have the ratio of their loads, with a prestress kept on both yarns.
    cycles = find_cycles(np.maximum(biaxial_table.load, 0.4))
    assert [(c.ratio, c.phase, c.number) for c in cycles] == expected
    hold = [np.full(20, 2.0), np.linspace(2, 30, 40), np.full(15, 30.0), np.linspace(30, 2, 40)]
    s = np.concatenate(hold * 2)
    s += 0.1 * np.random.default_rng(1).standard_normal(len(s))
    cycles = find_cycles(np.column_stack([s, s]))
    assert len(cycles) == 2
    for one in cycles:
        # The loading alone: not the holds at both ends, in which the fabric creeps.
        assert one.last - one.first <= 42
        assert s[one.first] < 2.6 and s[one.last] > 29.4
    assert find_cycles(np.full((10, 2), 3.0)) == []


def test_last_cycle_of_a_ratio_counts_by_default(biaxial_table):
    cycles = [find_cycles(biaxial_table.load, biaxial_table.ratio)]
    last = evaluated_paths([biaxial_table], cycles)
    assert [(p.ratio, p.cycle.number, p.cycle_count) for p in last] == [
        (r, 3, 3) for r in FIVE_RATIOS
    ]
    first = evaluated_paths([biaxial_table], cycles, 1)
    assert [p.cycle.number for p in first] == [1] * 5
    # The first three cycles are conditioning, and the only ones of 1:1.
    later = evaluated_paths([biaxial_table], cycles, 1, conditioning=3)
    assert [p.ratio for p in later] == list(FIVE_RATIOS[1:])
    few = evaluated_paths([biaxial_table], cycles, ratios=["1:2", "1:1"])
    assert [p.ratio for p in few] == ["1:1", "1:2"]
    asked = lambda *a, **k: evaluated_paths([biaxial_table], cycles, *a, **k)  # noqa: E731
    complaint_with(["ratio 1:1", "3 cycles", "number 4"], asked, 4)
    complaint_with(["3:1", "the ratios there: 1:1, 2:1"], asked, ratios=["1:1", "3:1"])
    complaint_with(["any", "after the conditioning"], asked, conditioning=15)
    path = evaluated_paths([biaxial_table], cycles)[1]
    assert path.ratio == "2:1" and len(path.load) == 30
    np.testing.assert_array_equal(path.strain_change[0], [0.0, 0.0])
    np.testing.assert_allclose(path.strain_change, path.strain - path.strain[0])
    # Five cycles of 0.02 % came before; 2:1 begins at another load along the fill.
    assert path.residual[0] == pytest.approx(path.strain[0, 0] - biaxial_table.strain[0, 0])
    inside, thin = path.between(5.0, 20.0), path.thinned(7)
    assert inside.load.max() <= 20.0 and inside.load[0].max() >= 5.0
    assert len(path.between(2.0, 30.0).load) == 30
    complaint_with(["ratio 2:1", "2 to 30"], path.between, 40.0, 50.0)
    assert len(thin.load) == 7 and path.thinned(30) is path
    np.testing.assert_array_equal(thin.load[[0, -1]], path.load[[0, -1]])
