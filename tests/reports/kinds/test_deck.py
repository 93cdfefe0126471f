"""reports/kinds/deck.py: folder and page of a fit without a law, and forward runs."""

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
    in_process("validate", path, "--out", tmp_path / "out", "--jobs", 1, cwd=tmp_path)
    rows = (tmp_path / "out" / "validation.csv").read_text().splitlines()
    predicted = {row.split(",")[1]: float(row.split(",")[4]) for row in rows[1:]}
    assert predicted["stiffer bar"] > 0.2  # N: its own parameters would fit both readings
    message = in_process("profile", path, cwd=tmp_path, code=2).output
    assert "a fit without a law has no card, but bands of parameters" in message
