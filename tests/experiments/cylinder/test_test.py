"""experiments/cylinder/test.py: membranes and beams of a section, and mistakes in it."""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import DEFAULTS, Collar
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.runs.validation import validate
from bubblefit.solvers.calculix import cylinder as calculix_cylinder
from bubblefit.solvers.marc import analyses as marc_analyses

from ...builders.bent_cylinders import write_cylinder_project
from ...builders.projects import replaced_once
from ...support.refusals import complaint_with, refused
from .cases import BEAM, CYLINDER_EXAMPLE, PLAIN_MEMBRANE, TABLE_6_1, TABLES, cylinders_of_project


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


D, P, SOFT = "diameter = 150", "pressure = 90\n", 'name = "soft"'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (D, "diamter = 150", ["cylinder[0].diamter", "'diameter'"]),
        (D, "diameter = 280", ["cylinder[0].collar", "inner_diameter"]),
        (P, f"{P}span = 2960\n", ["cylinder[0].span", "fit"]),
        (P, f"{P}seam_width = 300\n", ["cylinder[0].seam_width"]),
        (P, f"{P}mass_per_area = 900\n", ["cylinder[0].mass_per_area", "kg/m^2"]),
        ('"150 mm, 90 kPa"', '"high"', ["cylinder[1].name", "twice"]),
        (P, P + "collar = { inner_diameter = 140, length = 100 }\n",
         ["cylinder[0].collar.inner_diameter", "150"]),
        (P, P + "measured.files = ['none.csv']\n",
         ["cylinder[0].measured.files[0]", "none.csv", "--data"]),
        ("frames = 24", "deflections = [3, 2]", ["cylinder[0].deflections", "increasing"]),
        (SOFT, "", ["card[0].name", "missing"]),
        (SOFT, 'name = "stiff"', ["card[1].name", "twice"]),
        ("beta = [0, ", "beta = [", ["card[0].beta", "12"]),
        (SOFT, f'{SOFT}\nfile = "a.toml"', ["card[0]", "exactly one"]),
        ("[fabric]", "[project]\nkind = 'bend'\n[fabric]", ["project.kind", "version 0.1"]),
    ],
)  # fmt: skip
def test_mistake_in_a_cylinder_section_is_one_line(tmp_path, old, new, words):
    path = write_cylinder_project(tmp_path)
    path.write_text(replaced_once(path.read_text(), (old, new)))
    assert complaint_with(words, read_project, path).startswith(str(path))


@pytest.mark.parametrize(
    ("before", "after", "field", "words"),
    [
        ("pressure = 80.0", "pressure = 110.0", "cylinder[0].pressure", "60 to 100"),
        ("pressure = 80.0", "pressure = 59.9", "cylinder[0].pressure", "60 to 100"),
        ("yarn = [1000.0, 2000.0]", "yarn = [1.0]", "cylinder[0].wall.yarn", "expected 2"),
        ("angle = 65.0,", "", "cylinder[0].wall.angle", "braid"),
        ("angle = 65.0", "angle = 50.0", "cylinder[0].wall.angle", "54.7"),
        ("angle = 65.0", "angle = 65.0, poisson = 0.4", "cylinder[0].wall.poisson", "a plain wall"),
        (
            "angle = 65.0",
            "angle = 65.0, wrinkles = false",
            "cylinder[0].wall.wrinkles",
            "a plain wall",
        ),
        ("stiffness = 8e5", "", "cylinder[0].cord[1]", "stiffness"),
        (
            "stiffness = 8e5",
            "stiffness = 1.0\nbonded = false",
            "cylinder[0].cord[1].bonded",
            "true",
        ),
        ("0.002, 0.02", "0.02, 0.002", "cylinder[0].cord[0].strain", "above"),
        ("span = 3000.0", "span = 900.0", "cylinder[0].load_spacing", "900"),
        ("span = 3000.0", "length = 3000.0", "cylinder[0].length", "membrane"),
        ('model = "beam"', "", "cylinder[0].wall", "beam"),
    ],
)
def test_mistake_in_a_beam_names_its_key(tmp_path, before, after, field, words):
    path = tmp_path / "beam.toml"
    assert before in BEAM
    path.write_text(BEAM.replace(before, after))
    raised = refused(read_project, path)
    assert raised.field == field and words in raised.problem


def test_example_is_table_6_1_with_tables_3_2_and_5_4():
    project = read_project(CYLINDER_EXAMPLE)
    wanted = [(d, p) for d, pressures in TABLE_6_1.items() for p in pressures]
    tests = list(project.tests.values())
    assert [(t.diameter, round(1e3 * t.pressure, 9)) for t in tests] == wanted
    assert list(project.tests) == [f"{d:g} mm, {p} kPa" for d, p in wanted]
    assert list(project.cards) == list(TABLES)
    for name, beta in TABLES.items():
        card = project.cards[name]
        np.testing.assert_allclose(card.card.law.beta, 1e3 * np.array(beta), rtol=1e-12)
        assert card.card.thickness == 0.81 and card.card.law.nu12 == 0.24
        assert card.test == name.split()[0]
    for test in tests:
        collar = (295.0, 147.0) if test.diameter == 250 else (240.0, 145.0)
        assert (test.collar.inner_diameter, test.collar.length) == collar
        assert (test.length, test.supports.span) == (3000.0, 2000.0)
        assert (
            len(test.deflections) == DEFAULTS.frames and test.deflections[-1] == DEFAULTS.deflection
        )
        assert list(test.reading.places.values()) == [40.0, 100.0, 240.0]
        assert test.reading.slope_over == 20.0
        assert test.measured == ()
    assert tests[2].name == "150 mm, 140 kPa"
    # Moduli stay above zero as far as each card says that it is valid.
    for card in project.cards.values():
        law = card.card.law
        for modulus, column in (("E1", 0), ("E2", 1), ("G12", 2)):
            assert law.modulus(modulus, np.linspace(0, law.strain_range[column], 500)).min() > 0


def test_reading_of_the_curve_follows_the_diameter(tmp_path):
    path = write_cylinder_project(tmp_path)
    usual = path.read_text().replace("places = [40, 100, 240]\nslope_over = 20\n", "")
    path.write_text(usual.replace("diameter = 150", "diameter = 200", 1))
    wide, narrow = cylinders_of_project(path)
    names = ["0.25 diameters", "0.5 diameters", "1 diameters"]
    assert wide.reading.places == dict(zip(names, (50.0, 100.0, 200.0), strict=True))
    assert narrow.reading.places == dict(zip(names, (37.5, 75.0, 150.0), strict=True))
    assert (wide.reading.slope_over, narrow.reading.slope_over) == (20.0, 15.0)
    assert wide.model().reading == wide.reading


def test_units_of_the_file_do_not_change_the_cylinder(tmp_path):
    path = write_cylinder_project(tmp_path)
    usual = cylinders_of_project(path)
    text = replaced_once(
        path.read_text(), ('modulus = "MPa"', 'modulus="MPa"\nlength="m"\npressure="bar"'),
        ("thickness = 0.81", "thickness = 0.81e-3"), ("size = 40.0", "size = 0.04"),
        ("= 90\n", "= 0.9\n"), ("= 140\n", "= 1.4\n"), ("[40, 100, 240]", "[0.04, 0.1, 0.24]"),
        ("slope_over = 20", "slope_over = 0.02"),
    )  # fmt: skip
    path.write_text(text.replace("diameter = 150", "diameter = 0.15"))
    for one, other in zip(usual, cylinders_of_project(path), strict=True):
        assert other.name == one.name
        for key in ("diameter", "pressure", "length", "size", "seam_width", "deflections"):
            assert getattr(other, key) == pytest.approx(getattr(one, key)), key
        assert other.reading.places == pytest.approx(one.reading.places)
        assert other.reading.slope_over == pytest.approx(one.reading.slope_over)
    assert read_project(path).cards["soft"].card.thickness == pytest.approx(0.81)


def test_cylinder_cannot_be_fitted(tmp_path):
    with pytest.raises(InputError, match="no test to be fitted"):
        read_project(write_cylinder_project(tmp_path)).chosen(None, fitted=True)


def test_example_without_optional_keys_has_the_defaults(tmp_path):
    """Without [defaults.cylinder], but for where curves are read, the cylinders are the same."""
    bare = re.sub(r"\[defaults.cylinder\].*?\n\n", "\n\n", CYLINDER_EXAMPLE.read_text(), flags=re.S)
    (tmp_path / "project.toml").write_text(bare)
    own = {"name", "place", "reading", "assumed"}
    for pair in zip(
        cylinders_of_project(CYLINDER_EXAMPLE),
        cylinders_of_project(tmp_path / "project.toml"),
        strict=True,
    ):
        said, left = ({k: v for k, v in vars(t).items() if k not in own} for t in pair)
        assert said == left


def test_beam_without_optional_keys_is_weightless_on_rollers_at_its_axis(tmp_path):
    keys = ("load_spacing", "roller_below_axis", "mass_per_length")
    path = tmp_path / "beam.toml"
    lines = [line for line in BEAM.splitlines() if not line.startswith(keys)]
    path.write_text("\n".join(lines))
    (test,) = cylinders_of_project(path)
    beam = test.model()
    assert (beam.load_spacing, beam.roller_below, beam.weight) == (0.0, 0.0, 0.0)
    assert (beam.load_width, beam.friction) == (0.0, 0.0)
    assert "weightless tube" in test.assumed
