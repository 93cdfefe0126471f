"""experiments/predicted.py: runs of tests with cards, their bands and their records."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.predicted import PredictedRun, band_of, record_of
from bubblefit.solvers.base import BandEnd, History

FIELD = BandEnd("tension field", "no compression", {})
STIFF = BandEnd("stiff wall", "rigid", {}, predicted=False)


def run_with(end=None):
    return PredictedRun(SimpleNamespace(name="beam"), "soft", None, None, None, end=end)


def test_band_has_each_end_once_with_the_prediction_first():
    runs = [run_with(FIELD), run_with(STIFF), run_with(FIELD), run_with(STIFF)]
    assert band_of(runs) == [FIELD, STIFF]
    assert band_of([run_with(), run_with()]) == []


def test_title_names_the_wall_of_runs_that_are_no_prediction():
    assert run_with().title == run_with(FIELD).title == "beam with soft"
    assert run_with(STIFF).title == "beam with soft, stiff wall"
    assert run_with().predicted and run_with(FIELD).predicted and not run_with(STIFF).predicted
    assert (run_with().wall, run_with(STIFF).wall) == ("", "stiff wall")


def history(**options):
    u = np.zeros((1, 1, 3))
    low, high = np.array([-0.02, 0.0, -0.3]), np.array([0.01, 0.05, 0.1])
    return History(np.ones(1), u, low, high, **options)


class Kind:
    def arrays(self, model, outcome):
        if model == "another":
            raise SolverFailure("no volume")
        return {"load": outcome.load}


def test_record_has_strains_of_tension_and_of_shear_either_way():
    record = record_of(Kind(), "model", history(), 3.0)
    assert record.strain.tolist() == [0.01, 0.05, 0.3] and record.seconds == 3.0
    assert list(record.arrays) == ["load"]
    assert record_of(Kind(), "model", history(seconds=7.0), 3.0).seconds == 7.0


@pytest.mark.parametrize(
    ("model", "outcome", "reason"),
    [
        ("another", history(), "no volume"),
        ("model", SolverFailure("killed"), "killed"),
    ],
)
def test_record_of_a_failure_has_its_reason(model, outcome, reason):
    record = record_of(Kind(), model, outcome)
    assert reason in str(record.failure)
