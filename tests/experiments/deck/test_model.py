"""experiments/deck/model.py: filled decks, and conditions evaluated in the sandbox."""

from dataclasses import replace

import pytest
from bubblefit.experiments.deck.model import holds, linear_conditions
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project

from ...builders.decks import bar, cube_project, write_curve
from ...support.refusals import complaint

#: A square with a group of nodes at its top.
GEOMETRY = """\
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Mesh.MeshSizeMax = 1;
Physical Curve("GRIP") = {3};
Physical Surface("SHEET") = {1};
"""
LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)


def test_deck_has_the_files_that_it_names_and_no_others(tmp_path):
    (tmp_path / "other.inp").write_text("*NODE\n")
    write_curve(tmp_path / "frame.csv")
    project = read_project(cube_project(tmp_path))
    model = project.tests["cube"].model
    deck = model.with_parameters({"C10": 0.25}).deck(LAW)
    assert set(deck.files) == {"job.inp", "cube.inp"}
    assert f"{model.values['C10'] + 0.25:.13g}, 0.5, 0.01" in deck.files["job.inp"]
    mark = model.mark
    (tmp_path / "cube.inp").write_text("*NODE\n")
    assert model.mark != mark


def test_results_of_an_earlier_run_are_not_put_into_a_run(tmp_path):
    write_curve(tmp_path / "frame.csv")
    path = cube_project(tmp_path)
    model = read_project(path).tests["cube"].model
    template = tmp_path / model.template
    template.write_text(f"** writes old.csv, see cube.inp\n{template.read_text()}")
    (tmp_path / "old.csv").write_text("x,y\n0,0\n")
    assert "old.csv" in model.deck(LAW).files
    for name, listed in (("old.csv", ()), ("o*.csv", ()), ("old.csv", ("old.csv",))):
        reader = replace(model.reader, result=name)
        files = replace(model, reader=reader, listed=listed).deck(LAW).files
        assert ("old.csv" in files) == bool(listed) and "cube.inp" in files


def test_condition_refuses_parameters(tmp_path, monkeypatch):
    model = bar(tmp_path, monkeypatch).tests["bar"].model
    message = complaint(model.with_parameters, {"C10": -model.values["C10"], "C01": -0.5})
    assert "C10 + C01 > 0.1 does not hold at C10 = 0, C01 = 0" in message


def test_template_has_the_law_and_its_blocks(tmp_path, monkeypatch):
    model = bar(tmp_path, monkeypatch).tests["bar"].model
    (tmp_path / model.template).write_text(
        "{{ C10 }} {{ C01 }} {{ E1(0.02) }} {{ beta[3] }} {{ thickness }} {{ nu12 }}\n"
        '{{ law.calculix("SHEET") }}{{ law.calculix_name("SHEET") }}\n'
    )
    text = model.deck(LAW).files["job.txt"]
    assert " 300.0 10.0 1.0 0.24\n" in text
    for words in ("*MATERIAL, NAME=@BUBBLEFIT_HYPOELASTIC@SHEET", "*DEPVAR"):
        assert words.lower() in text.lower()
    (tmp_path / model.template).write_text("{{ C10 }}\n{{ C20 }}\n")
    assert "line 2: 'C20' is undefined; there are: C01, C10" in complaint(model.deck, LAW)


def test_blocks_of_the_law_for_other_programs(tmp_path, monkeypatch):
    model = bar(tmp_path, monkeypatch).tests["bar"].model
    (tmp_path / model.template).write_text(
        '{{ C10 }} {{ C01 }}\n{{ law.umat("COATED") }}{{ law.nlelast("sheet", points=5) }}'
        "{{ law.mat34() }}{{ law.hypela2() }}"
    )
    files = model.deck(LAW).files
    text = files["job.txt"]
    for words in ("*MATERIAL, NAME=COATED", "nlelast\n", "*MAT_FABRIC"):
        assert words in text
    assert "subroutine umat" in files["umat.f"].lower()
    assert "subroutine hypela2" in files["hypela2.f"].lower() and "hypela2(" not in text


def test_mesh_is_made_of_a_geometry_first(tmp_path, monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_PROGRAMS_FROM", str(tmp_path))
    (tmp_path / "plate.geo").write_text(GEOMETRY)
    write_curve(tmp_path / "frame.csv")
    change = [('template = "frame.inp.j2"', 'template = "frame.inp.j2"\ngeo = "plate.geo"')]
    path = cube_project(tmp_path, change)
    mesh = read_project(path).tests["cube"].model.deck(LAW).files["plate.inp"].decode()
    assert "*NSET,NSET=GRIP" in mesh and "CPS3" in mesh
    (tmp_path / "plate.geo").write_text("Rectangle(1) = {0, 0};\n")
    model = read_project(path).tests["cube"].model
    assert "Error" in complaint(model.deck, LAW)
    monkeypatch.delenv("BUBBLEFIT_PROGRAMS_FROM")
    assert "deck[0].geo: says what is run" in complaint(read_project, path)


AT = {"a": 0.5, "b": 0.2}


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("a + b > 0", True),
        ("0 < b < a", True),
        ("a < b or not a > b", False),
        ("a**2 <= 0.25 and b < 1", True),
        ("1 / (a - 0.5) > 0", False),
        ("", True),
    ],
)
def test_condition_holds(text, result):
    assert holds(text, AT) is result


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("c > 0", "feasible: 'c > 0': 'c' is undefined; there are: a, b"),
        ("a >", "there are: a, b"),
        ("__import__('os').system('true') > 0", "'__import__' is undefined"),
        ("a.__class__.__mro__ > 0", "access to attribute '__class__'"),
    ],
)
def test_anything_else_is_refused(text, words):
    assert words in complaint(holds, text, AT)


@pytest.mark.parametrize(
    ("text", "slopes", "least"),
    [
        ("a + b > 0", [(1, 1)], [0]),
        ("2 * a - b / 4 <= 3 and a * b > 1", [(-2, 0.25)], [-3]),
        ("0.1 < b < a", [(0, 1), (1, -1)], [0.1, 0]),
        ("-(a - 1) * 2 >= b", [(-2, -1)], [-2]),
        ("a > 0 or b > 0", [], []),
        ("a**2 > 0", [], []),
        ("a | abs > 0", [], []),
        ("1 > 0", [], []),
        ("", [], []),
    ],
)
def test_linear_conditions_are_inequalities(text, slopes, least):
    conditions = linear_conditions(text, {"a": (0.0, 1.0), "b": (0.0, 1.0)})
    assert [(values["a"], values["b"]) for values, _ in conditions] == slopes
    assert [limit for _, limit in conditions] == pytest.approx(least, abs=1e-8)
