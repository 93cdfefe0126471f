"""experiments/cylinder/section.py: mistakes in [[cylinder]] of a project."""

import pytest
from bubblefit.project.project import read_project

from ...builders.bent_cylinders import write_cylinder_project
from ...builders.projects import replaced_once
from ...support.refusals import complaint_with, refused
from .cases import BEAM

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
        ("yarn = [1000.0, 2000.0]", "yarn = [1.0]", "cylinder[0].wall.yarn", "expected 2"),
        ("angle = 65.0,", "", "cylinder[0].wall.angle", "braid"),
        ("angle = 65.0", "angle = 50.0", "cylinder[0].wall.angle", "54.7"),
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
