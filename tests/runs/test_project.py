"""A project as a whole: units, law and bounds, names of tests, defaults, and one-line errors."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from bubblefit.experiments.kinds import Reach
from bubblefit.inference.unknowns import LawBounds
from bubblefit.materials.forms.base import pieces_of
from bubblefit.project.project import Project, read_project
from bubblefit.runs.setup import bounds_of, law_of

from ..complaints import complaint, complaint_with
from ..places import EXAMPLES, KNOWN
from ..projects import edited

VALMEX = EXAMPLES / "bubble-valmex7318"
SECOND = """
[[bubble]]
name = "larger"
radius = 150.0
pressures = [20, 40]
[bubble.data.known_solution]
beta = [0, 0, 0, 0.02, 0, 0, 0, 0.1, 0, 0, 0, 0.5]
"""


@pytest.fixture
def edit(tmp_path):
    """Read the known-solution example after replacing one text by another."""
    return partial(edited, tmp_path)


def reaches(project: Project) -> list[Reach]:
    return [test.reach for test in project.chosen(None, fitted=True)]


def bounds(project: Project) -> LawBounds:
    return bounds_of(project, law_of(project, reaches(project)).form)


def test_fabric_law_and_fit_of_the_example():
    p = read_project(KNOWN)
    assert (p.fabric.thickness, p.fabric.thickness_change) == (0.81, "constant")
    law, limits = law_of(p, reaches(p)), bounds(p)
    assert law.form.name == "cubic" and law.nu12 == 0.24 and not law.beta.any()
    assert law.strain_range.tolist() == [0.13, 0.13, 0.13]
    assert limits.lower.shape == limits.upper.shape == (12,)
    assert limits.upper[11] == pytest.approx(1500.0)
    assert limits.least == pytest.approx({"E1": 5.0, "E2": 5.0, "G12": 0.5})
    assert (p.fit.starts, p.fit.seed, p.fit.method, p.fit.solver) == (50, 1, "lm", "membrane")


def test_units_of_the_file_do_not_matter(edit):
    reference = bounds(read_project(KNOWN))
    mpa = bounds(edit('modulus = "GPa"', 'modulus = "MPa"'))
    assert mpa.upper == pytest.approx(reference.upper / 1000)
    assert mpa.least["E1"] == pytest.approx(reference.least["E1"] / 1000)
    assert edit('length = "mm"', 'length = "m"').fabric.thickness == pytest.approx(810.0)


def test_bounds_on_the_moduli_themselves(edit):
    text = KNOWN.read_text()
    easy = text[: text.index("[law.bounds]")] + "[law.bounds]\nE1 = [0.02, 2.0]\n"
    easy = easy.replace("margin = ", "# margin = ") + "E2 = [0.02, 1.0]\nG12 = [0.001, 0.2]\n"
    project = edit(text, easy + text[text.index("[[bubble]]") :])
    limits = bounds(project)
    assert limits.largest == pytest.approx({"E1": 2000.0, "E2": 1000.0, "G12": 200.0})
    assert limits.least["G12"] == pytest.approx(1.0)


@pytest.mark.parametrize("form, size", [("linear", 6), ("quadratic", 9), ("constant", 3)])
def test_lower_degrees_keep_the_low_powers(edit, form, size):
    values = ", ".join(["1.0"] * size)
    text = KNOWN.read_text()
    start, end = text.index("[law.bounds]"), text.index("[[bubble]]")
    section = f"[law.bounds]\nlower = [{values}]\nupper = [{values}]\n"
    changed = (text[:start] + section + text[end:]).replace('"cubic"', f'"{form}"', 1)
    project = edit(text, changed)
    law, limits = law_of(project, reaches(project)), bounds(project)
    beta = np.zeros(law.form.size)
    beta[list(law.form.free)] = limits.lower
    pieces = pieces_of(law.form, beta, law.strain_range)
    assert (pieces[:, 0, 1:] != 0).sum() == size and (pieces[:, 0, 4] != 0).all()


def test_tests_have_names_and_are_chosen_by_name_or_kind(edit):
    project = edit("[fit]", SECOND + "[fit]")
    assert list(project.tests) == ["bubble 1", "larger"]
    assert [t.name for t in project.chosen("bubble", fitted=True)] == ["bubble 1", "larger"]
    assert [t.name for t in project.chosen(["larger"], fitted=True)] == ["larger"]
    said = complaint(project.chosen, "smaller", fitted=True)
    assert "'smaller'" in said and "bubble 1, larger" in said
    said = complaint(project.chosen, "strips", fitted=True)
    assert "[[strips]]" in said


def test_defaults_hold_for_every_test_that_says_nothing_else(edit):
    text = "[defaults.bubble]\nelements = 48\nnuisance = { pressure_offset = true }\n"
    project = edit("[fit]", SECOND + text + "[fit]")
    one, two = project.tests.values()
    assert (one.elements, two.elements) == (800, 48)
    assert (one.pressure_offset, two.pressure_offset) == (False, True)


def test_two_tests_of_one_name(edit):
    message = complaint(edit, "[fit]", SECOND.replace("larger", "bubble 1") + "[fit]")
    assert "bubble[1].name" in message and "twice" in message


def test_data_folders_by_test(edit, tmp_path):
    grid = tmp_path / "somewhere" / "grid"
    grid.mkdir(parents=True)
    for i in range(20):
        (grid / f"test1_{i:02d}.csv").touch()
    source = VALMEX / "test1-cubic.toml"
    project = read_project(source, {"bubble": tmp_path / "somewhere"})
    assert project.tests["bubble"].data.files[0] == grid / "test1_00.csv"
    assert "'bubbel'" in complaint(read_project, source, {"bubbel": tmp_path})


def test_computed_data_read_no_folder(tmp_path):
    for folder in (tmp_path, {"bubble": tmp_path}):
        said = complaint(read_project, KNOWN, folder)
        assert "known_solution" in said and "--data" in said


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("[law]", "[lwa]", ["lwa", "did you mean 'law'"]),
        ('"kPa"', '"psi"', ["units.pressure", "'kPa', 'MPa', 'bar' or 'Pa'", "'psi'"]),
        ('modulus = "GPa"', 'modulus = "kPa"', ["units.modulus", "'GPa', 'MPa' or 'Pa'"]),
        ("-1.0e-2,  0.0,", "nan, 0.0,", ["law.bounds.lower[0]", "finite", "nan"]),
        ("strain_range = [0.13, ", "strain_range = [", ["law.strain_range", "3 items"]),
        ("nu12 = 0.24", "nu12 = true", ["law.nu12", "number"]),
        ('constraints = "margin"', 'constraints = "boolean"', ["fit.constraints", "slsqp"]),
        ("radius = 100.0", "radius = ", ["TOML syntax", "line"]),
        ("starts = 50", "starts = 0", ["fit.starts", "1"]),
        ("thickness = 0.81", "# thickness", ["fabric.thickness", "missing"]),
        ("[fabric]", '[project]\nkind = "bubble"\n[fabric]', ["project.kind", "0.1"]),
    ],
)
def test_bad_input_names_file_and_field(edit, tmp_path, old, new, words):
    assert complaint_with(words, edit, old, new).startswith(str(tmp_path / "project.toml"))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("1.0e2, 1.0e2, 1.0, 5.0e-1", "1.0e2, -20.0, 1.0, 5.0e-1", ["lower[5]", "beta_5"]),
        ("-1.0e-2,  0.0,", "0.0,", ["law.bounds.lower", "12 coefficients", "got 11"]),
        ('form = "cubic"', 'form = "quadratic"', ["law.bounds.lower", "9 coefficients"]),
        ('form = "cubic"', 'form = "quartic"', ["law.form", "'quartic'", "cubic"]),
        ('form = "cubic"', 'form = "cubic"\nbreaks = [1]', ["law.breaks", "cubic"]),
        ("strain_range", "# strain_range", ["law.strain_range", "missing"]),
        ("lower = [", "E1 = [0.1, 1.0]\nlower = [", ["law.bounds", "some of both"]),
    ],
)
def test_a_law_that_cannot_be_meant(edit, tmp_path, old, new, words):
    project = edit(old, new)
    assert complaint_with(words, bounds, project).startswith(str(tmp_path / "project.toml"))


def test_unreadable_files(tmp_path):
    assert "bubblefit init" in complaint(read_project, tmp_path / "none.toml")
    assert "cannot be read" in complaint(read_project, tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in complaint(read_project, tmp_path / "binary.toml")
