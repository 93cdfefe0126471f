"""experiments/deck/model.py: the filled deck, and the files that it names."""

from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project

from ...builders.decks import bar, cube_project, write_curve
from ...support.refusals import complaint

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
