"""The commands `bend` and `simulate`: impossible cards are refused, checks of predictions."""

import json

import pytest
from bubblefit.solvers import registry

from ..builders.bent_cylinders import TOLD, Counted, write_cylinder_project
from ..support.commands import in_process, one_line
from ..support.paths import KNOWN


@pytest.fixture(autouse=True)
def formula(monkeypatch, tmp_path_factory):
    """The solver of these tests, by name; and the file that counts its runs."""
    told = tmp_path_factory.mktemp("told") / "runs"
    monkeypatch.setenv(TOLD, str(told))
    monkeypatch.setitem(registry.SOLVERS, "formula", Counted)
    return told


#: A card as a fit of another version wrote it: G12 falls below zero from 3 % of strain on.
IMPOSSIBLE = """
format = 2
law = "hypoelastic orthotropic"
form = "cubic"
unit = "MPa"
beta = [0.0, 0.0, -100.0, 3.0, 0.0, 0.0, 0.0, 120.0, 0.0, 0.0, 0.0, 600.0]
nu12 = 0.24
thickness_mm = 0.8
valid_strain = { warp = [0.0, 0.1], fill = [0.0, 0.1], shear = [0.0, 0.08] }
"""


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "bend", "--diameter", 150, "--pressure", 140, "--card", "card.toml"),
        ("simulate", "bubble", KNOWN, "--card", "card.toml"),
        ("export", "card.toml", "--format", "abaqus-umat"),
        ("bend", "project.toml", "--card", "card.toml"),
    ],
)
def test_card_with_a_negative_modulus_is_refused_in_one_line(tmp_path, command):
    (tmp_path / "card.toml").write_text(IMPOSSIBLE)
    write_cylinder_project(tmp_path)
    done = in_process(*command, cwd=tmp_path, code=2)
    one_line(done, "card.toml: beta: G12 is -5 MPa at 8 % of log strain")


def test_card_of_project_with_a_negative_modulus_is_named(tmp_path):
    text = write_cylinder_project(tmp_path).read_text()
    (tmp_path / "project.toml").write_text(
        f"{text}\n[[card]]\nname = 'impossible'\nstrain_range = [0.1, 0.1, 0.1]\n"
        "beta = [0.0, 0.0, -0.3, 0.01, 0.0, 0.0, 0.0, 0.12, 0.0, 0.0, 0.0, 0.6]\n"
    )
    done = in_process("bend", "project.toml", cwd=tmp_path, code=2)
    one_line(done, "project.toml: card", "G12 is -0.02 MPa at 10 % of log strain")


def test_check_of_a_predicting_project_lists_what_it_checked(tmp_path):
    path = write_cylinder_project(tmp_path)
    done = in_process("check", path, cwd=tmp_path)
    assert "its section and its models" in done.stdout and "predicted, not fitted" in done.stdout
    assert "cards were read: soft, stiff" in done.stdout
    folder = next((tmp_path / "out").glob("*check"))
    content = json.loads((folder / "check.json").read_text())
    assert content["verdict"]["state"] == "usable" and "bubblefit bend" in done.stdout
    assert content["sound"] and "predicted, not fitted" in content["checked"]["high"]
    assert "the project only predicts" in (folder / "report.html").read_text()
    wrong = path.read_text().replace("diameter = ", "diameter = -", 1)
    path.write_text(wrong)
    one_line(in_process("check", path, cwd=tmp_path, code=2), "diameter")
