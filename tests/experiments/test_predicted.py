"""experiments/predicted.py: records of runs with cards, and laws around a card."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.predicted import Around, PredictedRun, band_of, laws_around, record_of
from bubblefit.materials.card import CardCertainty, MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.solvers import registry
from bubblefit.solvers.base import BandEnd, History

from ..builders.bent_cylinders import STOPS, ClosedFormCylinder, write_cylinder_project

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


#: MPa: E1 of the card, and by how much (1 sigma) two directions move it.
E1, OFF = 500.0, (0.6, -0.8)


#: G12, E2, E1 of each direction.
DIRECTIONS = np.array([[0.1, 2.0, OFF[0]], [0.2, -3.0, OFF[1]]])


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)


def card(directions=DIRECTIONS, e1=E1):
    law = HypoelasticLaw.linear(e1, 150.0, 20.0)
    return MaterialCard(law, 0.81, "sure", "", CardCertainty(directions, "made"))


def predictions(folder, own, **options):
    project = read_project(write_cylinder_project(folder))
    return predict(project, "high", cards={"sure": own}, jobs=1, **options)


def slope(folder):
    loads = [predictions(folder, replace(card(), certainty=None,
                                         law=HypoelasticLaw.linear(e, 150.0, 20.0))).curves()
             for e in (E1 - 1, E1 + 1)]  # fmt: skip
    return np.asarray((loads[1]["load_N"] - loads[0]["load_N"]) / 2)


def test_steps_and_draws_give_spread_to_first_order(tmp_path):
    events = []
    done = predictions(tmp_path, card(), progress=events.append)
    assert events[-1].total == 3  # the prediction, and a run a direction
    curve, (run,) = done.curves(), done.predicted_runs
    expected = np.abs(slope(tmp_path)) * np.hypot(*OFF)
    np.testing.assert_allclose(curve["load_sigma_N"], expected, rtol=0.003, atol=1e-9)
    assert run.around.words == "2 of its least certain directions"
    at = float(np.interp(100.0, curve["deflection_mm"], curve["load_sigma_N"]))
    row = done.runs().iloc[0]
    assert row["load_at_100_mm_sigma_N"] == pytest.approx(at)
    assert row["load_at_100_mm_N"] > 0 and list(done.runs()["card"]) == ["sure"]
    said = done.result["runs"][0]
    assert said["load_sigma_N"]["100 mm"] == pytest.approx(at)
    assert said["spread"] == "2 of its least certain directions"
    # The standard deviation of 300 draws is known to 4 %.
    drawn = predictions(tmp_path, card(), samples=300)
    np.testing.assert_allclose(drawn.curves()["load_sigma_N"], expected, rtol=0.1, atol=1e-9)
    assert drawn.predicted_runs[0].around.words == "300 laws drawn"
    few = [predictions(tmp_path, card(), samples=5).curves()["load_sigma_N"] for _ in range(2)]
    np.testing.assert_array_equal(*few)


def test_card_with_draws_is_spread_over_them(tmp_path):
    """No direction of a card describes a law that its data leave open."""
    draws = np.array([[20.0, 150.0, e] for e in np.linspace(400.0, 600.0, 50)])
    sure = replace(card(), certainty=CardCertainty(1e3 * DIRECTIONS, "open", {}, draws))
    around, laws = laws_around(sure, None)
    assert around.words == "0 laws drawn" and len(around.steps) == len(laws) == 10
    assert {float(law.E1(0.0)) for law in laws} <= set(draws[:, 2])
    assert len(laws_around(sure, 30)[1]) == 30 and laws_around(sure, 0) == (None, ())


def test_spread_is_missing_beyond_the_shortest_curve_or_without_enough_curves():
    own, two = np.array([0.0, 10.0, 20.0]), [np.array([0.0, 11.0, 22.0]), np.array([0.0, 9.0])]
    for how, shares, curves, sigma in (
        ("directions", (1.0, -0.5), two, [0.0, np.hypot(1, 2), np.nan]),
        ("samples", (1.0, 1.0), [*two, None], [0.0, np.sqrt(2), np.nan]),
        ("directions", (1.0, 1.0), [two[0], None], [np.nan] * 3),
        ("samples", (1.0, 1.0), [two[0], None], [np.nan] * 3),
    ):
        np.testing.assert_allclose(Around(how, shares).sigma(own, curves), sigma)


def test_external_program_is_not_run_for_spread_unasked(tmp_path, monkeypatch):
    monkeypatch.setattr(ClosedFormCylinder, "external", True)
    assert predictions(tmp_path, card()).predicted_runs[0].around is None


@pytest.mark.parametrize(
    ("off", "e1", "known", "words"),
    [
        (E1 - STOPS, E1, 25, ""),
        (5.0, STOPS - 5.0, 13, ""),
        (3.0, 10.0, 0, "1 of its least certain directions, 1 failed"),
    ],
)
def test_spread_is_missing_where_runs_around_card_stop(tmp_path, off, e1, known, words):
    done = predictions(tmp_path, card(np.array([[0, 0, off]]), e1=e1))
    assert done.curves()["load_sigma_N"].notna().tolist() == [k < known for k in range(25)]
    assert words in done.predicted_runs[0].around.words
    assert (done.result["runs"][0]["load_sigma_N"]["40 mm"] is None) == (not known)


def test_step_of_sampling_keeps_moduli_positive(tmp_path):
    around, laws = laws_around(card(np.array([[-30.0, 0, 0], [-15.0, 0, 0]])), None)
    assert around.steps == [-1.0, 1.0]
    assert [float(law.G12(0.0)) for law in laws] == pytest.approx([50.0, 5.0])
    around, laws = laws_around(card(np.array([[-300.0, 1000.0, 0], [300.0, 0, 0]])), None)
    assert all(float(law.E2(0.0)) > 0 and float(law.G12(0.0)) > 0 for law in laws)
    hopeless = card(np.array([[-3000.0, 2e5, 0]]))
    with pytest.raises(InputError, match="card 'sure': a modulus is not positive next to"):
        predictions(tmp_path, hopeless)
    assert laws_around(replace(card(), certainty=None), None) == (None, ())
