"""Commands that are killed, interrupted or cut off from their output, and that go on."""

import contextlib
import functools
import shutil

import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.reports import study_pages
from bubblefit.solvers import run_cache

from ..builders.projects import CONSTANT_BUBBLE
from ..support.commands import in_process, result_in

COMMANDS = {
    "mesh": ("study", "mesh", "project.toml", "--levels", 3),
    "nu12": ("study", "nu12", "project.toml", "--nu12", 0.1, "--nu12", 0.2, "--nu12", 0.4),
    "simulated": ("simulate", "test", "project.toml", "--card", "other.toml"),
}


class Killed(BaseException):
    """In place of a signal that nobody can catch: nothing of ours handles it."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "project.toml").write_text(CONSTANT_BUBBLE)
    for name, modulus in (("card", 800.0), ("other", 700.0)):
        law = HypoelasticLaw.linear(modulus, 400.0, 80.0)
        write_card(MaterialCard(law, 0.81, name), tmp_path / f"{name}.toml")
    monkeypatch.setattr(study_pages, "save", lambda path, charts: path.touch())
    return tmp_path


@contextlib.contextmanager
def killed_after(count):
    made, real = [0], run_cache.RunCache.write

    def write(self, *given):
        real(self, *given)
        made[0] += 1
        if made[0] > count:
            raise Killed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_cache.RunCache, "write", write)
        yield made


def without(result, *names):
    if isinstance(result, dict):
        return {k: without(v, *names) for k, v in result.items() if k not in names}
    return [without(one, *names) for one in result] if isinstance(result, list) else result


def written(out):
    tables = {path.name: pd.read_csv(path) for path in sorted(out.glob("*.csv"))}
    plain = {n: t.drop(columns="seconds", errors="ignore").to_csv() for n, t in tables.items()}
    return without(result_in(out), "seconds"), plain


@pytest.mark.parametrize("what", COMMANDS)
def test_study_killed_at_any_write_ends_as_if_uninterrupted(folder, what):
    command, out = (*COMMANDS[what], "--card", "card.toml", "--out", "out"), folder / "out"
    again = functools.partial(in_process, *command, cwd=folder)
    with killed_after(1000) as total:
        again()
    whole = written(out)
    assert total[0] >= 2
    for cut in range(total[0]):
        shutil.rmtree(out)
        # Not by click's runner, which would take the end for an exception of the command.
        with killed_after(cut), contextlib.chdir(folder), pytest.raises(Killed):
            main([*map(str, command)], standalone_mode=False)
        assert not (out / "result.json").exists()
        with killed_after(1000) as made:
            again("--resume")
        assert made[0] == total[0] - cut - 1
        assert written(out) == whole
    if what == "mesh":
        first = pd.read_csv(out / "convergence.csv")["seconds"].tolist()
        again("--resume")
        assert pd.read_csv(out / "convergence.csv")["seconds"].tolist() == first
