"""Tests with cards from Python: which cards, tables, notes, what is in the folder."""

import json
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments import registry as kinds_of_test
from bubblefit.experiments.base import BaseKind, BaseTest
from bubblefit.experiments.cylinder.predicted import CylinderPredicted
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import curve_reading
from bubblefit.notes import Note
from bubblefit.project import project as project_module
from bubblefit.project.project import read_project
from bubblefit.reports import run_pages
from bubblefit.reports.content import Exhibit, Words
from bubblefit.reports.html import percent
from bubblefit.reports.kinds import cylinder as cylinders
from bubblefit.runs import executor
from bubblefit.runs import predictions as predictions_module
from bubblefit.runs.folder import versions
from bubblefit.runs.predictions import Predictions, mark_of, measured_tests, predict
from bubblefit.solvers import registry
from bubblefit.solvers.base import SNAP, History
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.registry import solver_named

from ..builders.bent_cylinders import (
    FAILS,
    ClosedFormCylinder,
    write_cylinder_project,
    write_cylinder_readings,
)
from ..builders.stored_runs import law, model
from ..support.refusals import complaint

CARDS = ("soft", "stiff")


TESTS = ("150 mm, 90 kPa", "high")


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)


@pytest.fixture
def project(tmp_path):
    return read_project(write_cylinder_project(tmp_path))


def test_every_test_runs_with_every_card(project, tmp_path):
    events = []
    done = predict(project, jobs=1, progress=events.append)
    runs, curves = done.runs(), done.curves()
    keys = [(test, card) for test in TESTS for card in CARDS]
    assert list(zip(runs["test"], runs["card"], strict=True)) == keys
    assert list(runs.columns[-4:]) == ["ended", "marks", "notes", "seconds"]
    assert set(runs["ended"]) == {"finished"} and set(runs["notes"]) == {"made up"}
    assert 0 < runs["seconds"].sum() <= done.wall_s
    names = ["test", "card", "wall", "deflection_mm"]
    assert len(curves) == 4 * 25 and list(curves.columns[:4]) == names
    assert set(runs["wall"]) == {""} and done.result["walls"] == []
    stiff = curves[(curves["test"] == "high") & (curves["card"] == "stiff")]
    own = runs[(runs["test"] == "high") & (runs["card"] == "stiff")].iloc[0]
    at = np.interp(100.0, stiff["deflection_mm"], stiff["load_N"])
    assert own["load_at_100_mm_N"] == pytest.approx(at)
    told = [event for event in events if event is not None]
    assert [e.done for e in told] == [0, 1, 2, 3, 4] and {e.total for e in told} == {4}
    assert told[0].run is None and not any(e.from_folder for e in told)
    # Nothing was written, nothing was measured.
    assert [p.name for p in tmp_path.iterdir()] == ["project.toml"]
    assert done.worst is None and done.silent() == []


def test_tests_and_cards_are_chosen_by_name(project):
    done = predict(project, ["high"], ["stiff"], jobs=1)
    assert [(run.test.name, run.card) for run in done.predicted_runs] == [("high", "stiff")]
    mine = MaterialCard(HypoelasticLaw.linear(700.0, 150.0, 20.0), 0.81)
    done = predict(project, "cylinder", {"mine": mine}, jobs=1)
    assert [(run.test.name, run.card) for run in done.predicted_runs] == [
        (name, "mine") for name in TESTS
    ]
    assert "there is no test 'low'" in complaint(predict, project, ["low"])
    said = complaint(replace, mine, thickness=0.0)
    assert said == "thickness: must be above zero, got 0 mm"


@pytest.mark.parametrize(("asked", "said", "some"), [(3, 5, 3), (None, 5, 5), (None, None, 7)])
def test_predictions_of_two_processes_equal_those_of_one(project, monkeypatch, asked, said, some):
    told = []

    def pool_of_this_process(prepare, numbers, jobs, what):
        told.append((jobs, what))
        run = prepare()
        return SimpleNamespace(run=lambda: [run(number, lambda _: None) for number in numbers])

    monkeypatch.setattr(executor, "ProcessPool", pool_of_this_process)
    monkeypatch.setattr(executor, "cores", lambda: 7)
    predict(project.with_fit(jobs=said), ["high"], jobs=asked)
    assert told == [(some, "runs")]


def test_card_runs_with_its_thickness(project):
    law = HypoelasticLaw.linear(500.0, 150.0, 20.0)
    cards = {f"{t} mm": MaterialCard(law, t) for t in (0.81, 0.9)}
    done = predict(project, ["high"], cards, jobs=1)
    for run, thickness in zip(done.predicted_runs, (0.81, 0.9), strict=True):
        # The seam is three layers.
        assert set(np.unique(run.model.thickness)) == {thickness, 3 * thickness}
    thin, thick = done.curves()["load_N"].to_numpy().reshape(2, -1)[:, 1]
    assert thick > 1.05 * thin


@pytest.fixture
def seen(monkeypatch):
    monkeypatch.setattr(cylinders, "draw_figures", lambda *_: [("loads.png", "loads")])
    monkeypatch.setattr(cylinders, "write_beams", lambda *_: [("a.vtu", "a beam")])
    reports = []
    monkeypatch.setattr(
        run_pages, "write_report", lambda folder, r: reports.append(r) or folder / "report.html"
    )
    return reports


def predictions(folder, soft, measured):
    write_cylinder_readings(folder / "a.csv", noise=0.02)
    first = 'measured.files = ["a.csv"]' if measured else ""
    done = predict(read_project(write_cylinder_project(folder, first, soft)), jobs=1)
    # Two notes of one run, and seconds that can be told from others.
    each = [
        replace(run, record=replace(run.record, seconds=2.0 + i))
        for i, run in enumerate(done.predicted_runs)
    ]
    each[1] = replace(each[1], notes=("made up", Note(SNAP, "also")))
    return Predictions(done.project, tuple(each), 30.0, done.record)


def test_failures_errors_and_notes_are_listed_by_run(tmp_path, seen):
    done = predictions(tmp_path, FAILS, measured=True)
    done.report(tmp_path / "out")
    (found,) = seen
    (worst,) = [e for i in range(4) if (e := done.error(i)) is not None]
    assert done.worst == worst == done.error(1)
    assert done.failed() == [0, 2] and done.silent() == [0]
    assert done.ended(0) == "failed: made to fail" and np.isnan(done.runs()["rms_relative"][2])
    with pytest.raises(SolverFailure, match="no run ended well: made to fail"):
        predict(done.project, cards=["soft"], jobs=1)
    ((_, verdict),) = found.verdicts
    assert f"with errors of at most {percent(worst)}" in verdict.sentence
    assert "2 of 4 runs" in verdict.sentence
    assert verdict.state == "usable within limits" and verdict.reasons == done.verdict.reasons
    assert verdict.reasons == (f"1 run is marked {str(SNAP)!r}",)
    shown = dict(found.facts)
    assert (shown["tests"], shown["cards"], shown["seconds of all runs"]) == (2, 2, 14.0)
    assert (shown["wall time, s"], shown["length, mm"], shown["span, mm"]) == (30.0, 3000.0, 2000.0)
    assert len(found.warnings) == 2 and all("failed: made to" in line for line in found.warnings)
    sure, head, listed = [part for part in found.parts if isinstance(part, Words)][:3]
    assert len(sure.lines) == 1 and head.lines == ["Assumed, as the project does not say:"]
    assert len(listed.lines) == 5 and listed.bulleted
    titles = ["Stiffness, knee and limit point", "Runs", "Measured quantities",
              "Against measured loads", "Notes"]  # fmt: skip
    tables = [part for part in found.parts if part.part == "table"]
    assert [table.title for table in tables][:5] == titles
    assert [row[:3] for row in tables[4].rows] == [
        ["150 mm, 90 kPa", "stiff", "of the solver"], ["150 mm, 90 kPa", "stiff", "snap"],
        ["high", "stiff", "of the solver"],
    ]  # fmt: skip
    assert [name for name, _ in found.files] == [
        "runs.csv", "notes.csv", "result.json", "load_deflection.csv", "measured.csv", "a.vtu",
        "provenance.json", "as-run.toml",
    ]  # fmt: skip
    assert found.versions == versions()


class Strut(NamedTuple):
    """A bar that is pulled by so many mm per mm."""

    strain: float
    thickness: float


@dataclass(frozen=True)
class StrutTest(BaseTest):
    name: str
    kind: str = "strut"

    def models(self, thickness=1.0):
        return {"strut": Strut(0.01, thickness)}


class StrutOutcome:
    """Force of a strut, beside 5 N that were measured."""

    def __init__(self, runs):
        self.forces = [float(run.record.arrays["force"][0]) for run in runs]

    def ended(self, number):
        return "finished"

    def error(self, number):
        return abs(self.forces[number] / 5.0 - 1.0)

    def numbers(self, number):
        return {"force_N": self.forces[number]}

    columns = numbers

    def curve(self, number):
        return pd.DataFrame({"force_N": [self.forces[number]]})

    def test_numbers(self, test):
        return {"measured_N": 5.0}

    def lines(self):
        return [f"struts: {self.forces}"]


class StrutKind(BaseKind):
    name, title, fitted, studied = "strut", "a strut", False, None
    outcome = StrutOutcome
    predicted = report = property(lambda self: self)

    def show_outcome(self, outcome, out):
        out.path("struts.txt").parent.mkdir(parents=True, exist_ok=True)
        out.path("struts.txt").write_text("struts")
        return Exhibit([("struts", len(outcome.forces))], files=[(out.name("struts.txt"), "s")])

    def depends_on(self, model):
        return (model,)

    def arrays(self, model, history):
        return {"force": history.load}

    def measured(self, test):
        return True


class Both(ClosedFormCylinder):
    def run(self, model, law, *rest, **named):
        if not isinstance(model, Strut):
            return super().run(model, law, *rest, **named)
        force = law.beta[11] * model.strain * model.thickness
        strain = np.array([model.strain, 0.0, 0.0])
        return History(np.array([force]), np.zeros((1, 1, 3)), np.zeros(3), strain)


@pytest.fixture
def mixed(tmp_path, monkeypatch):
    kind, ours = StrutKind(), kinds_of_test.kind_named

    def kind_named(name):
        return kind if name == "strut" else ours(name)

    for module in (predictions_module, kinds_of_test, project_module):
        monkeypatch.setattr(module, "kind_named", kind_named)
    monkeypatch.setitem(registry.SOLVERS, "formula", Both)
    read = read_project(write_cylinder_project(tmp_path))
    known = {**kinds_of_test.kinds(), "strut": kind}
    monkeypatch.setattr(project_module, "kinds", lambda names=None: known)
    monkeypatch.setattr(project_module, "kind_names", lambda: (*known,))
    return replace(read, tests={"pulled": StrutTest("pulled"), **read.tests})


def test_two_kinds_of_test_run_in_one_series(mixed, tmp_path, monkeypatch):
    monkeypatch.setattr(cylinders, "write_beams", lambda *_: [])
    done = predict(mixed, jobs=1, out=tmp_path / "out")
    assert [run.test.name for run in done.predicted_runs][:2] == ["pulled"] * 2 and len(
        done.predicted_runs
    ) == 6
    forces = [0.01 * e1 * 0.81 for e1 in (500.0, 900.0)]
    runs = done.runs()
    np.testing.assert_allclose(runs["force_N"][:2], forces)
    assert runs["force_N"][2:].isna().all() and runs["stiffness_N_per_mm"][2:].notna().all()
    assert done.worst == pytest.approx(max(abs(f / 5 - 1) for f in forces))
    done.report(tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["tests"]["pulled"] == {"kind": "strut", "measured_N": 5.0}
    said = [run.get("force_N") for run in result["runs"]]
    assert said[:2] == pytest.approx(forces) and said[2:] == [None] * 4
    # Each kind has a folder of its own.
    assert (tmp_path / "out" / "strut" / "struts.txt").is_file()
    assert (tmp_path / "out" / "cylinder" / "figures" / "all-loads.png").is_file()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<td>strut/struts.txt</td>" in page
    assert '"labels":["deflection of the collar, mm","load, N"]' in page
    # One kind of two; then one that is neither fitted nor predicted.
    assert [t.name for t in measured_tests(mixed)] == ["pulled"]
    events = []
    done = predict(mixed, "strut", jobs=1, out=tmp_path / "out", resume=True,
                   progress=events.append)  # fmt: skip
    assert all(event.from_folder for event in events if event is not None and event.run is not None)
    assert {run.test.kind for run in done.predicted_runs} == {"strut"}
    assert done.lines() == [f"struts: {forces}", *done.verdict.lines]
    monkeypatch.setattr(StrutKind, "predicted", None)
    assert "no card is judged on these tests: pulled" in complaint(predict, mixed, "pulled")
    assert len(predict(mixed, jobs=1).predicted_runs) == 4


KIND = CylinderPredicted()


def test_mark_of_run_depends_on_model_law_and_card():
    m = model()

    class Other(ClosedFormCylinder):
        name = "calculix"

        def __init__(self):
            self.identity = "calculix 2.21"

    usual, formula = law(), ClosedFormCylinder()

    def mark(m=m, law=usual, solver=formula):
        return mark_of(KIND, m, law, solver)

    others = {
        mark(law=law(501.0)), mark(law=replace(usual, nu12=0.3)),
        mark(law=replace(usual, thickness_change="incompressible")),
        mark(m=replace(m, thickness=2 * m.thickness)),
        mark(m=replace(m, deflections=m.deflections[:-1], increments=())),
        mark(m=replace(m, inflation=(0.1, 0.14))),
        mark(m=replace(m, collar=replace(m.collar, fillet=3.0))),
        mark(m=replace(m, gas=replace(m.gas, ambient=0.09))), mark(m=model("full")),
        mark(solver=Other()), mark(solver=ClosedFormCylinder(accuracy=2)),
    }  # fmt: skip
    assert mark() not in others and len(others) == 11
    # Where a curve is read changes no result, and the same model is the same made again.
    assert mark() == mark(m=replace(m, reading=curve_reading(150.0, [5.0]))) == mark(m=model())


def test_mark_of_run_depends_on_strain_range():
    cubic = HypoelasticLaw([0, 0, 1, 20, 0, 0, 1, 150, 0, 0, 1, 500], 0.24, [0.2, 0.2, 0.2])
    ends = [[0.2, 0.2, 0.2], [0.2, 0.2, 0.1], [0.1, 0.2, 0.2]]
    laws = [replace(cubic, strain_range=np.array(e)) for e in ends]
    assert len({mark_of(KIND, model(), law, ClosedFormCylinder()) for law in laws}) == 3


def test_mark_of_run_depends_on_options_of_solver(tmp_path):
    def mark(**options):
        return mark_of(KIND, model(), law(), solver_named("membrane", **options))

    assert mark() == mark()
    assert mark(wrinkle_stiffness=0.002) != mark()
    # What a cylinder is predicted with unless told otherwise has one mark, however it is asked for.
    assert mark(wall="tension field") == mark() != mark(wall="stiff")
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING")
    options = ({}, {"threads": 2}, {"templates": tmp_path})
    words = [CalculixSolver(ccx="ccx", **o).identity for o in options]
    assert words[0] == words[1] != words[2]
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING\nanother")
    assert CalculixSolver(ccx="ccx", templates=tmp_path).identity not in words
