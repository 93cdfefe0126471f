"""Forms side by side: every number of result.json, table and page, and going on with it."""

import json
import math
from dataclasses import asdict
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.notes import Note
from bubblefit.reports import study_pages
from bubblefit.runs import compare as study
from bubblefit.runs.compare import FOLD, NOT_JUDGED, FoldError, FormFit, LawComparison, compare
from bubblefit.runs.simulation import StudyRecord
from bubblefit.solvers.base import SNAP

from ..builders.projects import constant_strips
from ..support.refusals import raised


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
    assert told[0] == "constant moduli" and told[3] == "linear moduli" and len(told) == 6
    return done


def test_going_on_validates_nothing_twice(compared, run):
    before = [form.folds for form in compared.forms]
    raised(OutputError, "--resume", run.compare)
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
        if event == "constant moduli":
            raise KeyboardInterrupt

    raised(KeyboardInterrupt, "", run.compare, progress=stop, overwrite=True)
    again = run.compare(resume=True)
    assert [form.fit.project.fit.seed for form in again.forms] == [8, 8]


def test_rows_of_another_fit_are_not_taken(tmp_path):
    def rows(of, folder=tmp_path):
        return StudyRecord(folder, "rows.json", "folds", FoldError, "fold", {"of": of}).rows

    path = tmp_path / "rows.json"
    row = FoldError(1, 0.5, {})
    StudyRecord(tmp_path, path.name, "folds", FoldError, "fold", {"of": "this"}).write(row)
    mark = json.loads(path.read_text())["of"]
    for folds, wanted in (([], {}), ([asdict(row)], {1: row}), ([{"colour": 1}], {})):
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
    assert "constant" in lines[5]
    lost = LawComparison(forms[3:], 2)
    assert lost.result["least_cross_validated"] is lost.result["simplest_as_good"] is None
    assert not any("simplest within" in line for line in lost.lines())
    forms = form("constant", 3, 1.0, 2.0), form("cubic", 12, None, 1.0, None)
    said = [(note.kind, note.line) for note in LawComparison(forms, 2).notes]
    assert said == [
        (SNAP, "constant, warp: snaps"), (SNAP, "cubic, warp: snaps"),
        (FOLD, f"cubic, fold 1: {NOT_JUDGED}"), (FOLD, f"cubic, fold 3: {NOT_JUDGED}"),
    ]  # fmt: skip
