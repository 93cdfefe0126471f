"""Studies of meshes, increments and Poisson's ratio: known errors, failures, cards."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, refined_quads, straight_strip, strip_mesh
from bubblefit.notes import Note
from bubblefit.reports import study_pages
from bubblefit.runs import refinement
from bubblefit.runs import simulation as module
from bubblefit.runs.refinement import Level, ratios, refine, vary_nu12
from bubblefit.runs.simulation import card_of, parts_of
from bubblefit.solvers.base import SNAP
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.bars import STRETCH, WIDTH, BarTest, project_of
from ..support.charts import charts_of, check_convergence, data
from ..support.refusals import complaint, raised

VARIED = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")


NAN = np.nan


def test_ratios_leave_out_failed_runs():
    found = ratios([0.1, 0.2, 0.3], [2.0, NAN, 4.0], 2.5)
    assert found.to_base == pytest.approx([0.8, NAN, 1.6], nan_ok=True)
    assert found.to_mean == pytest.approx([2 / 3, NAN, 4 / 3], nan_ok=True)
    assert found.spread == pytest.approx((-0.2, 0.6))
    assert np.isnan(ratios([0.1], [NAN], 1.0).spread).all()
    # Constant thickness: the width follows nu12, so the load falls with exp(-nu12 eps).
    model = straight_strip("warp", 20.0, 22.0, 0.8, increments=20)

    def load(nu12):
        law = HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=nu12)
        return float(MembraneSolver().run(model, law).load[-1])

    found = ratios([0.0, 0.4], [load(0.0), load(0.4)], load(0.24))
    expected = np.exp(-(found.nu12 - 0.24) * np.log(1.1))
    assert found.to_base == pytest.approx(expected, rel=1e-6)


def test_effect_of_nu12_on_bar_is_closed_form(bars, tmp_path, drawn):
    study = vary_nu12(project_of(BarTest("a bar")), VARIED, [0.4, 0.0, 0.999, 0.4])
    found = study.parts["a bar"].responses[END]
    assert found.nu12.tolist() == [0.0, 0.4, 0.999] and study.base == 0.24
    expected = np.exp(-(found.nu12 - 0.24) * np.log1p(STRETCH))
    assert found.to_base == pytest.approx(expected, rel=1e-9)
    study.write(tmp_path)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "nu12.csv"), study.table())
    text = json.dumps(study.result, indent=1) + "\n"
    assert (tmp_path / "result.json").read_text() == text and (tmp_path / "nu12.png").exists()
    for chart in (drawn[0].charts[0], charts_of(tmp_path)["nu12"][0]):
        shown, base = data(chart)
        np.testing.assert_allclose(shown, [found.nu12, found.to_base], rtol=1e-5)
        assert base.ravel().tolist() == [0.24, 1.0] and chart.series[0].name == END
    assert any(line.startswith(f"a bar, {END}") for line in study.lines())


def test_failed_value_of_nu12_is_named(bars):
    bars.law_fails = lambda law: law.nu12 > 0.4
    project = project_of(BarTest("a bar"))
    study = vary_nu12(project, VARIED, [0.2, 0.45])
    assert study.result["models"]["a bar"]["responses"][END]["to_base"][-1] is None
    raised(SolverFailure, "", vary_nu12, project, VARIED, [0.45])
    with pytest.raises(SolverFailure):  # the card as it is
        vary_nu12(project, replace(VARIED, law=replace(VARIED.law, nu12=0.41)))


CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")


EXACT = 600.0 * np.log1p(STRETCH) * np.exp(-0.24 * np.log1p(STRETCH)) * 0.5 * WIDTH


END = "load at the end, N"


@pytest.mark.filterwarnings("error")
def test_edge_length_is_root_of_area_per_quad():
    assert refinement.edge_length(strip_mesh(20.0, 40.0, 4, 8)) == pytest.approx(5.0)
    disk = disk_mesh(100.0, 800, "quarter")
    area = refinement.edge_length(disk) ** 2 * len(disk.quads)
    assert area == pytest.approx(0.25e4 * np.pi, rel=2e-3)
    coarse = np.array([1.0, 2.0]), np.array([2.0, 4.0])
    fine = np.array([0.5, 1.0, 1.5, 2.0]), np.array([9.0, 2.5, 9.0, 4.5])
    assert refinement.rms_between(coarse, fine) == pytest.approx(0.5)
    assert refinement.rms_between((np.array([0.5]), np.array([1.0])), coarse) == pytest.approx(
        0.0, abs=1e-15
    )
    x = np.array([1.0, 2.0, 3.0])
    assert np.isnan(refinement.rms_between((x, x), (x / 8, x)))
    assert refinement.rms_between((x, 2 * x), (x[:2], 2 * x[:2])) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("strip", "make"),
    [("straight", lambda **q: straight_strip("warp", 20.0, 22.0, 0.8, **q)),
     ("bias", lambda **q: bias_strip(20.0, 24.0, 0.8, **q))],
)  # fmt: skip
def test_strips_are_refined_by_quads(strip, make):
    plain = len(make().mesh.quads)
    for factor in (1 / 16, 1 / 4, 1 / 2, 1.0, 2.0, 3.0):
        count = len(make(**refined_quads(strip, factor)).mesh.quads)
        assert count == factor**2 * plain or (count and factor not in (1, 2))


def test_order_and_limit_of_known_error_are_found(bars):
    steps = []
    study = refine(project_of(BarTest("a bar")), CARD, progress=steps.append)
    (name,) = study.runs
    quantity = study.result["models"][name]["quantities"][END]
    assert name == "a bar" and quantity["order"] == pytest.approx(2.0, abs=1e-6)
    assert quantity["limit"] == pytest.approx(EXACT, rel=1e-9)
    assert quantity["own_error"] == pytest.approx(0.01 / 4**2, rel=1e-6)
    levels = [(run.elements, run.factor) for run in study.runs[name]]
    assert levels == [(8, 0.5), (32, 1.0), (128, 2.0), (512, 4.0)]
    assert all(0.0 <= run.seconds < 60.0 for run in study.runs[name])
    assert (steps[0].part, steps[0].analysis, steps[0].analyses) == ("a bar", 1, 4)
    assert steps[-1].done == steps[-1].increments == 4 and bars.progress is None
    assert (study.result["solver"], study.result["card"]) == ("bars", "soft")
    assert study.warnings == ()
    # Without a finer level nothing tells the error of the project.
    study = refine(project_of(BarTest("a bar")), CARD, levels=2)
    quantity = study.result["models"]["a bar"]["quantities"][END]
    assert quantity["own_error"] is None and study.errors == {}
    study = refine(project_of(BarTest("a bar")), CARD, what="increments", levels=3)
    levels = [(r.part.increments, r.size) for r in study.runs["a bar"]]
    assert levels == [(4, 1 / 4), (8, 1 / 8), (16, 1 / 16)]
    remark = study.result["models"]["a bar"]["quantities"][END]["remark"]
    assert "accuracy of the solver" in remark  # the closed form knows no increments


def test_failed_level_is_named_and_left_out(bars, tmp_path, drawn):
    bars.fails = 16
    study = refine(project_of(BarTest("a bar")), CARD)
    *_, last = study.runs["a bar"]
    assert last.values is None and last.failure == "the bar breaks"
    assert len(study.result["models"]["a bar"]["rms_N"]["to_next_finer"]) == 2
    assert any("failed: the bar breaks" in line for line in study.lines())
    study.write(tmp_path)
    table = pd.read_csv(tmp_path / "convergence.csv")
    pd.testing.assert_frame_equal(table, study.table(), check_dtype=False)
    assert table.quantity.str.startswith("failed: ").sum() == 1
    assert json.loads((tmp_path / "result.json").read_text()) == study.result
    assert (tmp_path / "convergence.png").exists()
    assert table[table.quantity == END].off_finest.iloc[-1] == 0
    ended = table[~table.quantity.str.startswith("failed: ")]
    check_convergence(drawn[0], ended, "elements", study.result["models"]["a bar"]["rms_N"])


def test_nothing_to_compare_is_a_failure_but_a_defect_is_raised(bars, monkeypatch):
    bars.fails = 2
    raised(SolverFailure, "the bar breaks", refine, project_of(BarTest("a bar")), CARD)
    monkeypatch.setattr(bars, "run", lambda *_: 1 / 0)
    raised(ZeroDivisionError, "", refine, project_of(BarTest("a bar")), CARD)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"levels": 3, "coarser": 3}, "--coarser: .* got 3"),
     ({"levels": 4, "coarser": 3}, r"bars.toml: refinement by 0.125 .*elements: expected 1"),
     ({"what": "increments", "levels": 2, "factor": 1}, "factor: expected int of 2 or more, got 1"),
     ({"card": "thin"}, "no card")],
)  # fmt: skip
def test_impossible_levels_are_refused(bars, options, words):
    raised(InputError, words, refine, project_of(BarTest("a bar")), **{"card": CARD, **options})
    assert not bars.seen


def test_thickness_of_card_is_used_and_noted(bars):
    thick = MaterialCard(CARD.law, 1.0, "thick")
    study = refine(project_of(BarTest("a bar"), cards={"thick": thick}), "thick", levels=2)
    assert {model.thickness for model in bars.seen} == {1.0}
    (note,) = study.result["notes"]
    words = note["note"]
    assert "1 mm" in words and "0.5 mm" in words and f"note: {words}" in study.lines()


X = np.array([1.0, 2.0])


LOAD, LATE = "load, N", "load at 2 mm, N"


def level(factor, quads):
    """Of edge 8 mm where the factor is a half, as the fourth root of quads would have it."""
    model = SimpleNamespace(mesh=SimpleNamespace(quads=range(quads)))
    return Level(SimpleNamespace(model=model, increments=10), factor, 4.0 / factor)


def run(factor, quads, load, late, rise):
    values = {LOAD: load} | ({} if late is None else {LATE: late})
    curve = X, rise * X
    own = level(factor, quads)
    return replace(own, seconds=quads / 100, iterations=7, values=values, curve=curve)


#: 10 + 1, + 1/2, + 1/4 N at halved edges; the curves differ by 0.2 and 0.1 times (1, 2) N.
RUNS = [
    run(0.5, 25, 11.0, None, 5.3), run(1.0, 100, 10.5, 21.0, 5.1), run(2.0, 400, 10.25, 20.5, 5.0),
    replace(level(4.0, 1600), seconds=3.0, failure="no equilibrium"),
]  # fmt: skip


ROOT = np.sqrt((1 + 4) / 2)


def study(runs, noise=1e-7, what="elements"):
    notes = (Note(SNAP, "made up"),)
    return refinement.Refinement(project_of(), "soft", "bars", what, {"bar": runs}, noise, notes)


def told(runs, noise=1e-7):
    return study(runs, noise).result["models"]["bar"]


@pytest.mark.parametrize(
    ("error", "light", "step"),
    [
        (0.009, "usable", ""),
        (0.011, "usable within limits", "compute with more elements"),
        (-0.011, "usable within limits", "compute with more elements"),
    ],
)
def test_finer_mesh_is_advised_from_an_error_of_one_percent(error, light, step):
    """Loads 10 (1 + 2 e), 10 (1 + e), 10 (1 + e / 2) at halved edges have the limit 10."""
    sizes = ((0.5, 25, 2.0), (1.0, 100, 1.0), (2.0, 400, 0.5))
    runs = [run(f, quads, 10.0 * (1 + share * error), None, 5.0) for f, quads, share in sizes]
    verdict = study(runs).verdict
    assert (verdict.state, verdict.next_step) == (light, step)
    assert f"leave errors of {100 * abs(error):.2g} % at most (bar: {LOAD})" in str(verdict.numbers)


def test_changes_too_small_to_draw_are_words():
    steady = [run(f, 100 * f, 10.0, None, 5.0) for f in (1, 2, 4)]
    steady = [replace(level, curve=RUNS[0].curve) for level in steady]
    charts = study_pages.convergence_charts(study(steady), "Mesh")
    assert [chart.title for chart in charts.charts] == ["cost"]
    assert "bar: every change is below 1e-05 %; changes below" in charts.caption
    drawn = study_pages.convergence_charts(study(RUNS), "Mesh")
    assert [chart.title for chart in drawn.charts] == ["bar", "cost"]
    assert "every" not in drawn.caption


def test_numbers_of_study_are_those_of_runs():
    model = told(RUNS)
    assert model["levels"][0] == {
        "factor": 0.5, "elements": 25, "increments": 10, "size": 8.0, "seconds": 0.25,
        "iterations": 7, "values": {LOAD: 11.0},
    }  # fmt: skip
    assert (model["levels"][3]["values"], model["levels"][3]["failed"]) == (None, "no equilibrium")
    text = "\n".join(study(RUNS).lines())
    for words in ("order 1.00", "limit 10", "failed: no equilibrium", "the project's own"):
        assert words in text
    found = model["quantities"]
    assert found[LOAD] == {
        "finest": 10.25, "order": pytest.approx(1.0), "limit": pytest.approx(10.0),
        "order_one_coarser": None, "own_error": pytest.approx(0.05),
        "own_error_against": "limit", "remark": found[LOAD]["remark"],
    }  # fmt: skip
    assert found[LATE] == {
        "finest": 20.5, "order": None, "limit": None, "order_one_coarser": None,
        "own_error": pytest.approx(21.0 / 20.5 - 1), "own_error_against": "finest",
        "remark": "an order needs three levels",
    }  # fmt: skip
    assert model["rms_N"] == {
        "to_next_finer": pytest.approx([0.2 * ROOT, 0.1 * ROOT]), "largest_load": 10.0,
        "order": pytest.approx(1.0),
    }  # fmt: skip
    # The last change, 0.158 N of 10, is the noise; and two levels have but one change.
    for runs, noise in ((RUNS, 0.0159), (RUNS[1:], 1e-7)):
        assert told(runs, noise)["rms_N"]["order"] is None
    closer, farther = ([run(0.25, 6, 12.0, None, rise), *RUNS[:3]] for rise in (5.3001, 9.3))
    assert told(closer)["rms_N"]["to_next_finer"][0] < 2e-4
    for runs, noise in ((RUNS, 0.0157), (closer, 1e-7), (closer, 1e-3), (farther, 1e-7)):
        assert told(runs, noise)["rms_N"]["order"] == pytest.approx(1.0)
    stopped = replace(RUNS[2], curve=(X / 4, X))
    rms = told([*RUNS[:2], stopped])["rms_N"]
    assert rms["order"] is None and rms["to_next_finer"][1] is None
    text = "\n".join(study([*RUNS[:2], stopped]).lines())
    assert f"to the next finer level: {0.2 * ROOT:.3g}, none N" in text
    said = told([RUNS[0], RUNS[3]])
    assert said["quantities"] == {} and "rms_N" not in said and len(said["levels"]) == 2
    assert "rms_N" not in told([replace(r, curve=None) for r in RUNS[:2]])


def test_card_of_study_is_that_of_argument_or_project(bars, tmp_path):
    write_card(MaterialCard(CARD.law, 0.6, "filed"), tmp_path / "c.toml")
    project = project_of(BarTest("one"), cards={"own": CARD})
    assert card_of(project, CARD) is CARD and card_of(project, "own") is CARD
    assert card_of(project, tmp_path / "c.toml").name == "filed"
    assert tuple(map(module.card_words, (CARD, "own", Path("c")))) == ("soft", "own", "c")
    test = BarTest("one")
    said = complaint(parts_of, project_of(test), [test], 0.5, "elements", 0.05)
    assert said.startswith("bars.toml: refinement by 0.05") and said.endswith("got 0")

    class Filed(BarTest):
        def models(self, *_, **__):
            raise InputError("mesh.inp", "line 3", "odd")

    assert complaint(parts_of, project_of(test), [Filed("x")], 0.5) == "mesh.inp: line 3: odd"


def test_analyses_are_reported_one_after_another(bars):
    steps, test = [], BarTest("one", ("warp", "fill"))
    series = module.Analyses(project_of(test), steps.append, None, False)
    assert series.total == 0 and series.solver is bars
    series.total = 2
    for part in parts_of(project_of(test), [test], 0.5).values():
        series.run(part.name, part.model, CARD.law, part.increments)
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps] == [
        ("warp", 1, 2, 0.0, 4), ("warp", 1, 2, 4.0, 4),
        ("fill", 2, 2, 0.0, 4), ("fill", 2, 2, 4.0, 4),
    ]  # fmt: skip
