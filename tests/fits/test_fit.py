"""A fit from Python: the same result as the command, tables, interruption, several tests."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError, SolverFailure
from bubblefit.reports.charts import Charts
from bubblefit.reports.content import read_page_data
from bubblefit.reports.maps import Maps, Solid
from bubblefit.runs import best
from bubblefit.runs.starts import StartRecord

from ..commands import in_process, result_in
from ..drawings import data, lines
from ..projects import small, with_form

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
def fitted(tmp_path_factory) -> bf.Fit:
    project = bf.read_project(small(tmp_path_factory.mktemp("fit")))
    return bf.fit(project, tests="bubble", starts=2, jobs=1)


def test_the_same_as_the_command(fitted: bf.Fit, tmp_path: Path):
    in_process("bubble", fitted.project.path, "--starts", 2, "--out", "out", cwd=tmp_path)
    theirs = result_in(tmp_path / "out")
    for key in ("objective", "beta", "strain_reached", "starts", "moduli_error", "warnings"):
        assert json.loads(json.dumps(fitted.result[key])) == theirs[key], key


def test_every_place_says_the_same_objective(fitted: bf.Fit, tmp_path: Path):
    page = fitted.report(tmp_path).read_text()
    said = result_in(tmp_path)
    assert said["objective"] == fitted.objective == fitted.best.point.value
    first = min(said["starts"], key=lambda s: s["objective"])
    assert first["objective"] == fitted.objective
    assert f"objective {fitted.objective:.4g}" in fitted.card.source
    assert f"{fitted.objective:.3g}" in page
    assert fitted.starts()["objective"].min() == fitted.objective


def test_tables(fitted: bf.Fit, tmp_path: Path):
    moduli = fitted.moduli()
    sigma = ["sigma_relative", "noise_relative", "mesh_relative"]
    band = ["lower_MPa", "upper_MPa"]
    assert list(moduli.columns) == ["modulus", "strain", "MPa", *band, *sigma]
    sure = fitted.best.certainty
    assert sure is not None
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


def test_figures_show_what_the_tables_hold(fitted: bf.Fit, tmp_path: Path, drawn: list[Charts]):
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


def test_the_listed_uncertainty_is_one_standard_deviation(fitted: bf.Fit):
    """In the table and on the page as in the numbers that were reckoned."""
    sure, moduli = fitted.best.certainty, fitted.moduli()
    assert sure is not None
    for name, sigma in sure.sigma.items():
        own = moduli[moduli["modulus"] == name]
        assert own["sigma_relative"].to_numpy() == pytest.approx(sigma)
        said = fitted.result["uncertainty"]
        assert said["largest_relative_sigma"][name] == pytest.approx(float(sigma.max()))
        assert said["median_relative_sigma"][name] == pytest.approx(float(np.median(sigma)))


def test_the_card_holds_for_the_strains_that_were_reached(fitted: bf.Fit):
    """Less than the range that the law was given: beyond, its moduli are nobody's finding."""
    (history,) = fitted.best.point.histories
    reached = np.maximum(history.strain_max, np.abs(history.strain_min) * [0, 0, 1])
    assert (reached < 0.95 * fitted.law.strain_range).any()
    assert fitted.best.reached == pytest.approx(reached)
    expected = np.minimum(reached, fitted.law.strain_range)
    assert fitted.card.law.strain_range == pytest.approx(expected)
    assert list(fitted.result["valid_strain"].values()) == pytest.approx(expected.tolist())


def test_progress_is_told_of_everything(fitted: bf.Fit):
    heard: list[object] = []
    again = bf.fit(fitted.project, starts=1, jobs=1, progress=heard.append)
    starts = [r for r in heard if isinstance(r, StartRecord)]
    assert len(starts) == 1
    analyses = sum(r is not None and not isinstance(r, StartRecord) for r in heard)
    assert analyses == starts[0].analyses == again.result["analyses"]


def test_interrupted_and_gone_on_with(fitted: bf.Fit, tmp_path: Path):
    def interrupt(record: object) -> None:
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


def test_a_best_fit_that_gives_another_objective_is_a_failure(fitted: bf.Fit):
    records = list(fitted.best.records)
    first = fitted.best.ranked[0]
    wrong = best.replace(first, objective=first.objective + 1e-3)
    others = [wrong if r.number == first.number else r for r in records]
    only = [r for r in others if r.number == first.number]
    with pytest.raises(SolverFailure, match="from the unloaded state"):
        best.best_fit(fitted.problem, only, fitted.project.fit.tolerance)


def test_the_best_start_is_the_one_run_again(fitted: bf.Fit):
    """Whatever its number; one that found no start at all is no candidate."""
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


def test_the_command_says_so_and_writes_no_result(fitted: bf.Fit, tmp_path: Path, monkeypatch):
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
    for word in (
        "start 0 ended with an objective of",
        "from the unloaded state",
        "more increments",
    ):
        assert word in done.stderr
        assert word in (tmp_path / "out" / "report.html").read_text()
    assert not (tmp_path / "out" / "result.json").exists()
    assert not (tmp_path / "out" / "material.toml").exists()
    # Its start is kept, so that going on says the same at once.
    done = in_process(*arguments, "--resume", cwd=tmp_path, code=4)
    assert "from the unloaded state" in done.stderr


def test_starts_that_a_failure_ended_are_told(fitted: bf.Fit):
    from bubblefit.runs.record import notes_of_fit

    cut = replace(fitted.best.records[1], failure="killed by SIGKILL at once")
    best_of = replace(fitted.best, records=[fitted.best.records[0], cut])
    told = [w for w in notes_of_fit(replace(fitted, best=best_of), {}) if "starts ended" in w]
    assert told == ["1 of 2 starts ended because membrane failed (killed by SIGKILL at once): "
                    "--resume tries them again"]  # fmt: skip


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


def test_two_bubbles_with_offsets_of_their_own(tmp_path: Path):
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
    assert sure is not None
    for name, sigma in sure.sigma.items():
        assert pinned[name]["largest"] == pytest.approx(float(sigma.max()))
    page = fit.report(tmp_path / "out").read_text()
    for name in ("bubble-1-profiles.png", "softer-reading-heights.png", "pinned.png"):
        assert name in page and (tmp_path / "out" / name).exists()
    maps_and_surface_say_what_the_table_says(fit, tmp_path / "out")
    alone = bf.fit(project, tests=["softer reading"], starts=1, jobs=1)
    assert list(alone.findings) == ["softer reading"] and "pinned" not in alone.result


@pytest.mark.parametrize("form", ['form = "spline"\nknots = 5', 'form = "quadratic"'])
def test_another_form_of_the_moduli(tmp_path: Path, form: str):
    """A spline with a continuous curvature can be the cubic behind the data, a quadratic not."""
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


def test_where_the_best_fit_is_unstable_is_told(fitted: bf.Fit):
    from bubblefit.runs.record import notes_of_fit

    def with_unstable(point, words):
        (history,) = point.histories
        return replace(point, histories=(replace(history, unstable=words),))

    def said(counts, leads) -> list[str]:
        best = fitted.best
        best = replace(best, point=with_unstable(best.point, counts),
                       differentiated=with_unstable(best.differentiated, leads))  # fmt: skip
        return [w for w in notes_of_fit(replace(fitted, best=best), {}) if "unstable" in w]

    told = ["unstable equilibrium at 59 kPa: the model would not stay there"]
    assert said((), ()) == []
    assert said(("59 kPa",), ()) == told
    # Another program does not look: what leads it does.
    assert said(None, ("59 kPa",)) == told


def test_a_test_that_says_nothing_of_a_modulus_is_named(fitted: bf.Fit):
    from bubblefit.runs.record import notes_of_fit

    def said(least: float) -> list[str]:
        sigma = {"least": least, "median": 2.0, "largest": 9.0}
        return [w for w in notes_of_fit(fitted, {"bubble": {"G12": sigma}}) if "alone" in w]

    assert said(0.9) == []
    assert len(said(1.1)) == 1 and "bubble alone does not determine G12" in said(1.1)[0]
