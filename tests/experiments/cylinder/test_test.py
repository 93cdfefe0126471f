"""experiments/cylinder/test.py: membranes and beams, which solver takes them."""

import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import Collar
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.runs.validation import validate
from bubblefit.solvers.calculix import cylinder as calculix_cylinder
from bubblefit.solvers.marc import analyses as marc_analyses

from ...support.refusals import refused
from .cases import BEAM, PLAIN_MEMBRANE, cylinders_of_project


def test_beam_has_its_wall_by_pressure_and_needs_no_card(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(BEAM)
    (test,) = cylinders_of_project(path)
    beam = test.model()
    assert beam.section.wall.yarn == pytest.approx(1500.0)
    assert (beam.section.wall.yarn_shear, beam.section.wall.angle) == (2.0, 65.0)
    assert (beam.load_spacing, beam.roller_below) == (1000.0, 300.0)
    assert beam.weight == pytest.approx(2e-3 * 9.80665)
    assert [c.angle for c in beam.cords] == [0.0, 180.0]
    assert beam.cords[1].table.pull(0.01)[0] == pytest.approx(8000.0)
    row = predict(read_project(path)).runs().iloc[0]
    assert row["card"] == "its wall" and row["load_at_40_mm_N"] > 50
    assert test.models(None, "elements", 2)["cylinder"].size == 0.5 * beam.size


def test_validate_judges_a_beam_by_its_measured_loads(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(BEAM.replace("places = [40.0]", 'measured.files = ["read.csv"]'))
    (tmp_path / "read.csv").write_text("deflection [mm],load [N]\n0,0\n20,200\n40,400\n")
    found = predict(read_project(path))
    card = MaterialCard(HypoelasticLaw.linear(1.0, 1.0, 1.0), 1.0, "card")
    judged = validate(read_project(path), cards={"card": card})
    (one,) = judged.judged
    assert (one.law, one.predicted.test) == ("its wall", "beam")
    assert one.predicted.error == pytest.approx(found.error(0)) and one.predicted.error > 0
    assert judged.table()["foretold_rms"][0] == pytest.approx(100 * found.error(0))


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("saddle", "saddle = { inner_diameter = 170.0, length = 60.0 }"),
        ("collar.spacing", "collar = { inner_diameter = 180.0, length = 60.0, spacing = 90.0 }"),
        ("mass_per_area", "mass_per_area = 0.9"),
        ("gas.constant", 'gas = { constant = "pressure" }'),
    ],
)
def test_loads_and_supports_of_the_membrane_only(tmp_path, key, said):
    path = tmp_path / "project.toml"
    path.write_text(PLAIN_MEMBRANE + said)
    model = cylinders_of_project(path)[0].model()
    saddle, weight = model.supports.saddle, 0.9 * 9.80665e-6
    values = [("saddle", saddle, Collar(170.0, 60.0), None),
              ("collar.spacing", model.collar.spacing, 90.0, 0.0),
              ("mass_per_area", round(model.weight, 15), round(weight, 15), 0.0),
              ("gas.constant", model.gas.constant, "pressure", "mass")]  # fmt: skip
    for name, value, own, usual in values:
        assert value == (own if name == key else usual)
    law = HypoelasticLaw.linear(400.0, 400.0, 40.0)
    for analyse in (calculix_cylinder.analyse, marc_analyses.analyse_cylinder):
        assert refused(analyse, model, law, None, None).field == key


def test_cords_of_a_cylinder_are_taken_by_the_membrane_only(tmp_path):
    cords = "".join(
        f"\n[[cylinder.cord]]\nangle = {angle}\nstiffness = 4e4" for angle in (60.0, 300.0)
    )
    path = tmp_path / "cords.toml"
    path.write_text(PLAIN_MEMBRANE + cords)
    (test,) = cylinders_of_project(path)
    assert [c.angle for c in test.model().cords] == [60.0, 300.0]
    law = HypoelasticLaw.linear(400.0, 400.0, 40.0)
    for analyse in (calculix_cylinder.analyse, marc_analyses.analyse_cylinder):
        assert refused(analyse, test.model(), law, None, None).field == "cord"
