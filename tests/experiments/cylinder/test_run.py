"""experiments/cylinder/run.py: what is kept of a bending run."""

import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.run import arrays_of

from ...support.refusals import raised
from .cases import SMALL_CYLINDER, cylinder_history


def test_bending_run_keeps_what_is_reported():
    kept = arrays_of(SMALL_CYLINDER, cylinder_history(wrinkled=[0.0, 0.1, 0.3]))
    assert {name: value.tolist() for name, value in kept.items()} == {
        "deflection": [0.0, 10.0, 20.0],
        "load": [0.0, 50.0, 100.0],
        "pressure": [0.1, 0.101, 0.102],
        "volume": [5e7, 5e7 - 1, 5e7 - 2],
        "inflated": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        "bent": [[12.0, 13.0, 14.0], [15.0, 16.0, 17.0]],
        "wrinkled": [0.0, 0.1, 0.3],
    }
    assert arrays_of(SMALL_CYLINDER, cylinder_history())["wrinkled"].size == 0
    # An early end is a result where the solver says why.
    short = cylinder_history(2, early="no equilibrium")
    assert arrays_of(SMALL_CYLINDER, short)["deflection"].tolist() == [0.0, 10.0]


@pytest.mark.parametrize(
    ("results", "words"),
    [
        (cylinder_history(2), "at 10 of 20 mm"),
        (cylinder_history(cavity_pressure=None), "no gas"),
        (cylinder_history(cavity_volume=None), "no volume"),
    ],
)
def test_run_without_end_or_gas_is_a_failure(results, words):
    raised(SolverFailure, words, arrays_of, SMALL_CYLINDER, results)
