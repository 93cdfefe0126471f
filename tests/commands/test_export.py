"""`bubblefit export`: files written, overwritten, refused, listed as JSON."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.materials import card as card_module
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.export_formats import FORMATS
from click.testing import CliRunner

from ..builders.fortran import GONE, LAWS
from ..materials.cases import EXPORTED_CARD, export, few_points


@pytest.fixture
def card_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_card(EXPORTED_CARD, tmp_path / "material.toml")
    return tmp_path


def run_export(*arguments, code=0):
    done = CliRunner().invoke(main, ["export", *map(str, arguments)])
    assert done.exit_code == code, (done.output, done.exception)
    return done.output


@pytest.mark.parametrize("name", FORMATS)
def test_export_command_writes_the_files_of_the_format(card_folder, name):
    few = few_points(name)
    points = [x for key, value in few.items() for x in (f"--{key}", value)]
    text = run_export("material.toml", "--format", name, *points)
    made = export(name, **few)
    paths = [card_folder / f"material-{name}{suffix}" for suffix in made.files]
    assert sorted(paths) == sorted(p for p in card_folder.iterdir() if p.name != "material.toml")
    assert [path.read_text() for path in paths] == list(made.files.values())
    assert made.remarks.carries and all(line in text for line in made.remarks.lines())
    for suffix, content in made.files.items():
        if suffix not in (".c", ".law"):  # every file begins with what is carried and lost
            content = content.removeprefix("*KEYWORD\n")
            head = " ".join(content[: content.index("units: ")].split())
            assert "written by bubblefit" in head and "card: Valmex 7318" in head
            marks = content.split(" ", 1)[0]
            lines = [x.removeprefix(marks).removeprefix(" ") for x in content.splitlines()]
            assert set(made.remarks.lines()) <= set(lines)
    for law in ("tri-linear, held", "spline, incompressible"):
        card = MaterialCard(LAWS[law], 0.8, "Valmex 7318", "")
        write_card(card, card_folder / "material.toml", "MPa")
        run_export("material.toml", "--format", name, "--force", *points)
        assert [path.read_text() for path in paths] == [*export(name, card, **few).files.values()]


def test_export_command_overwrites_with_force_only(card_folder):
    command = ("material.toml", "--format", "abaqus-umat", "--out", "law.f")
    run_export(*command)
    assert {p.name for p in card_folder.iterdir()} == {"material.toml", "law.f", "law.inp"}
    (card_folder / "law.f").unlink()
    (card_folder / "law.inp").write_text("mine")
    assert run_export(*command, code=2).startswith("bubblefit: law.inp: ")
    assert (card_folder / "law.inp").read_text() == "mine" and not (card_folder / "law.f").exists()
    run_export(*command, "--force")
    assert (card_folder / "law.inp").read_text() != "mine" and (card_folder / "law.f").exists()
    (card_folder / "cards").mkdir()
    run_export(*command[:-1], "cards")
    names = {path.name for path in (card_folder / "cards").iterdir()}
    assert names == {"material-abaqus-umat.f", "material-abaqus-umat.inp"}
    run_export(*command[:-1], "law-0.8")
    assert (card_folder / "law-0.8.inp").exists()
    run_export("material.toml", "--format", "calculix", "--out", ".")
    assert (card_folder / "material-calculix.c").exists()


@pytest.mark.parametrize("name", FORMATS)
def test_export_command_refuses_a_card_without_stiffness(card_folder, name, monkeypatch):
    for law, words in (
        (dataclasses.replace(GONE, strain_range=[0.1, 0.1, 0.1]),
         "beta: E1 is -500 MPa at 10 % of log strain"),
        (HypoelasticLaw(np.zeros(12)), "beta: E1 is 0 MPa at 0 % of log strain,"),
        (HypoelasticLaw.linear(1.0, 1000.0, 20.0), "nu12: nu12 nu21 is not below 1"),
    ):  # fmt: skip
        with monkeypatch.context() as patch:
            patch.setattr(card_module, "check_positive", lambda law: None)
            write_card(MaterialCard(law, 0.8), card_folder / "material.toml")
        text = run_export("material.toml", "--format", name, code=2)
        assert text.startswith(f"bubblefit: material.toml: {words}") and text.count("\n") == 1
    assert [path.name for path in card_folder.iterdir()] == ["material.toml"]


def test_export_command_lists_files_as_json_and_refuses_a_missing_card(card_folder):
    run_export("material.toml", "--format", "csv", "--points", 11, "--reach", 0.1)
    assert len(pd.read_csv(card_folder / "material-csv.csv", comment="#")) == 33
    content = json.loads(run_export("material.toml", "--format", "calculix", "--json"))
    assert content["files"] == [f"material-calculix.{end}" for end in ("inp", "c", "law")]
    assert content["format"] == "calculix" and content["carries"] and content["loses"]
    assert "nowhere.toml: cannot be read" in run_export("nowhere.toml", "--format", "csv", code=2)
    # A card that fails beyond its range is bad input where a curve goes there.
    write_card(MaterialCard(GONE, 0.8), card_folder / "material.toml")
    text = run_export("material.toml", "--format", "csv", "--force", code=2)
    assert text.startswith("bubblefit: material.toml: beta: a modulus or 1 - nu12 nu21 is not pos")
    run_export("material.toml", "--format", "csv", "--force", "--reach", 0.04)
    run_export("material.toml", "--format", "abaqus-umat")
    for each in FORMATS.values():
        for entry in dataclasses.fields(each.options):
            assert entry.metadata["option"].help.endswith(".")
