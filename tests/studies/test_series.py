"""What studies share: which tests they can run, what parts are called, which card runs."""

import contextlib
import functools
import shutil
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError
from bubblefit.experiments.kinds import BEYOND_CARD, THICKNESS
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.reports import study_pages
from bubblefit.runs import simulation as analyses
from bubblefit.runs import simulation as module
from bubblefit.runs.simulation import (
    card_of,
    part_name,
    parts_of,
    studied_tests,
    thickness_notes,
)

from ..bars import BarKind, BarTest, project_of
from ..commands import in_process, result_in
from ..complaints import complaint
from ..projects import BUBBLE

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")


def test_parts_are_called_by_what_tells_them_apart(bars, monkeypatch):
    one, two = BarTest("one"), BarTest("two", ("warp", "fill"), elements=6, increments=3)
    project = project_of(one, two)
    assert list(parts_of(project, [one], 0.5)) == ["one"]
    assert list(parts_of(project, [two], 0.5)) == ["warp", "fill"]
    parts = parts_of(project, [one, two], 0.7, "increments", 2.0)
    assert list(parts) == ["one", "two: warp", "two: fill"]
    assert [part.name for part in parts.values()] == list(parts)
    assert [part.increments for part in parts.values()] == [8, 6, 6]
    assert {part.model.thickness for part in parts.values()} == {0.7}
    assert len(parts["one"].model.mesh.quads) == 32
    finer = parts_of(project, [one], 0.5, factor=2.0)["one"]
    assert len(finer.model.mesh.quads) == 128 and finer.increments == 4
    assert part_name(two, "warp", 2, 1) == "warp" and part_name(two, "warp", 1, 2) == "two"
    assert studied_tests(project) == studied_tests(project, []) == [one, two]
    assert studied_tests(project, ["two"]) == [two]
    monkeypatch.setattr(BarKind, "studied", None)
    said = complaint(studied_tests, project)
    assert said == "bars.toml: no study can run the tests of this project"


def test_the_card_that_is_given(bars, tmp_path):
    write_card(MaterialCard(CARD.law, 0.6, "filed"), tmp_path / "c.toml")
    project = project_of(BarTest("one"), cards={"own": CARD})
    assert card_of(project, CARD) is CARD and card_of(project, "own") is CARD
    assert card_of(project, tmp_path / "c.toml").name == "filed"
    assert tuple(map(module.card_words, (CARD, "own", Path("c")))) == ("soft", "own", "c")
    assert thickness_notes(project, CARD) == []
    (note,) = thickness_notes(project, MaterialCard(CARD.law, 0.6))
    assert note.kind is THICKNESS and "0.6 mm" in note and "0.5 mm" in note
    test = BarTest("one")
    said = complaint(parts_of, project_of(test), [test], 0.5, "elements", 0.05)
    assert said.startswith("bars.toml: refinement by 0.05") and said.endswith("got 0")

    class Filed(BarTest):
        def models(self, *_, **__):
            raise InputError("mesh.inp", "line 3", "odd")

    assert complaint(parts_of, project_of(test), [Filed("x")], 0.5) == "mesh.inp: line 3: odd"


def test_analyses_are_told_one_after_the_other(bars):
    steps, test = [], BarTest("one", ("warp", "fill"))
    series = module.Series(project_of(test), CARD, steps.append)
    assert series.total == 0 and series.solver is bars
    series.total = 2
    for part in parts_of(project_of(test), [test], 0.5).values():
        history = series.run_part(part, CARD.law)
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps] == [
        ("warp", 1, 2, 0.0, 4), ("warp", 1, 2, 4.0, 4),
        ("fill", 2, 2, 0.0, 4), ("fill", 2, 2, 4.0, 4),
    ]  # fmt: skip
    assert series.notes(history) == []
    short = SimpleNamespace(law=SimpleNamespace(strain_range=[0.09, 1.0, 1.0]))
    series.card = short
    assert [note.kind for note in series.notes(history)] == [BEYOND_CARD]


COMMANDS = {
    "mesh": ("study", "mesh", "project.toml", "--levels", 3),
    "nu12": ("study", "nu12", "project.toml", "--nu12", 0.1, "--nu12", 0.2, "--nu12", 0.4),
    "simulated": ("simulate", "test", "project.toml", "--card", "other.toml"),
}


class Killed(BaseException):
    """In place of a signal that nobody can catch: nothing of ours handles it."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "project.toml").write_text(BUBBLE)
    for name, modulus in (("card", 800.0), ("other", 700.0)):
        law = HypoelasticLaw.linear(modulus, 400.0, 80.0)
        write_card(MaterialCard(law, 0.81, name), tmp_path / f"{name}.toml")
    monkeypatch.setattr(study_pages, "save", lambda path, charts: path.touch())
    return tmp_path


@contextlib.contextmanager
def killed_after(count):
    made, real = [0], analyses.RunCache.write

    def write(self, *given):
        real(self, *given)
        made[0] += 1
        if made[0] > count:
            raise Killed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analyses.RunCache, "write", write)
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
def test_every_cut_ends_as_if_there_had_been_none(folder, what):
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
