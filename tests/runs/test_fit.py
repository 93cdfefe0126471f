"""A fit from Python: the same result as the command, tables, interruption, several tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit import __version__
from bubblefit.errors import InputError, OutputError, SolverFailure
from bubblefit.experiments.kinds import Around, Doubt, Judgement, Reach, laws_around
from bubblefit.inference.unknowns import Unknowns, allowed, draw
from bubblefit.materials.card import CardCertainty, MaterialCard, read_card
from bubblefit.materials.forms.base import form_names
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import Project, read_project
from bubblefit.reports.content import Exhibit, Report, Table, read_page_data
from bubblefit.reports.maps import Maps, Solid
from bubblefit.runs import best
from bubblefit.runs.best import best_fit, noise_of, with_certainty
from bubblefit.runs.fit import Check, fit
from bubblefit.runs.folder import PRESENTERS
from bubblefit.runs.predictions import Predictions, RunEvent, predict
from bubblefit.runs.result import notes_of_fit
from bubblefit.runs.setup import bounds_of, law_of, prepare_fit, shared_unknowns
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers import registry

from ..commands import in_process, result_in
from ..complaints import complaint, complaint_with
from ..cylinder_cases import STOPS, Banded, Formula, write_project
from ..drawings import data, lines
from ..projects import constant_strips, project_file, small, with_form

SECOND = """
[[bubble]]
name = "softer reading"
radius = 80.0
pressures = [40, 120]
elements = 48
symmetry = "quarter"
nuisance = { displacement_offset = true }
[bubble.data.known_solution]
beta = [
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1,  1.37830e1,  -9.31830e-1, 1.39437e-1,
    -4.79622e2,  2.12650e2,  -2.02028e1,  8.06350e-1,
]

[fit]"""


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    project = bf.read_project(small(tmp_path_factory.mktemp("fit")))
    return bf.fit(project, tests="bubble", starts=2, jobs=1)


def test_the_same_as_the_command(fitted, tmp_path):
    in_process("bubble", fitted.project.path, "--starts", 2, "--out", "out", cwd=tmp_path)
    theirs = result_in(tmp_path / "out")
    for key in ("objective", "beta", "strain_reached", "starts", "moduli_error", "warnings"):
        assert json.loads(json.dumps(fitted.result[key])) == theirs[key], key


def test_every_place_says_the_same_objective(fitted, tmp_path):
    page = fitted.report(tmp_path).read_text()
    said = result_in(tmp_path)
    assert said["objective"] == fitted.objective == fitted.best.point.value
    first = min(said["starts"], key=lambda s: s["objective"])
    assert first["objective"] == fitted.objective
    assert f"objective {fitted.objective:.4g}" in fitted.card.source
    assert f"{fitted.objective:.3g}" in page
    assert fitted.starts()["objective"].min() == fitted.objective


def test_tables(fitted, tmp_path):
    moduli = fitted.moduli()
    sigma = ["sigma_relative", "noise_relative", "mesh_relative"]
    band = ["lower_MPa", "upper_MPa"]
    assert list(moduli.columns) == ["modulus", "strain", "MPa", *band, *sigma]
    sure = fitted.best.certainty
    for name, ends in sure.band.items():
        own = moduli[moduli["modulus"] == name]
        for column, end in zip(band, ends, strict=True):
            expected = np.interp(own["strain"], sure.strain[name], end)
            assert own[column].to_numpy() == pytest.approx(expected)
    e1 = moduli[moduli["modulus"] == "E1"]
    assert e1["strain"].max() == pytest.approx(fitted.best.valid[0])
    assert e1["MPa"].to_numpy() == pytest.approx(fitted.law.E1(e1["strain"]))
    residuals = fitted.residuals()
    assert set(residuals["quantity"]) == {"dx", "dy", "dz"}
    off = residuals["modelled"] - residuals["measured"]
    assert residuals["difference"].to_numpy() == pytest.approx(off.to_numpy())
    assert residuals["difference"].abs().max() < 1e-4
    fitted.report(tmp_path)
    assert len(pd.read_csv(tmp_path / "residuals.csv")) == len(residuals)
    assert len(pd.read_csv(tmp_path / "moduli.csv")) == len(moduli)
    card = bf.read_card(tmp_path / "material.toml")
    assert card.law.beta == pytest.approx(fitted.law.beta)
    assert card.law.strain_range == pytest.approx(fitted.best.valid)
    assert result_in(tmp_path)["valid_strain"]["warp"] == pytest.approx(card.law.strain_range[0])


def test_figures_show_what_the_tables_hold(fitted, tmp_path, drawn):
    fitted.report(tmp_path)
    by_panel = {c.y_label: c for charts in drawn[::-1] for c in charts.charts[::-1]}
    residuals = fitted.residuals()
    heights = residuals[residuals["quantity"] == "dz"]
    shown = np.concatenate(data(by_panel["modelled z, mm"])[1:], axis=1)
    assert shown == pytest.approx(heights[["measured", "modelled"]].to_numpy().T, rel=1e-5)
    off = np.concatenate(data(by_panel["modelled − known solution, mm"]), axis=1)
    assert off[1] == pytest.approx(heights["difference"].to_numpy(), abs=1e-12)
    moduli = fitted.moduli()
    e1 = moduli[moduli["modulus"] == "E1"]
    (best,) = lines(by_panel["tangent modulus, MPa"], "best")
    assert best[1] == pytest.approx(fitted.law.E1(best[0]), rel=1e-4)
    assert (best[0].min(), best[0].max()) == pytest.approx((0.0, e1["strain"].max()), rel=1e-5)
    (optima,) = data(next(charts for charts in drawn if charts.name == "optima").charts[0])
    assert optima[1] == pytest.approx(sorted(fitted.starts()["objective"], reverse=True), rel=1e-5)


def test_the_listed_uncertainty_is_one_standard_deviation(fitted):
    sure, moduli = fitted.best.certainty, fitted.moduli()
    for name, sigma in sure.sigma.items():
        own = moduli[moduli["modulus"] == name]
        assert own["sigma_relative"].to_numpy() == pytest.approx(sigma)
        said = fitted.result["uncertainty"]
        assert said["largest_relative_sigma"][name] == pytest.approx(float(sigma.max()))
        assert said["median_relative_sigma"][name] == pytest.approx(float(np.median(sigma)))


def test_the_card_holds_for_the_strains_that_were_reached(fitted):
    (history,) = fitted.best.point.histories
    reached = np.maximum(history.strain_max, np.abs(history.strain_min) * [0, 0, 1])
    assert (reached < 0.95 * fitted.law.strain_range).any()
    assert fitted.best.reached == pytest.approx(reached)
    expected = np.minimum(reached, fitted.law.strain_range)
    assert fitted.card.law.strain_range == pytest.approx(expected)
    assert list(fitted.result["valid_strain"].values()) == pytest.approx(expected.tolist())


def test_progress_is_told_of_everything(fitted):
    heard: list[object] = []
    again = bf.fit(fitted.project, starts=1, jobs=1, progress=heard.append)
    starts = [r for r in heard if isinstance(r, StartRecord)]
    assert len(starts) == 1
    analyses = sum(r is not None and not isinstance(r, StartRecord) for r in heard)
    assert analyses == starts[0].analyses == again.result["analyses"]


def test_interrupted_and_gone_on_with(fitted, tmp_path):
    def interrupt(record):
        if isinstance(record, StartRecord):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bf.fit(fitted.project, jobs=1, out=tmp_path / "out", progress=interrupt)
    with pytest.raises(OutputError, match="--resume"):
        bf.fit(fitted.project, jobs=1, out=tmp_path / "out")
    heard: list[object] = []
    gone_on = bf.fit(
        fitted.project, jobs=1, out=tmp_path / "out", resume=True, progress=heard.append
    )
    assert gone_on.objective == fitted.objective
    assert [r.number for r in heard if isinstance(r, StartRecord)] == [0, 1]
    with pytest.raises(InputError, match=r"fit\.seed = 1, now 9; go on"):
        bf.fit(fitted.project, seed=9, out=tmp_path / "out", resume=True)
    with pytest.raises(InputError, match="nothing to go on with"):
        bf.fit(fitted.project, out=tmp_path / "nowhere", resume=True)


def test_a_best_fit_that_gives_another_objective_is_a_failure(fitted):
    records = list(fitted.best.records)
    first = fitted.best.ranked[0]
    wrong = best.replace(first, objective=first.objective + 1e-3)
    others = [wrong if r.number == first.number else r for r in records]
    only = [r for r in others if r.number == first.number]
    with pytest.raises(SolverFailure, match="from the unloaded state"):
        best.best_fit(fitted.problem, only, fitted.project.fit.tolerance)


def test_the_best_start_is_the_one_run_again(fitted):
    good = fitted.best.ranked[0]
    unknowns = tuple(1.02 * u for u in good.unknowns)
    others = [
        best.replace(good, objective=good.objective + 0.1, unknowns=unknowns),
        best.replace(good, objective=None, unknowns=()),
    ]
    for k in range(3):
        records = [*others[:k], good, *others[k:]]
        records = [best.replace(r, number=number) for number, r in enumerate(records)]
        again = best.best_fit(fitted.problem, records, fitted.project.fit.tolerance)
        assert again.ranked[0].number == k
        # All records, in their order, and the best with the objective of the repeated run.
        assert [r.number for r in again.records] == [r.number for r in records]
        assert [r is again.ranked[0] for r in again.records] == [r.number == k for r in records]
        np.testing.assert_array_equal(again.law.beta, fitted.law.beta)
        assert again.objective == pytest.approx(fitted.objective, abs=1e-9)


def test_the_command_says_so_and_writes_no_result(fitted, tmp_path, monkeypatch):
    """A start whose moduli give another objective from the unloaded state: exit 4, a page."""
    ended = replace(fitted.best.ranked[0], objective=fitted.objective + 1e-3)
    monkeypatch.setattr(
        "bubblefit.runs.executor.Executor.run_starts", lambda *a: iter([replace(ended, number=0)])
    )
    arguments = ("bubble", fitted.project.path, "--starts", 1, "--out", "out", "--json")
    in_process("bubble", fitted.project.path, "--starts", 1, "--out", "out", cwd=tmp_path, code=4)
    for name in ("report.html", "result.json", "material.toml"):
        (tmp_path / "out" / name).write_text("of an earlier fit")
    done = in_process(*arguments, "--overwrite", cwd=tmp_path, code=4)
    assert done.stdout == "" and len(done.stderr.splitlines()) == 1
    for text in (done.stderr, (tmp_path / "out" / "report.html").read_text()):
        assert "from the unloaded state" in text
    assert not (tmp_path / "out" / "result.json").exists()
    assert not (tmp_path / "out" / "material.toml").exists()
    # Its start is kept, so that going on says the same at once.
    done = in_process(*arguments, "--resume", cwd=tmp_path, code=4)
    assert "from the unloaded state" in done.stderr


def test_starts_that_a_failure_ended_are_told(fitted):
    cut = replace(fitted.best.records[1], failure="killed by SIGKILL at once")
    best_of = replace(fitted.best, records=[fitted.best.records[0], cut])
    told = [w for w in notes_of_fit(replace(fitted, best=best_of), {}) if "starts ended" in w]
    assert len(told) == 1 and told[0].startswith("1 of 2") and "killed by SIGKILL" in told[0]


def maps_and_surface_say_what_the_table_says(fit: bf.Fit, folder: Path) -> None:
    """Of the first bubble: every value of the page beside residuals.csv and the history."""
    parts = list(read_page_data(folder).parts)
    (maps,) = [p for p in parts if isinstance(p, Maps) and p.name == "bubble 1 maps"]
    (solid,) = [p for p in parts if isinstance(p, Solid) and p.name == "bubble 1 bubble"]
    table = fit.residuals().query("test == 'bubble 1'")
    assert len(maps.panels) == 9 and sum(maps.counts) == len(table) // 3
    for panel in maps.panels:
        quantity, what = panel.name.split(", ")
        column = "difference" if "−" in what else what
        own = table[table["quantity"] == quantity][column].to_numpy()
        np.testing.assert_allclose(panel.values.values, own, atol=0.51 * panel.values.step + 1e-9)
    history = fit.tests["bubble 1"].histories[0]
    heights = [float(u[:, 2].max()) for u in history.displacement]
    assert solid.points.values[..., 2].max(axis=1) == pytest.approx(heights, rel=1e-4)
    strain = {shade.name: shade.values.values for shade in solid.shades}
    assert strain["strain along the warp ε1"].max() == pytest.approx(history.strain_max[0], rel=0.1)
    # Pulled everywhere, and by no more than the law's stiffest tangent.
    stress, e1 = strain["stress along the warp σ1"], fit.law.modulus("E1", np.linspace(0, 0.1, 50))
    assert 0 < stress.min() and stress[-1].max() < 1.3 * e1.max() * history.strain_max.max()


def test_two_bubbles_with_offsets_of_their_own(tmp_path):
    project = bf.read_project(small(tmp_path, ("[fit]", SECOND)))
    fit = bf.fit(project, starts=1, jobs=1)
    assert list(fit.findings) == ["bubble 1", "softer reading"]
    assert fit.objective < 1e-5
    assert fit.tests["bubble 1"].nuisance == {}
    offset = fit.result["tests"]["softer reading"]["nuisance"]["displacement_offset_mm"]
    assert offset == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert set(fit.result["mean_relative_error"]) == {"bubble 1", "softer reading"}
    assert set(fit.residuals()["test"]) == {"bubble 1", "softer reading"}
    sure, pinned = fit.best.certainty, fit.result["pinned"]["all together"]
    for name, sigma in sure.sigma.items():
        assert pinned[name]["largest"] == pytest.approx(float(sigma.max()))
    page = fit.report(tmp_path / "out").read_text()
    for name in ("bubble-1-profiles.png", "softer-reading-heights.png", "pinned.png"):
        assert name in page and (tmp_path / "out" / name).exists()
    maps_and_surface_say_what_the_table_says(fit, tmp_path / "out")
    alone = bf.fit(project, tests=["softer reading"], starts=1, jobs=1)
    assert list(alone.findings) == ["softer reading"] and "pinned" not in alone.result


@pytest.mark.parametrize("form", ['form = "spline"\nknots = 5', 'form = "quadratic"'])
def test_another_form_of_the_moduli(tmp_path, form):
    fit = bf.fit(bf.read_project(with_form(tmp_path, form)), starts=1, jobs=1)
    errors = fit.result["moduli_error"]
    if "spline" in form:
        assert fit.objective < 1e-6 and max(errors["E1"], errors["E2"]) < 1e-3
        assert len(fit.law.beta) == 15
        card = fit.report(tmp_path / "out").parent / "material.toml"
        again = bf.read_card(card).law
        x = np.linspace(0, fit.best.valid[0], 9)
        assert again.E1(x) == pytest.approx(fit.law.E1(x))
    else:
        assert fit.objective > 1e-3


def test_where_the_best_fit_is_unstable_is_told(fitted):
    def with_unstable(point, words):
        (history,) = point.histories
        return replace(point, histories=(replace(history, unstable=words),))

    def said(counts, leads):
        best = fitted.best
        best = replace(best, point=with_unstable(best.point, counts),
                       differentiated=with_unstable(best.differentiated, leads))  # fmt: skip
        return [w for w in notes_of_fit(replace(fitted, best=best), {}) if "unstable" in w]

    told = ["unstable equilibrium at 59 kPa: the model would not stay there"]
    assert said((), ()) == []
    assert said(("59 kPa",), ()) == told
    # Another program does not look: what leads it does.
    assert said(None, ("59 kPa",)) == told


def test_a_test_that_says_nothing_of_a_modulus_is_named(fitted):
    def said(least):
        sigma = {"least": least, "median": 2.0, "largest": 9.0}
        return [w for w in notes_of_fit(fitted, {"bubble": {"G12": sigma}}) if "alone" in w]

    assert said(0.9) == []
    assert len(said(1.1)) == 1 and "bubble alone does not determine G12" in said(1.1)[0]


def test_one_analysis_serves_both(together):
    problem = together.setup.problem()
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is again.point and again.point.jacobian is not None
    sure, known = with_certainty(together.setup, problem, again).certainty, together.best.certainty
    assert again.certainty is None and sure is not None and known is not None
    for name, sigma in sure.sigma.items():
        np.testing.assert_allclose(sigma, known.sigma[name], rtol=1e-12)


def test_a_surrogate_gives_the_derivatives(together):
    problem, surrogate = together.setup.problem(), together.setup.problem()
    problem.surrogate = surrogate
    again = best_fit(problem, together.best.records, 0.0)
    assert again.point.jacobian is None
    assert again.differentiated is not None and again.differentiated.jacobian is not None
    assert with_certainty(together.setup, problem, again).certainty is not None
    surrogate.evaluate = lambda *_, **__: None
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is None
    assert with_certainty(together.setup, problem, again) is again


@pytest.mark.parametrize(("external", "tries"), [(True, 2), (False, 1)])
def test_another_program_gets_a_second_try(together, external, tries):
    problem = together.setup.problem()
    asked: list[bool] = []

    def fail(*_, **__):
        asked.append(True)
        problem.failure = "no licence"

    problem.evaluate = fail
    problem.solver.external = external
    said = "the best fit does not run again: no licence; its starts are kept, --resume goes on"
    with pytest.raises(SolverFailure, match=said):
        best_fit(problem, together.best.records, 0.0)
    assert len(asked) == tries


@pytest.mark.parametrize(("off", "fails"), [(0.9, False), (1.1, True), (-0.9, False), (-1.1, True)])
def test_what_counts_as_the_same_objective(together, off, fails):
    """1e-5 of it, and a millionth of what the noise adds."""
    problem, first = together.setup.problem(), together.best.ranked[0]
    noise = noise_of(problem)
    assert first.objective is not None
    limit = 1e-5 * first.objective + 1e-6 * sum(noise.values())
    other = replace(first, objective=first.objective + off * limit)
    if fails:
        with pytest.raises(SolverFailure, match="start 0 ended with an objective of"):
            best_fit(problem, [replace(other, number=0)], 0.0)
    else:
        assert best_fit(problem, [other], 0.0).objective == first.objective


def test_noise_is_what_a_perfect_law_leaves(together):
    noise = noise_of(together.setup.problem())
    for prepared, shares in zip(together.setup.tests, ((0.5, 0.5), (3.0,)), strict=True):
        for direction, share in zip(prepared.test.matched, shares, strict=True):
            strip = prepared.test.strips[direction]
            expected = share * strip.scatter / strip.points[1].max()
            assert noise[prepared.part(direction)] == pytest.approx(expected)


SURE, VAGUE = Doubt("unit", True, "off by 1000"), Doubt("slack", False, "0.2 mm of slack")


def looked(*judgements: Judgement) -> Check:
    tests = [SimpleNamespace(test=SimpleNamespace(name=j.test, kind="made")) for j in judgements]
    setup: Any = SimpleNamespace(tests=tests, project=SimpleNamespace(title="made"))
    return Check(setup, judgements)


ONE = Judgement("one", (SURE, VAGUE), frozenset())
TWO = Judgement("two", (SURE, VAGUE), frozenset({"unit"}))
FINE = Judgement("three", (), frozenset())


def test_rows_and_lines():
    assert looked(ONE, TWO, FINE).lines() == [
        "one: error [unit]: off by 1000", "one: warning [slack]: 0.2 mm of slack",
        "two: trusted error [unit]: off by 1000", "two: warning [slack]: 0.2 mm of slack",
        "three: fine: nothing doubtful",
    ]  # fmt: skip


def test_result():
    assert looked(TWO, FINE).result == {
        "command": "check", "version": __version__, "sound": True,
        "tests": {
            "two": [
                {"name": "unit", "severity": "error", "trusted": True, "text": "off by 1000"},
                {"name": "slack", "severity": "warning", "trusted": False,
                 "text": "0.2 mm of slack"},
            ],
            "three": [],
        },
    }  # fmt: skip
    assert not looked(TWO, ONE).sound and looked(FINE).sound


@pytest.mark.parametrize("judgements", [(ONE, TWO), (TWO, FINE), (FINE,)])
def test_page(tmp_path, monkeypatch, judgements):
    seen: list[Report] = []
    presenter = import_module(f"bubblefit.reports.{PRESENTERS['Check'][0]}")
    monkeypatch.setattr(presenter, "write_report", lambda _, report: seen.append(report))

    def examine(one, out):
        name = one.test.name
        return Exhibit([("points", 3)], [(f"{name}.png", name)], [Table(name, [], [])])

    monkeypatch.setattr(presenter, "report_of", lambda kind: SimpleNamespace(examine=examine))
    done = looked(*judgements)
    done.report(tmp_path / "a" / "b")
    (page,) = seen
    names = [judgement.test for judgement in judgements]
    several = len(names) > 1
    assert page.facts == [(f"{name}: points" if several else "points", 3) for name in names]
    assert page.figures == [(f"{name}.png", name) for name in names]
    first, *own = page.tables
    assert first.rows == [[*row] for row in done.rows()]
    assert [table.title for table in own] == names
    assert len(page.warnings) == sum(len(judgement.doubts) for judgement in judgements)
    assert sum("(trusted: unit)" in line for line in page.warnings) == (TWO in judgements)
    text = (tmp_path / "a" / "b" / "check.json").read_text()
    assert json.loads(text) == done.result


#: MPa: E1 of the card, and by how much (1 sigma) two directions move it.
E1, OFF = 500.0, (0.6, -0.8)
#: G12, E2, E1 of each direction.
DIRECTIONS = np.array([[0.1, 2.0, OFF[0]], [0.2, -3.0, OFF[1]]])


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)


def card(directions: np.ndarray = DIRECTIONS, e1: float = E1) -> MaterialCard:
    law = HypoelasticLaw.linear(e1, 150.0, 20.0)
    return MaterialCard(law, 0.81, "sure", "", CardCertainty(directions, "made"))


def predictions(folder: Path, own: MaterialCard, **options: object) -> Predictions:
    project = read_project(write_project(folder))
    return predict(project, "high", cards={"sure": own}, jobs=1, **options)


def slope(folder: Path) -> np.ndarray:
    """N per MPa of E1 at the frames, by the formula."""
    loads = [predictions(folder, replace(card(), certainty=None,
                                         law=HypoelasticLaw.linear(e, 150.0, 20.0))).curves()
             for e in (E1 - 1, E1 + 1)]  # fmt: skip
    return np.asarray((loads[1]["load_N"] - loads[0]["load_N"]) / 2)


def test_steps_give_the_spread_to_first_order(tmp_path):
    events: list[RunEvent | None] = []
    done = predictions(tmp_path, card(), progress=events.append)
    assert events[-1].total == 3  # the prediction, and a run a direction
    curve, (run,) = done.curves(), done.each
    expected = np.abs(slope(tmp_path)) * np.hypot(*OFF)
    np.testing.assert_allclose(curve["load_sigma_N"], expected, rtol=0.003, atol=1e-9)
    assert run.around.words == "2 of its least certain directions"
    at = float(np.interp(100.0, curve["deflection_mm"], curve["load_sigma_N"]))
    row = done.runs().iloc[0]
    assert row["load_at_100_mm_sigma_N"] == pytest.approx(at)
    assert row["load_at_100_mm_N"] > 0 and list(done.runs()["card"]) == ["sure"]
    said = done.result["runs"][0]
    assert said["load_sigma_N"]["100 mm"] == pytest.approx(at)
    assert said["spread"] == "2 of its least certain directions"


def test_draws_give_the_same_spread(tmp_path):
    """Of 300 draws, whose standard deviation is known to 4 %."""
    steps = predictions(tmp_path, card()).curves()["load_sigma_N"].to_numpy()
    done = predictions(tmp_path, card(), samples=300)
    np.testing.assert_allclose(done.curves()["load_sigma_N"], steps, rtol=0.1, atol=1e-9)
    assert done.each[0].around.words == "300 laws drawn"
    # The same again: draws are not another every time.
    few = [predictions(tmp_path, card(), samples=5).curves()["load_sigma_N"] for _ in range(2)]
    np.testing.assert_array_equal(*few)


def test_the_spread_stands_wherever_the_load_does(tmp_path, monkeypatch, drawn):
    monkeypatch.setitem(registry.SOLVERS, "formula", Banded)
    plain = replace(card(), certainty=None)
    project = read_project(write_project(tmp_path))
    done = predict(project, ["high"], {"sure": card(), "plain": plain}, jobs=1, out=tmp_path / "o")
    assert [(r.card, r.wall, r.around is None) for r in done.each] == [
        ("sure", "slack", False), ("sure", "rigid wall", True),
        ("plain", "slack", True), ("plain", "rigid wall", True),
    ]  # fmt: skip
    done.report(tmp_path / "o")
    table = pd.read_csv(tmp_path / "o" / "load_deflection.csv")
    known = table[table["load_sigma_N"].notna()]
    assert set(zip(known["card"], known["wall"], strict=True)) == {("sure", "slack")}
    load = done.outcomes["cylinder"][0].measures[0].loads["100 mm"]
    sigma = done.result["runs"][0]["load_sigma_N"]["100 mm"]
    told = f"{load:.0f} ± {sigma:.2g}"
    assert any(f"{told} N" in line for line in done.lines())
    page = (tmp_path / "o" / "report.html").read_text()
    assert told.replace(" ", "\u00a0") in page
    assert [run["load_sigma_N"] for run in done.result["runs"][2:]] == [
        dict.fromkeys(("40 mm", "100 mm", "240 mm"))
    ] * 2
    (chart,) = [c for charts in drawn for c in charts.charts if c.y_label == "load, N"]
    (sure,) = [s for s in chart.series if s.y and s.lower]
    ends = [known["load_N"] + sign * 1.96 * known["load_sigma_N"] for sign in (-1, 1)]
    np.testing.assert_allclose([sure.lower, sure.upper], ends, rtol=1e-5)
    assert "95 % by the card" in [s.name for s in chart.series]


def test_another_program_is_not_run_unasked(tmp_path, monkeypatch):
    monkeypatch.setattr(Formula, "external", True)
    assert predictions(tmp_path, card()).each[0].around is None
    assert predictions(tmp_path, card(), samples=2).each[0].around.words == "2 laws drawn"


def test_the_command_asks_for_draws_or_none(tmp_path):
    write_project(tmp_path)
    card().write(tmp_path / "sure.toml")
    command = ("bend", "project.toml", "--card", "sure.toml", "--test", "high", "--jobs", "1")
    in_process(*command, "--samples", "3", "--out", "some", cwd=tmp_path)
    runs = json.loads((tmp_path / "some" / "result.json").read_text())["runs"]
    assert [run["spread"] for run in runs] == ["3 laws drawn"]
    in_process(*command, "--samples", "0", "--out", "none", cwd=tmp_path)
    runs = json.loads((tmp_path / "none" / "result.json").read_text())["runs"]
    assert [run["spread"] for run in runs] == [None]


def test_what_is_not_known_is_not_said(tmp_path):
    whole = predictions(tmp_path, card(np.array([[0, 0, E1 - STOPS]]), e1=E1))
    assert whole.curves()["load_sigma_N"].notna().all()
    half = predictions(tmp_path, card(np.array([[0, 0, 5.0]]), e1=STOPS - 5.0)).curves()
    known = half["load_sigma_N"].notna().to_numpy()
    assert known[: len(known) // 2 + 1].all() and not known[len(known) // 2 + 1 :].any()
    failed = predictions(tmp_path, card(np.array([[0, 0, 3.0]]), e1=10.0))
    assert failed.curves()["load_sigma_N"].isna().all()
    assert failed.each[0].around.words == "1 of its least certain directions, 1 failed"
    assert failed.result["runs"][0]["load_sigma_N"]["40 mm"] is None


def test_steps_and_draws():
    own, two = np.array([0.0, 10.0, 20.0]), [np.array([0.0, 11.0, 22.0]), np.array([0.0, 9.0])]
    steps = Around("directions", (1.0, -0.5)).sigma(own, two)
    np.testing.assert_allclose(steps, [0.0, np.hypot(1, 2), np.nan])
    drawn = Around("samples", (1.0, 1.0)).sigma(own, [*two, None])
    np.testing.assert_allclose(drawn, [0.0, np.sqrt(2), np.nan])
    assert np.isnan(Around("directions", (1.0, 1.0)).sigma(own, [two[0], None])).all()
    assert np.isnan(Around("samples", (1.0, 1.0)).sigma(own, [two[0], None])).all()


def test_a_step_keeps_the_moduli_positive(tmp_path):
    """A G12 of 20 MPa that may be off by 30: the step goes up, half of it stays above zero."""
    around, laws = laws_around(card(np.array([[-30.0, 0, 0], [-15.0, 0, 0]])), None)
    assert around.steps == [-1.0, 1.0]
    assert [float(law.G12(0.0)) for law in laws] == pytest.approx([50.0, 5.0])
    torn = card(np.array([[-300.0, 1000.0, 0], [300.0, 0, 0]]))
    around, laws = laws_around(torn, None)
    assert all(float(law.E2(0.0)) > 0 and float(law.G12(0.0)) > 0 for law in laws)
    hopeless = card(np.array([[-3000.0, 2e5, 0]]))
    with pytest.raises(InputError, match="card 'sure': a modulus is not positive next to"):
        predictions(tmp_path, hopeless)
    assert laws_around(replace(card(), certainty=None), None) == (None, ())


FIT = "[fit]\nstarts = 2\nseed = 7\n"


def project(folder: Path, unknowns: str, *changes: tuple[str, str]):
    return read_project(constant_strips(folder, (FIT, f"{FIT}[fit.unknowns]\n{unknowns}\n"),
                                        *changes))  # fmt: skip


def test_a_fit_with_the_thickness_unknown(tmp_path):
    """Strips know modulus times thickness: 5 % of thickness are 5 % of every modulus."""
    unknown = "[fit.unknowns]\nthickness = { bounds = [0.7, 0.9], prior = 0.04 }\n"
    fixed = fit(read_project(constant_strips(tmp_path)), starts=1, jobs=1).result
    constant_strips(tmp_path, (FIT, FIT + unknown))
    done = in_process("uniaxial", "project.toml", "--starts", 1, "--jobs", 1, "--out", "free",
                      cwd=tmp_path)  # fmt: skip
    free = json.loads((tmp_path / "free" / "result.json").read_text())
    said = free["unknowns"]["thickness"]
    assert said["value"] == pytest.approx(0.8, abs=1e-3)
    assert said["sigma"] == pytest.approx(0.04, rel=0.01) and not said["determined"]
    assert "unknowns" not in fixed
    words = f"thickness: {said['verdict']}"
    assert words in done.output.splitlines()
    assert "the data say nothing of it (known to 0.04 mm before); a membrane" in words
    page = (tmp_path / "free" / "report.html").read_text()
    assert said["verdict"] in page and "Unknowns beside the moduli" in page
    assert "thickness (fitted)" in page and "nu12 (fixed)" in page
    assert [n["kind"] for n in free["notes"] if n["note"].startswith("thickness is")] == [
        "uncertain"
    ]
    for name in ("E1", "E2"):
        own, without = (r["uncertainty"]["median_relative_sigma"][name] for r in (free, fixed))
        assert own == pytest.approx(np.hypot(without, 0.05), rel=0.02)
    assert read_card(tmp_path / "free" / "material.toml").thickness == pytest.approx(said["value"])
    assert "thickness" in pd.read_csv(tmp_path / "free" / "history.csv").columns


def test_what_is_shared_stands_before_each_comparisons_own(tmp_path):
    both = "nu12 = {}\nthickness = { prior = 0.02 }"
    problem = prepare_fit(own := project(tmp_path, both), own.chosen(None, fitted=True)).problem()
    assert problem.unknowns.nuisance_names == ("nu12", "thickness")
    nu12, thickness = problem.unknowns.nuisance.shared
    assert (nu12.lower, nu12.upper, nu12.start, nu12.prior) == (0.0, 0.6, 0.0, None)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.4, 1.2))
    assert (thickness.start, thickness.prior, thickness.unit) == (0.8, 0.02, "mm")
    # Noise of a block's norm: the median of what the strips' objectives have.
    weights = [
        c.objective.least_noise / c.objective.scale[0] / np.sqrt(c.objective.sizes[0])
        for c in problem.comparisons
    ]
    assert thickness.weight == pytest.approx(np.median(weights))
    # The start of every comparison's model is its own thickness.
    y = problem.unknowns.at(np.array([10.0, 200.0, 300.0]))
    assert y[3:].tolist() == [0.0, 0.8]


def test_thickness_is_in_the_units_of_the_file(tmp_path):
    pull = "{ gauge_length = %s, final_length = %s }"
    said = project(
        tmp_path, "thickness = { bounds = [7e-4, 9e-4], prior = 3e-5 }",
        ('modulus = "GPa"', 'modulus = "GPa"\nlength = "m"'),
        ("thickness = 0.8", "thickness = 8e-4"),
        (f"warp = {pull % (20, 22.9)}", f"warp = {pull % (0.02, 0.0229)}"),
        (f"fill = {pull % (20, 22.9)}", f"fill = {pull % (0.02, 0.0229)}"),
        (f"warp = {pull % (20, 22.5)}", f"warp = {pull % (0.02, 0.0225)}"),
    )  # fmt: skip
    (thickness,) = shared_unknowns(said)
    assert (thickness.lower, thickness.upper) == pytest.approx((0.7, 0.9))
    assert (thickness.start, thickness.prior) == pytest.approx((0.8, 0.03))


@pytest.mark.parametrize(
    ("unknowns", "key", "words"),
    [
        ("nu12 = { bounds = [0.3, 0.1] }", "nu12.bounds", "least"),
        ("nu12 = { bounds = [0.1, 0.3] }", "nu12.bounds", "around 0"),
        ("nu12 = { bounds = [-0.1, 0.3] }", "nu12.bounds", "below 1"),
        ("nu12 = { bounds = [0.0, 1.0] }", "nu12.bounds", "below 1"),
        ("thickness = { bounds = [0.0, 1.0], prior = 1.0 }", "thickness.bounds", "above"),
        ("thickness = { bounds = [0.9, 1.0], prior = 1.0 }", "thickness.bounds", "around 0.8"),
        ("thickness = {}", "thickness.prior", "missing"),
        ("thickness = { prior = 0.0 }", "thickness.prior", "greater than 0"),
        ("nu21 = {}", "nu21", "nu12, thickness"),
    ],
)
def test_what_cannot_be_meant(tmp_path, unknowns, key, words):
    with pytest.raises(InputError) as told:
        own = project(tmp_path, unknowns)
        prepare_fit(own, own.chosen(None, fitted=True))
    assert told.value.field == f"fit.unknowns.{key}"
    assert words in told.value.problem


EXAMPLE = Path(__file__).parents[2] / "examples" / "uniaxial-valmex7318"
#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}
ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}
BOUNDS = "E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]"
CUBIC = 'form = "cubic"'
BREAKS = "breaks = { warp = [0.1, 0.15], fill = %s%s }"
TRILINEAR = f'form = "trilinear"\n{BREAKS}'
Edit = Callable[..., Project]


@pytest.fixture
def example(tmp_path):
    """Read the example after replacing some texts."""
    (tmp_path / "curves.csv").write_bytes((EXAMPLE / "curves.csv").read_bytes())

    def read(*changes):
        return read_project(
            project_file(tmp_path, (EXAMPLE / "project.toml").read_text(), *changes)
        )

    return read


def law(project: Project) -> HypoelasticLaw:
    return law_of(project, [t.reach for t in project.chosen(None, fitted=True)])


def unknowns(project: Project) -> Unknowns:
    own = law(project)
    return Unknowns.of(own.form, own.nu12, own.strain_range, bounds_of(project, own.form))


def test_the_example(example):
    p = example()
    assert (p.fabric.thickness, p.fabric.thickness_change) == (0.81, "constant")
    own, limits = law(p), bounds_of(p, law(p).form)
    assert (own.form.name, own.nu12, own.thickness_change) == ("cubic", 0.24, "constant")
    assert limits.least == pytest.approx({"E1": 20, "E2": 20, "G12": 1})
    assert limits.largest == pytest.approx({"E1": 2000, "E2": 1000, "G12": 200})
    assert (p.fit.starts, p.fit.seed, p.fit.method, p.fit.solver) == (20, 1, "lm", "membrane")
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    assert own.strain_range == pytest.approx([ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]])


def test_units_of_the_file_do_not_matter(example):
    reference = unknowns(example())
    mpa = unknowns(
        example(
            ('modulus = "GPa"', 'modulus = "MPa"'),
            ("E1 = [0.02, 2.0]", "E1 = [20.0, 2000.0]"),
            ("E2 = [0.02, 1.0]", "E2 = [20.0, 1000.0]"),
            ("G12 = [0.001, 0.2]", "G12 = [1.0, 200.0]"),
        )
    )
    for ours, theirs in zip(mpa.box, reference.box, strict=True):
        assert ours == pytest.approx(theirs)
    metres = example(
        ('length = "mm"', 'length = "m"'), ("thickness = 0.81", "thickness = 0.81e-3"),
        ("width = 25.0", "width = 25.0e-3"), ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
    )  # fmt: skip
    assert metres.fabric.thickness == pytest.approx(0.81)
    assert metres.tests["strips"].thickness == pytest.approx(0.81)


def test_strain_range(example):
    given = "strain_range = [0.1, 0.2, 0.3]"
    own = law(example(("# strain_range = [0.153, 0.232, 0.883]", given)))
    assert own.strain_range.tolist() == [0.1, 0.2, 0.3]
    # Two directions say nothing about the third strain.
    two = ("[strips.data]", "[strips.warp]\n[strips.fill]\n[strips.data]")
    assert "law.strain_range: this key is missing" in complaint(unknowns, example(two))
    # What is known is used, and only the rest is missing.
    constant = law(example(two, (CUBIC, 'form = "constant"')))
    assert constant.strain_range == pytest.approx([ENDS["warp"], ENDS["fill"], 1.0])
    assert list(example(two, ("# strain_range", "strain_range")).tests["strips"].strips) == [
        "warp", "fill",
    ]  # fmt: skip


def test_breaks_that_no_test_tells_are_thirds(example):
    project = example((CUBIC, 'form = "trilinear"'))
    own = law_of(project, [Reach((0.12, 0.24, 0.6))])
    for component, end in enumerate((0.12, 0.24, 0.6)):
        assert own.form.breaks[component] == pytest.approx([end / 3, 2 * end / 3])


@pytest.mark.parametrize("form, size", [("constant", 1), ("linear", 2), ("cubic", 4)])
def test_bounds_on_coefficients(example, form, size):
    n = 3 * size
    low = ", ".join(["-0.5"] * (size - 1) + ["0.01"])
    lists = f"lower = [{', '.join([low] * 3)}]\nupper = [{', '.join(['2.0'] * n)}]"
    p = unknowns(example((CUBIC, f'form = "{form}"'), (BOUNDS, lists)))
    lower, upper = p.box
    assert lower.shape == upper.shape == (n,) and p.bounds.largest is None
    assert lower[size - 1 :: size] == pytest.approx([10] * 3) and (upper == 2000).all()
    assert p.bounds.least == {"E1": 5.0, "E2": 5.0, "G12": 0.5}
    assert p.free == tuple(4 * m + k for m in range(3) for k in range(4 - size, 4))


@pytest.mark.parametrize("form", form_names())
def test_each_modulus_has_bounds_of_its_own(example, form):
    """E1 may not go as low as E2, whatever the smaller of the two."""
    knots = "\nknots = 5" if form == "spline" else ""
    p = example(
        (CUBIC, f'form = "{form}"{knots}'),
        ("E1 = [0.02, 2.0]", "E1 = [0.1, 2.0]"),
        ("G12 = [0.001, 0.2]", "G12 = [0.003, 0.2]"),
    )
    own = unknowns(p)
    values = np.linalg.inv(own.form.from_values(own.strain_range))
    of = np.array(own.form.modulus_of)

    def constant(e1, e2, g12):
        moduli = {"E1": e1, "E2": e2, "G12": g12}
        return np.linalg.solve(values, [moduli[name] for name in of])

    inside = [(100.1, 20.1, 3.1), (1999, 999, 199)]
    outside = [(99, 30, 4), (150, 19, 4), (150, 30, 2.9), (2001, 30, 4), (150, 1001, 4)]
    for moduli, good in [(m, True) for m in inside] + [(m, False) for m in outside]:
        coefficients = constant(*moduli)
        a, c = own.inequalities
        assert allowed(own, coefficients[None])[0] == good, moduli
        assert (a @ own.at(coefficients) >= c).all() == good, moduli
    # Starts too: the moduli at the control strains, each between its own.
    drawn = draw(own, np.random.default_rng(1), 500) @ values.T
    for name, (low, high) in {"G12": (3, 200), "E2": (20, 1000), "E1": (100, 2000)}.items():
        part = drawn[:, of == name]
        assert (part > low * (1 - 1e-9)).all() and (part < high * (1 + 1e-9)).all()
        assert part.min() < 1.1 * low and part.max() > 0.9 * high


def test_breaks(example):
    trilinear = (CUBIC, 'form = "trilinear"')
    own = law(example(trilinear))
    breaks = np.array(own.form.breaks)
    # Where three lines follow the load curves best; the warp curve is stiff, soft, stiff.
    assert (0 < breaks[:, 0]).all() and (breaks[:, 1] < own.strain_range).all()
    assert (breaks[:, 0] < breaks[:, 1]).all()
    assert breaks[0] == pytest.approx([0.022, 0.11], abs=0.006)
    given = "[law.breaks]\nwarp = [0.02, 0.1]\nfill = [0.03, 0.2]\nshear = [0.1, 0.5]\n"
    own = law(example(trilinear, ("# [least, largest]", f"{given}# [least, largest]")))
    np.testing.assert_array_equal(own.form.breaks, [[0.02, 0.1], [0.03, 0.2], [0.1, 0.5]])


@pytest.mark.parametrize(
    "old, new, words",
    [
        (BOUNDS, "", ["law.bounds", "[least, largest] of E1, E2 and G12, or 'lower' and 'upper'"]),
        ("G12 = [0.001, 0.2]", "", ["law.bounds.G12", "missing"]),
        ("G12 = [0.001, 0.2]", "G12 = [0.2, 0.2]", ["law.bounds.G12", "[least, largest]"]),
        (BOUNDS, "lower = [0.1]", ["law.bounds.upper", "missing"]),
        (BOUNDS, "lower = [0.1]\nupper = [1]", ["law.bounds.lower", "12 coefficients", "got 1"]),
        (CUBIC, f"{CUBIC}\nmargin = {{ E = 1, G12 = 1 }}", ["law.margin", "leave this out"]),
        (CUBIC, f"{CUBIC}\n{BREAKS % ('[1, 2]', ', shear = [1, 2]')}", ["law.breaks", "cubic"]),
        (CUBIC, TRILINEAR % ("[0.1, 0.05]", ", shear = [0.1, 0.2]"), ["law.breaks.fill", "first"]),
        (CUBIC, 'form = "trilinear"\nbreaks = { warp = [0.1, 0.15] }', ["law.breaks.fill"]),
    ],
)
def test_a_law_that_cannot_be_is_named(example, tmp_path, old, new, words):
    said = complaint_with(words, unknowns, example((old, new)))
    assert said.startswith(str(tmp_path))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("G12 = [0.001, 0.2]", "G12 = [0.001]", ["law.bounds.G12", "at least 2 items"]),
        ("G12 = [0.001, 0.2]", "G12 = [-1, 0.2]", ["law.bounds.G12[0]", "greater than 0"]),
        ("thickness = 0.81", "thickness = 0", ["fabric.thickness", "greater than 0"]),
        ("thickness = 0.81", "thikness = 0.81", ["fabric.thikness", "did you mean 'thickness'"]),
        ('modulus = "GPa"', 'load = "kN"', ["units.load", "unknown key"]),
        ("[fit]", "[fit]\nnuisance = {}", ["fit.nuisance", "unknown key"]),
        ("[fit]", "[bubbles]\n[fit]", ["bubbles", "did you mean 'bubble'"]),
    ],
)
def test_a_file_that_cannot_be_is_named(example, tmp_path, old, new, words):
    assert complaint_with(words, example, (old, new)).startswith(str(tmp_path))
