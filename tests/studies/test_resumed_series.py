"""Studies with a card and simulations that were cut off: the rest is run, the end is the same."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs import simulation as analyses
from bubblefit.runs.folder import FOLDER

from ..commands import in_process, result_in
from ..projects import BUBBLE

COMMANDS = {
    "mesh": ("study", "mesh", "project.toml", "--levels", 3),
    "nu12": ("study", "nu12", "project.toml", "--nu12", 0.1, "--nu12", 0.2, "--nu12", 0.4),
    "simulated": ("simulate", "test", "project.toml", "--card", "other.toml"),
}


class Killed(BaseException):
    """In place of a signal that nobody can catch: nothing of ours handles it."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "project.toml").write_text(BUBBLE)
    for name, modulus in (("card", 800.0), ("other", 700.0)):
        law = HypoelasticLaw.linear(modulus, 400.0, 80.0)
        write_card(MaterialCard(law, 0.81, name), tmp_path / f"{name}.toml")
    monkeypatch.setattr("bubblefit.reports.save", lambda path, _: path.touch())
    return tmp_path


def killed_after(monkeypatch: pytest.MonkeyPatch, count: int) -> list[int]:
    """Of the analyses that are made, one more than `count` is the end; how many there were."""
    made = [0]

    def run(self, model, law, *given, real=analyses.Once.run, **named):
        before = self.cache.entries()
        history = real(self, model, law, *given, **named)
        if len(self.cache.entries()) > len(before):
            made[0] += 1
        if made[0] > count:
            raise Killed
        return history

    monkeypatch.setattr(analyses.Once, "run", run)
    return made


def without(result, *names: str):
    if isinstance(result, dict):
        return {k: without(v, *names) for k, v in result.items() if k not in names}
    return [without(one, *names) for one in result] if isinstance(result, list) else result


@pytest.mark.parametrize("what", COMMANDS)
def test_every_cut_ends_as_if_there_had_been_none(folder: Path, what: str) -> None:
    command = functools.partial(
        in_process, *COMMANDS[what], "--card", "card.toml", "--out", "out", cwd=folder
    )
    out = folder / "out"
    with pytest.MonkeyPatch.context() as patch:
        total = killed_after(patch, 1000)
        command()
    whole, tables = result_in(out), sorted(out.glob("*.csv"))
    before = {path.name: path.read_bytes() for path in tables}
    assert total[0] >= 2
    for cut in range(total[0]):
        shutil.rmtree(out)
        with pytest.MonkeyPatch.context() as patch:
            killed_after(patch, cut)
            with pytest.raises(Killed):
                run_here(folder, what)
        assert not (out / "result.json").exists()
        with pytest.MonkeyPatch.context() as patch:
            made = killed_after(patch, 1000)
            command("--resume")
        assert made[0] == total[0] - cut - 1
        assert without(result_in(out), "seconds") == without(whole, "seconds")
        for name, content in before.items():
            one, other = (pd.read_csv(source) for source in (out / name, io.BytesIO(content)))
            own = [column for column in one if column not in ("seconds",)]
            pd.testing.assert_frame_equal(one[own], other[own], check_exact=True)


def run_here(folder: Path, what: str) -> None:
    """Not by click's runner, which would take the end for an exception of the command."""
    arguments = [*map(str, COMMANDS[what]), "--card", "card.toml", "--out", "out"]
    with contextlib.chdir(folder):
        main(arguments, standalone_mode=False)


def test_what_there_is_to_go_on_with(folder: Path) -> None:
    arguments = (*COMMANDS["nu12"], "--card", "card.toml", "--out", "out")
    done = in_process(*arguments, "--resume", cwd=folder, code=2)
    assert "out: holds nothing to go on with; leave --resume out" in done.output
    done = in_process(*arguments, "--resume", "--overwrite", cwd=folder, code=2)
    assert "give one of them, not both" in done.output
    in_process(*arguments, cwd=folder)
    done = in_process(*arguments, cwd=folder, code=2)
    assert "already holds a result" in done.output
    kept = list((folder / "out" / FOLDER).glob("*/*.run"))
    assert len(kept) == 4
    # Another card: nothing of the first is taken.
    before = result_in(folder / "out")
    other = (*COMMANDS["nu12"], "--card", "other.toml", "--out", "out")
    in_process(*other, "--resume", cwd=folder)
    after = result_in(folder / "out")
    assert json.dumps(after["models"]) != json.dumps(before["models"])
    in_process(*other, "--overwrite", cwd=folder)
    assert len(list((folder / "out" / FOLDER).glob("*/*.run"))) == 4


def test_seconds_are_those_of_the_run(folder: Path) -> None:
    arguments = (*COMMANDS["mesh"], "--card", "card.toml", "--out", "out")
    in_process(*arguments, cwd=folder)
    first = pd.read_csv(folder / "out" / "convergence.csv")
    in_process(*arguments, "--resume", cwd=folder)
    second = pd.read_csv(folder / "out" / "convergence.csv")
    assert first["seconds"].tolist() == second["seconds"].tolist()
