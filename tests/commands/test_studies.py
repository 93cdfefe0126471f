"""Studies as commands and from Python: the same files, and the same end after any cut."""

import json
import warnings
from contextlib import chdir

import bubblefit as bf
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.notes import GRAVE
from bubblefit.project.schema import usual_folder
from bubblefit.reports import vega

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
def test_study_from_python_equals_that_of_command(folder, name, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(vega, "convert", lambda kind, spec: NOTHING)  # drawing takes long
    (command, *words), given = STUDIES[name]
    before = 2 if command == "study" else 1
    words = [command, *words[: before - 1], "project.toml", *words[before - 1 :]]
    quiet = [] if command == "study" else ["--quiet"]
    in_process(*words, "--out", f"command-{name}", *quiet, cwd=folder)
    study, heard, out = getattr(bf, name), [], f"python-{name}"
    project = bf.read_project("project.toml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = study(project, **given, out=out, progress=lambda *event: heard.append(event))
    assert heard
    ours = [str(w.message) for w in caught if w.category is bf.BubblefitWarning]
    notes = getattr(found, "notes", ())
    assert ours == [note.line for note in notes if note.kind.weight >= GRAVE]
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


def test_verification_from_python_equals_that_of_command(tmp_path):
    heard = []
    found = bf.verify(["bars"], progress=lambda *event: heard.append(event))
    done = in_process("verify", "--subject", "bars", "--json", cwd=tmp_path)
    assert found.result == json.loads(done.stdout) and found.result["ok"] and not found.missed
    assert list(found.table()["ours"]) == [one.ours for one in found.subjects["bars"]]
    assert heard == [(0, 1, "bars"), (1, 1, "")]


def test_comparison_and_validation_refuse_doubtful_data_unless_trusted(folder):
    project = bf.read_project(folder / "project.toml")
    for study, given in ((bf.compare, {}), (bf.validate, {}), (bf.weights, {"counted": "two"})):
        with pytest.raises(InputError, match="there is no doubt 'nonsense'"):
            study(project, **given, trust=["nonsense"], progress=False)
        raised(InputError, "starts: expected", study, project, **given, starts="two")
