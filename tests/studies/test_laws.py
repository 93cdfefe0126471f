"""Forms side by side, and studies begun from Python."""

import json
import math
import sys
from contextlib import chdir
from dataclasses import asdict
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, Note, OutputError
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.project.schema import usual_folder
from bubblefit.reports import study_pages, vega
from bubblefit.runs import compare as study
from bubblefit.runs import progress as module
from bubblefit.runs.compare import FOLD, LOST, FoldError, FormFit, LawComparison, compare
from bubblefit.runs.predictions import RunEvent
from bubblefit.runs.progress import Bar, listener
from bubblefit.runs.simulation import Step, StudyRecord, mark_of
from bubblefit.runs.starts import EvaluationRecord, Stage, StartRecord
from bubblefit.solvers.base import SNAP

from ..commands import in_process
from ..projects import constant_strips


class Run:
    def __init__(self, folder, patch):
        self.out, self.events, self.pages, self.drawn = folder / "out", [], [], []
        self.path = constant_strips(folder, ("starts = 2", "jobs = 1"))
        patch.setattr(study_pages, "save", lambda *args: self.drawn.append(args))
        patch.setattr(study_pages, "_responses", lambda *_: [("loads.png", "loads")])
        patch.setattr(bf.Fit, "report", lambda *_: None)
        patch.setattr(study_pages, "write_report", lambda folder, page: self.pages.append(page))

    def compare(self, **options):
        self.events.clear()
        options = {"progress": self.events.append, **options}
        return compare(
            bf.read_project(self.path), ["one"], ("constant", "linear"), folds=5, starts=1,
            fold_starts=1, out=self.out, **options,
        )  # fmt: skip

    @property
    def judged(self):
        return [event for event in self.events if isinstance(event, FoldError)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        yield Run(tmp_path_factory.mktemp("laws"), patch)


@pytest.fixture(scope="module")
def compared(run):
    done = run.compare()
    told = [event for event in run.events if isinstance(event, str | FoldError)]
    assert told[0] == "constant" and told[3] == "linear" and len(told) == 6
    return done


def test_going_on_validates_nothing_twice(compared, run):
    before = [form.folds for form in compared.forms]
    with pytest.raises(OutputError, match="--resume"):
        run.compare()
    again = run.compare(resume=True)
    assert [form.folds for form in again.forms] == before and not run.judged
    path = run.out / "linear" / "validation.json"
    written = json.loads(path.read_text())
    assert path.read_text() == json.dumps(written, indent=1) + "\n" and len(written["folds"]) == 2
    for change, numbers in (({"of": "another"}, {0, 1}), ({"folds": written["folds"][:1]}, {1})):
        path.write_text(json.dumps({**written, **change}))
        assert [form.folds for form in run.compare(resume=True).forms] == before
        made = {json.dumps(written["folds"][k]) for k in numbers}
        assert {json.dumps(asdict(fold)) for fold in run.judged} == made
    assert json.loads(path.read_text()) == written


def test_what_is_replaced_is_not_gone_on_with(run, compared):
    other = run.path.read_text().replace("seed = 7", "seed = 8")
    assert other != run.path.read_text()
    run.path.write_text(other)

    def stop(event):
        if event == "constant":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.compare(progress=stop, overwrite=True)
    again = run.compare(resume=True)
    assert [form.fit.project.fit.seed for form in again.forms] == [8, 8]


def test_rows_of_another_fit_are_not_taken(tmp_path):
    def rows(of, folder=tmp_path):
        return StudyRecord(folder, "rows.json", "folds", FoldError, "fold", {"of": of}).rows

    path, mark = tmp_path / "rows.json", mark_of({"of": "this"})
    first = {"fold": 1, "value": 0.5, "rms": {}}
    for folds, wanted in (([], {}), ([first], {1: FoldError(**first)}), ([{"colour": 1}], {})):
        path.write_text(json.dumps({"of": mark, "folds": folds}))
        assert rows("this") == wanted and rows("another") == {}
    path.write_text("{")
    assert rows("this") == {} and rows("this", tmp_path / "none") == {}


class Form(FormFit):
    coefficients, fitted, rms = 0, 3.0, {"warp": 2.0, "fill": 4.0}


def form(name, coefficients, *folds):
    objective = SimpleNamespace(unit="N")
    parts = [SimpleNamespace(name=part, objective=objective) for part in ("warp", "fill", "b")]
    fit = SimpleNamespace(
        law=SimpleNamespace(form=Polynomial(0)), problem=SimpleNamespace(comparisons=parts),
        objective=9.0, notes=[Note(SNAP, "snaps", "warp")],
        project=SimpleNamespace(
            title="made", fabric=SimpleNamespace(lab="", thickness=0.5)
        ),
        setup=SimpleNamespace(tests=[], objective_is="error"),
        best=SimpleNamespace(ranked=[SimpleNamespace(objective=9.0)]),
    )  # fmt: skip
    errors = tuple(
        FoldError(k, value, {} if value is None else {"warp": value / 2, "fill": value / 4})
        for k, value in enumerate(folds)
    )
    own = Form(name, fit, errors, ("warp", "fill"))
    object.__setattr__(own, "coefficients", coefficients)
    return own


def test_the_simplest_form_that_is_as_good(monkeypatch):
    every = {"warp": 0.5, "fill": 0.25, "b": 7.0}
    monkeypatch.setattr(study, "noise_of", lambda problem: every)
    forms = (
        form("cubic", 12, 99.0, 101.0), form("linear", 6, 104.0, 105.8),
        form("constant", 3, 105.0, 105.2), form("quadratic", 9, 1.0, None),
    )  # fmt: skip
    result = LawComparison(forms, 2).result
    assert (result["least_cross_validated"], result["simplest_as_good"]) == ("cubic", "linear")
    assert (result["noise"], result["noise_by_part"]) == (0.75, {"warp": 0.5, "fill": 0.25})
    assert result["units"] == {"warp": "N", "fill": "N"}
    first, *_, last = result["forms"]
    assert first["cross_validated"] == 100.0 and first["folds"] == [99.0, 101.0]
    assert first["cross_validated_by_part"] == {"warp": 50.0, "fill": 25.0}
    assert last["cross_validated"] is None and last["folds"] == [1.0, None]
    assert last["cross_validated_by_part"] == {"warp": None, "fill": None}
    table = LawComparison(forms, 2).table()
    assert table["cross_validated"].tolist()[:3] == pytest.approx([100.0, 104.9, 105.1])
    assert math.isnan(table["cross_validated"][3]) and np.isnan(table["left out warp, N"][3])
    assert table["left out fill, N"].tolist()[:2] == pytest.approx([25.0, 26.225])
    assert table["rms fill, N"].tolist() == [4.0] * 4
    lines = LawComparison(forms[2:], 2).lines()
    for line, words in zip(lines[2:5], ("105.1", "failed", "0.75"), strict=True):
        assert words in line
    assert len(lines) == 6 and "constant" in lines[5]
    lost = LawComparison(forms[3:], 2)
    assert lost.result["least_cross_validated"] is lost.result["simplest_as_good"] is None
    assert lost.conclusion == []
    forms = form("constant", 3, 1.0, 2.0), form("cubic", 12, None, 1.0, None)
    said = [(note.kind, note.line) for note in LawComparison(forms, 2).notes]
    assert said == [
        (SNAP, "constant, warp: snaps"), (SNAP, "cubic, warp: snaps"),
        (FOLD, f"cubic, fold 1: {LOST}"), (FOLD, f"cubic, fold 3: {LOST}"),
    ]  # fmt: skip


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
    monkeypatch.setattr(vega, "_drawn", lambda kind, spec: NOTHING)  # drawing takes long
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
        with pytest.raises(OutputError, match="already holds"):
            study(project, **given, out=out, progress=False)


def test_verification_is_that_of_its_command(tmp_path):
    heard = []
    found = bf.verify(["bars"], progress=lambda *event: heard.append(event))
    done = in_process("verify", "--subject", "bars", "--json", cwd=tmp_path)
    assert found.result == json.loads(done.stdout) and found.result["ok"] and not found.missed
    assert list(found.table()["ours"]) == [one.ours for one in found.subjects["bars"]]
    assert heard == [(0, 1, "bars"), (1, 1, "")]


def test_comparisons_and_validations_trust_as_fits_do(folder):
    project = bf.read_project(folder / "project.toml")
    for run, given in ((bf.compare, {}), (bf.validate, {}), (bf.weights, {"counted": "two"})):
        with pytest.raises(InputError, match="there is no doubt 'nonsense'"):
            run(project, **given, trust=["nonsense"], progress=False)
        with pytest.raises(InputError, match="starts: expected"):
            study(project, **given, starts="two")


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
        monkeypatch.setattr(module, "EVERY_S", 0.0)
        monkeypatch.setattr(module, "PLAIN_EVERY_S", 0.0)
        return one

    return install


START = StartRecord(0, (1, 0), 0.5, "converged", 3, (), (), 0.1)
EVENTS = [
    ((2, 5, "E1 at 0.1"), "2 of 5 E1 at 0.1"), ((3, 5, ""), "3 of 5 E1 at 0.1"),
    (("all tests",), "3 of 5 all tests"), ((Stage("starts", 2),), "0 of 2 starts"),
    ((EvaluationRecord(0, 1, 0.5, "", (), ()),), "0 of 2 starts"), ((START,), "1 of 2 starts"),
    ((None,), "1 of 2 starts"), ((Step("bar", 2, 3, 0.5, 4),), "1 of 3 bar"),
    ((RunEvent(None, 4, 4),), "4 of 4 bar"),
]  # fmt: skip


def test_a_bar_follows_every_study(shell):
    seen, bar = shell(True).seen, listener(None)
    assert isinstance(bar, Bar)
    for event, words in EVENTS:
        bar(*event)
        first, shown = seen[-1]
        assert shown["text/plain"].split(", ")[0] == words
        assert (
            f"max={bar.total}>" in shown["text/html"] and f"value={bar.done} " in shown["text/html"]
        )
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
    assert capsys.readouterr().err.startswith("1 of 2 x")
