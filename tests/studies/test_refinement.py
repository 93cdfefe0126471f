"""Studies of models: finer meshes, their parts and cards; what is compared, fails, is written."""

import contextlib
import functools
import json
import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, refined_quads, straight_strip, strip_mesh
from bubblefit.notes import Note
from bubblefit.reports import study_pages
from bubblefit.runs import refinement
from bubblefit.runs import simulation as module
from bubblefit.runs.convergence import convergence, observed_order, richardson
from bubblefit.runs.refinement import Level, refine
from bubblefit.runs.simulation import card_of, parts_of, studied_tests
from bubblefit.solvers import run_cache
from bubblefit.solvers.base import SNAP
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ..builders.bars import STRETCH, WIDTH, BarKind, BarTest, project_of
from ..builders.projects import CONSTANT_BUBBLE
from ..support.charts import check_convergence
from ..support.commands import in_process, result_in
from ..support.refusals import complaint, raised

CARD = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
EXACT = 600.0 * np.log1p(STRETCH) * np.exp(-0.24 * np.log1p(STRETCH)) * 0.5 * WIDTH
END = "load at the end, N"


def test_edge_length():
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
    assert refinement.rms_between((x, 2 * x), (x[:2], 2 * x[:2])) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("strip", "make"),
    [("straight", lambda **q: straight_strip("warp", 20.0, 22.0, 0.8, **q)),
     ("bias", lambda **q: bias_strip(20.0, 24.0, 0.8, **q))],
)  # fmt: skip
def test_strips_and_their_refinements(strip, make):
    plain = len(make().mesh.quads)
    for factor in (1 / 16, 1 / 4, 1 / 2, 1.0, 2.0, 3.0):
        count = len(make(**refined_quads(strip, factor)).mesh.quads)
        assert count == factor**2 * plain or (count and factor not in (1, 2))


def test_order_and_limit_of_a_known_error(bars):
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
    study = refine(project_of(BarTest("a bar")), CARD, what="increments", levels=3)
    levels = [(r.part.increments, r.size) for r in study.runs["a bar"]]
    assert levels == [(4, 1 / 4), (8, 1 / 8), (16, 1 / 16)]
    remark = study.result["models"]["a bar"]["quantities"][END]["remark"]
    assert "accuracy of the solver" in remark  # the closed form knows no increments


def test_a_level_that_fails_is_named_and_left_out(bars, tmp_path, drawn):
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


def test_nothing_to_compare_is_a_failure_and_a_defect_is_none(bars, monkeypatch):
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
def test_levels_that_cannot_be_had(bars, options, words):
    raised(InputError, words, refine, project_of(BarTest("a bar")), **{"card": CARD, **options})
    assert not bars.seen


def test_the_cards_thickness_counts_and_is_said(bars):
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


def test_numbers():
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
    said = told([RUNS[0], RUNS[3]])
    assert said["quantities"] == {} and "rms_N" not in said and len(said["levels"]) == 2
    assert "rms_N" not in told([replace(r, curve=None) for r in RUNS[:2]])


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    order=st.floats(0.3, 6.0), limit=st.floats(-50.0, 50.0),
    constant=st.sampled_from([-3.0, -0.2, 0.2, 3.0]), first=st.floats(1.3, 3.0),
    second=st.floats(1.3, 3.0),
)  # fmt: skip
def test_order_and_limit_of_pure_powers(order, limit, constant, first, second):
    sizes = np.array([1.0, 1 / first, 1 / (first * second)])
    values = limit + constant * sizes**order
    found = richardson(sizes[1:], values[1:], order)
    assert found == pytest.approx(limit, abs=1e-8)
    for unit in (1.0, 1e-6, 1e6):
        assert observed_order(unit * sizes, np.diff(values)) == pytest.approx(order, rel=1e-4)


def test_changes_without_an_order():
    every = [(1.0, -0.25), (-1.0, 0.25), (1.0, 1.0), (1.0, 1.2), (1.0, 0.0), (0.0, 1.0)]
    for changes in (*every, (1.0, np.nan), (1.0, 2.0**-12.5)):
        assert observed_order([4.0, 2.0, 1.0], changes) is None, changes


def test_a_second_term_makes_the_order_move_and_is_said():
    h = np.array([8.0, 4.0, 2.0, 1.0])
    found = convergence(h, 40.0 + 0.01 * h**2 + 0.02 * h**4)
    assert found.previous > found.order > 2.5
    moving = convergence(h, 40.0 + 0.3 * h + 0.02 * h**4)
    assert "still moves" in moving.remark
    fine = 0.01 * h
    settled = convergence(fine, 40.0 + 0.01 * fine**2 + 0.02 * fine**4)
    assert settled.order == pytest.approx(2.0, abs=0.01) and settled.remark == ""


def test_noise_is_a_share_of_the_largest_value():
    """Of 40 here, at the coarsest level: 0.5 are changed by the last step; in any unit."""
    for noise, unit in product((0.0125, 0.0124), (1.0, 1e-3)):
        values = unit * np.array([-40.0, 1.0, 1.5])
        found = convergence([4.0, 2.0, 1.0], values, noise * (1 + 1e-9))
        assert ("accuracy of the solver" in found.remark) == (noise == 0.0125)


@pytest.mark.parametrize(
    "values, noise, words",
    [
        ([1.0, 0.5], 1e-8, "three levels"), ([1.0], 1e-8, "three levels"),
        ([1.0, 1.0], 1e-8, "accuracy of the solver"), ([1.0, 0.5, 0.375], 1e-8, "one order only"),
        ([9.0, 1.0, 0.5, 0.75], 1e-8, "up and down"),
        ([9.0, 1.0, 0.5, 0.0], 1e-8, "do not get smaller"),
        ([9.0, 1.0, 0.5, 0.5 + 1e-9], 1e-8, "accuracy of the solver"),
        ([1.0, 1.5, 1.25, 1.125], 1e-8, "one order only"),
        ([3.0, 2.0, 1.0, 1.0 - 1e-6], 1e-8, "no power"),
        ([0.0, 1.0, 1.9], 1e-8, "no limit: refine further"),
        ([1.0, 2.0, 2.0], 0.0, "accuracy of the solver"),
        ([0.0, 2**0.51, 2**0.51 + 1.0], 0.0, "one order only"),
    ],
)  # fmt: skip
def test_limits_of_the_extrapolation_are_said(values, noise, words):
    found = convergence([2.0**-k for k in range(len(values))], values, noise)
    assert words in found.remark
    assert (found.limit is None) == (found.order is None)


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
    assert studied_tests(project) == [one, two]
    with pytest.raises(InputError, match="names no test"):
        studied_tests(project, [])
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
    test = BarTest("one")
    said = complaint(parts_of, project_of(test), [test], 0.5, "elements", 0.05)
    assert said.startswith("bars.toml: refinement by 0.05") and said.endswith("got 0")

    class Filed(BarTest):
        def models(self, *_, **__):
            raise InputError("mesh.inp", "line 3", "odd")

    assert complaint(parts_of, project_of(test), [Filed("x")], 0.5) == "mesh.inp: line 3: odd"


def test_analyses_are_told_one_after_the_other(bars):
    steps, test = [], BarTest("one", ("warp", "fill"))
    series = module.Analyses(project_of(test), steps.append)
    assert series.total == 0 and series.solver is bars
    series.total = 2
    for part in parts_of(project_of(test), [test], 0.5).values():
        series.run(part.name, part.model, CARD.law, part.increments)
    assert [(s.part, s.analysis, s.analyses, s.done, s.increments) for s in steps] == [
        ("warp", 1, 2, 0.0, 4), ("warp", 1, 2, 4.0, 4),
        ("fill", 2, 2, 0.0, 4), ("fill", 2, 2, 4.0, 4),
    ]  # fmt: skip


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
