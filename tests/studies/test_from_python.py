"""Every study from Python gives what its command writes; progress in notebooks and elsewhere."""

import json
import sys
from contextlib import chdir
from types import SimpleNamespace

import bubblefit as bf
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.project.schema import usual_folder
from bubblefit.reports import vega
from bubblefit.runs import progress as module
from bubblefit.runs.predictions import RunEvent
from bubblefit.runs.progress import ProgressBar, listener
from bubblefit.runs.simulation import Step
from bubblefit.runs.starts import EvaluationRecord, Stage, StartRecord

from ..builders.projects import constant_strips
from ..support.commands import in_process
from ..support.refusals import raised

#: Command with its options, and the same from Python; the result is in check.json or result.json.
STUDIES = {
    "check": (["check", "--trust", "preload"], {"trust": ["preload"]}),
    "compare": (
        ["compare", *"--form constant --folds 2 --starts 1".split(),
         "--fold-starts", "1"],
        {"forms": ["constant"], "folds": 2, "starts": 1, "fold_starts": 1},
    ),
    "validate": (
        ["validate", "--leave", "specimens", "--starts", "1"], {"leave": "specimens", "starts": 1}
    ),
    "profile": (["profile", "--modulus", "E1=0.05"], {"moduli": {"E1": [0.05]}}),
    "bootstrap": (
        ["bootstrap", "--over", "specimens", "--samples", "3"],
        {"over": "specimens", "samples": 3},
    ),
    "plan": (["plan", "--rank", "E1", "--specimens", "2"], {"rank": "E1", "specimens": 2}),
    "refine": (
        ["study", "mesh", "--card", "out/project/material.toml", "--levels", "2"], {"levels": 2}
    ),
}  # fmt: skip
NOTHING = b'<svg viewBox="0 0 1 1"></svg>'
#: What no two runs have in common.
TIMES = ("seconds", "wall_s", "cpu_s", "card")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "project"
    folder.mkdir()
    path = constant_strips(folder, ("seed = 7", "seed = 7\njobs = 1"))
    with chdir(folder):
        bf.fit(bf.read_project(path), starts=1).report(usual_folder(path))
    return folder


def without_times(value):
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in TIMES}
    return [without_times(v) for v in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_from_python_is_that_of_its_command(folder, name, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(vega, "convert", lambda kind, spec: NOTHING)  # drawing takes long
    (command, *words), given = STUDIES[name]
    before = 2 if command == "study" else 1
    words = [command, *words[: before - 1], "project.toml", *words[before - 1 :]]
    quiet = [] if command == "study" else ["--quiet"]
    in_process(*words, "--out", f"command-{name}", *quiet, cwd=folder)
    study, heard, out = getattr(bf, name), [], f"python-{name}"
    project = bf.read_project("project.toml")
    found = study(project, **given, out=out, progress=lambda *event: heard.append(event))
    assert heard
    file = "check.json" if name == "check" else "result.json"
    ours, theirs = (
        without_times(json.loads((folder / place / file).read_text()))
        for place in (out, f"command-{name}")
    )
    assert ours == theirs
    assert without_times(json.loads(json.dumps(found.result, default=list))) == theirs
    assert {p.name for p in (folder / out).iterdir()} == {
        p.name for p in (folder / f"command-{name}").iterdir()
    }
    if name != "check":
        assert found.plot().charts.charts
        raised(OutputError, "already holds", study, project, **given, out=out, progress=False)


def test_verification_is_that_of_its_command(tmp_path):
    heard = []
    found = bf.verify(["bars"], progress=lambda *event: heard.append(event))
    done = in_process("verify", "--subject", "bars", "--json", cwd=tmp_path)
    assert found.result == json.loads(done.stdout) and found.result["ok"] and not found.missed
    assert list(found.table()["ours"]) == [one.ours for one in found.subjects["bars"]]
    assert heard == [(0, 1, "bars"), (1, 1, "")]


def test_comparisons_and_validations_trust_as_fits_do(folder):
    project = bf.read_project(folder / "project.toml")
    for study, given in ((bf.compare, {}), (bf.validate, {}), (bf.weights, {"counted": "two"})):
        with pytest.raises(InputError, match="there is no doubt 'nonsense'"):
            study(project, **given, trust=["nonsense"], progress=False)
        raised(InputError, "starts: expected", study, project, **given, starts="two")


class Shell:
    """The part of IPython that a bar needs; what was displayed, in order."""

    def __init__(self, kernel):
        self.seen = []
        shell = SimpleNamespace(kernel=1) if kernel else SimpleNamespace()
        self.get_ipython = lambda: shell
        self.display = self

    def __call__(self, *arguments, **named):
        raise AssertionError

    def show(self, shown, raw, display_id=False):
        assert raw
        self.seen.append((display_id, shown))
        return SimpleNamespace(update=lambda shown, raw: self.seen.append((False, shown)))


@pytest.fixture
def shell(monkeypatch):
    def install(kernel):
        one = Shell(kernel)
        one.display = SimpleNamespace(display=one.show)
        monkeypatch.setitem(sys.modules, "IPython", one)
        monkeypatch.setattr(module, "BAR_INTERVAL_S", 0.0)
        monkeypatch.setattr(module, "LINE_INTERVAL_S", 0.0)
        return one

    return install


START = StartRecord(0, (1, 0), 0.5, "converged", 3, (), (), 0.1)
EVENTS = [
    ((2, 5, "E1 at 0.1"), "2 of 5, E1 at 0.1"), ((3, 5, ""), "3 of 5, E1 at 0.1"),
    (("all tests",), "all tests"), ((Stage("starts", 2),), "0 of 2 starts, all tests"),
    ((EvaluationRecord(0, 1, 0.5, "", (), ()),), "start 0 at 0.5, 1 analysis"),
    ((START,), "1 of 2 starts, all tests, best 0.5, 1 analysis"), ((None,), "1 of 2 starts"),
    ((Step("bar", 2, 3, 0.0, 4),), "0 of 4 increments, analysis 2 of 3, bar"),
    ((RunEvent(None, 4, 4),), "4 of 4 increments"),
]  # fmt: skip


def test_a_bar_follows_every_study(shell):
    seen, bar = shell(True).seen, listener(None)
    assert isinstance(bar, ProgressBar)
    for event, words in EVENTS:
        bar(*event)
        first, shown = seen[-1]
        assert words in shown["text/plain"]
        assert f"value={bar.done:g} max={max(bar.total, 1)}>" in shown["text/html"]
        assert first == (len(seen) == 1)  # then in place
    bar("<b>")
    assert "<b>" not in seen[-1][1]["text/html"]


def test_who_gets_a_bar(shell, capsys):
    def callback(*event):
        pass

    notebook = shell(True)
    assert listener(callback) is callback
    listener(False)(1, 2, "x")
    assert not notebook.seen
    shell(False)
    listener(None)(1, 2, "x")
    assert capsys.readouterr().err == ""
    listener(True)(1, 2, "x")
    assert capsys.readouterr().err.startswith("1 of 2, x")
