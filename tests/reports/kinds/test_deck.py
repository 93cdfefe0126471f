"""reports/kinds/deck.py: folder and page of a fit without a law, and forward runs."""

import json
import tomllib

import pytest

from ...builders.decks import TRUE, bar_project
from ...support.commands import in_process


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("deck")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BUBBLEFIT_RUNS", str(folder / "runs"))
        path = bar_project(folder, patch, noise=0.002)
        done = in_process("fit", path, "--out", folder / "out", "--jobs", 1, cwd=folder)
    return folder / "out", done.output


def test_fit_writes_parameters_with_bands_and_the_filled_deck(fitted):
    folder, output = fitted
    parameters = tomllib.loads((folder / "parameters.toml").read_text())
    assert list(parameters) == ["C10", "C01"]
    for name, numbers in parameters.items():
        low, high = numbers["band"]
        assert low < numbers["value"] < high and numbers["unit"] == "MPa"
        assert abs(numbers["value"] - TRUE[name]) < 4 * numbers["sigma"]
    assert parameters["C10"]["correlation"]["C01"] < -0.9
    words = (folder / "job.txt").read_text().split()
    assert [float(word) for word in words] == pytest.approx(
        [parameters[name]["value"] for name in TRUE], rel=1e-9
    )
    assert not (folder / "material.toml").exists() and not (folder / "moduli.csv").exists()
    assert "C10: 0." in output and "correlation -1.00 with C01" in output
    assert "of command" in " ".join(output.split()) and "tangent moduli" not in output


def test_page_shows_what_is_compared(fitted):
    page = (fitted[0] / "report.html").read_text()
    for words in ("Unknowns beside the moduli", "parameters.toml", "RMS error of force", "job.txt"):
        assert words in page
    assert "Young" not in page
    table = (fitted[0] / "residuals.csv").read_text().splitlines()
    assert table[0] == "test,part,x,quantity,measured,modelled,difference,unit" and len(table) == 13


def test_validation_predicts_what_is_left_out_with_the_parameters_of_the_others(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(tmp_path / "runs"))
    path = bar_project(tmp_path, monkeypatch, noise=0.002)
    text = path.read_text()
    deck = text[text.index("[[deck]]") :]
    (tmp_path / "stiffer.csv").write_text("travel [mm],force [N]\n2,0.8\n4,1.4\n")
    second = deck.replace('"bar"', '"stiffer bar"').replace("frame.csv", "stiffer.csv")
    path.write_text(text + second)
    in_process(
        "validate", path, "--out", tmp_path / "out", "--starts", 2, "--jobs", 1, cwd=tmp_path
    )
    rows = (tmp_path / "out" / "validation.csv").read_text().splitlines()
    predicted = {row.split(",")[1]: float(row.split(",")[4]) for row in rows[1:]}
    assert predicted["stiffer bar"] > 0.2  # N: its own parameters would fit both readings
    message = in_process("plan", path, cwd=tmp_path, code=2).output
    assert "this is a study of moduli, and the project has no law" in message
    message = in_process("study", "mesh", path, "--card", "x.toml", cwd=tmp_path, code=2).output
    assert "no study can run the tests of this project" in message


def test_deck_is_run_at_its_start_and_at_fitted_parameters(fitted, monkeypatch, golden, tmp_path):
    folder, _ = fitted
    project = folder.parent / "project.toml"
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(folder.parent / "runs"))
    monkeypatch.setenv("BUBBLEFIT_PROGRAMS_FROM", str(folder.parent))
    out = tmp_path / "simulated"
    shown = in_process("simulate", "deck", project, "--out", out, cwd=folder.parent)
    golden("simulate-deck", shown.stdout, tmp_path)
    start = shown.output
    assert "start: C10 0.3873, C01 0.5" in start and "(72 % of the largest)" in start
    card = ("--card", folder / "parameters.toml", "--out", out, "--overwrite")
    best = in_process("simulate", "test", project, *card, cwd=folder.parent).output
    assert "(0.15 % of the largest)" in " ".join(best.split())
    head, *rows = (out / "compared.csv").read_text().splitlines()
    assert head == "card,part,x,quantity,measured,modelled,difference,unit" and len(rows) == 12
    assert "What is compared of the deck" in (out / "report.html").read_text()
    (folder / "wrong.toml").write_text("[C10]\nvalue = 0.3\n")
    wrong = ("--card", folder / "wrong.toml", "--out", out, "--overwrite")
    message = in_process("simulate", "deck", project, *wrong, cwd=folder.parent, code=2).output
    assert "--card: there is no value of C01, only of: C10" in message


def test_profile_of_a_parameter_has_the_ends_of_the_band(fitted, monkeypatch):
    folder, _ = fitted
    project = folder.parent / "project.toml"
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(folder.parent / "runs"))
    monkeypatch.setenv("BUBBLEFIT_PROGRAMS_FROM", str(folder.parent))
    out = folder.parent / "profile"
    options = ("--parameter", "C01", "--card", folder / "parameters.toml", "--out", out)
    output = in_process("profile", project, *options, "--jobs", 1, cwd=folder.parent).output
    assert "C01: 0.08498 MPa, 95 % from 0.07438 to 0.09558" in output
    (numbers,) = json.loads((out / "result.json").read_text())["profiles"]
    band = tomllib.loads((folder / "parameters.toml").read_text())["C01"]["band"]
    assert [numbers["lower"], numbers["upper"]] == pytest.approx(band, rel=2e-3)
    assert (out / "profile.csv").read_text().startswith("parameter,unit,value,minus_2_log_L,")
    wrong = ("--parameter=C1", "--card", folder / "parameters.toml")
    for options, words in ((wrong, "one of C10, C01"), (["--modulus=E1"], "no law")):
        assert words in in_process("profile", project, *options, cwd=folder.parent, code=2).output
