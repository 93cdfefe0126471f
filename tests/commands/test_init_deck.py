"""From an input deck to a project: `bubblefit init mine --deck frame.inp`."""

import tomllib

import pytest
from bubblefit.cli.main import main
from bubblefit.experiments.deck.solvers import ANY_LAW
from bubblefit.project.project import read_project
from click.testing import CliRunner

from ..builders.decks import CUBE, DECK
from ..support import needs
from ..support.commands import in_process

PLAIN = DECK.replace("{{ C10 | number }}", "0.3").replace("{{ C01 | number }}", "0.08")


@pytest.fixture
def written(tmp_path):
    """Folder in which `mine` was written for the deck of a cube; its output."""
    (tmp_path / "cube.inp").write_text(CUBE)
    (tmp_path / "frame.inp").write_text(PLAIN)
    output = in_process("init", "mine", "--deck", "frame.inp", cwd=tmp_path).stdout
    return tmp_path, " ".join(output.split())


def write_readings(folder):
    rows = [f"{0.06 * k:.2f},{0.02 * k:.3f}" for k in range(1, 11)]
    (folder / "mine" / "measured.csv").write_text("\n".join(["travel [mm],force [N]", *rows]))


def test_project_has_constants_sets_and_outputs_of_the_deck(written):
    folder, output = written
    for words in ("materials: RUBBER", "node sets: GRIP, BOTTOM, ALL", "steps: *STATIC"):
        assert words in output
    assert "parameters: C10, C01" in output and "next: bubblefit check mine" in output
    deck = tomllib.loads((folder / "mine" / "project.toml").read_text())["deck"][0]
    assert deck["parameters"] == {
        "C10": {"bounds": [0.06, 1.5], "start": 0.3},
        "C01": {"bounds": [0.016, 0.4], "start": 0.08},
    }
    assert deck["compare"][0]["x"] == {"column": "travel", "set": "GRIP", "displacement": "z"}
    assert deck["compare"][0]["y"] == {"column": "force", "set": "GRIP", "reaction": "z"}


def test_template_at_the_start_is_the_deck_and_so_without_parameters(written):
    folder, _ = written
    write_readings(folder)
    path = folder / "mine" / "project.toml"
    lines = path.read_text().splitlines()
    for left_out in ("#", "C01 = "):
        kept = [line for line in lines if not line.startswith(left_out)]
        path.write_text("\n".join(kept))
        files = read_project(path).tests["frame"].model.deck(ANY_LAW).files
        assert files["job.inp"] == PLAIN.replace("0.3,", "0.3,")
        assert files["cube.inp"].decode() == CUBE


def test_check_of_the_project_runs_the_deck(written):
    needs.calculix()
    folder, _ = written
    write_readings(folder)
    output = in_process("check", "mine", cwd=folder).stdout
    assert "one run took" in output and "C10" in output and "10 values from" in output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--deck", "frame.inp", "--own"), "--own, --deck: give one of them, not both"),
        (("--deck", "none.inp"), "none.inp: there is no file none.inp"),
        (("--deck", "cube.inp"), "cube.inp: holds no constants of *ELASTIC, *HYPERELASTIC"),
    ],
)
def test_unfit_decks_are_one_line_and_write_nothing(tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cube.inp").write_text(CUBE)
    (tmp_path / "frame.inp").write_text(PLAIN)
    done = CliRunner().invoke(main, ["init", "mine", *options])
    assert done.exit_code == 2 and words in done.output and done.output.count("\n") == 1
    assert not (tmp_path / "mine").exists()
