"""Bootstrap: specimens, tests and frames drawn again, the command, and going on."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.inference.reported import UNKNOWN
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.reports.html import percent
from bubblefit.runs import bootstrap as module
from bubblefit.runs.bootstrap import FEW_UNITS, MAX_ANALYSES, bootstrap
from bubblefit.runs.result import Fit

from ..builders.closed_forms import CARD, best_warp
from ..builders.projects import CONSTANT_BUBBLE, STRIP_MODULI, constant_strips, project_file
from ..support.charts import charts_of
from ..support.commands import in_process
from ..support.refusals import raised


@pytest.fixture(scope="module")
def drawn_again(project):
    return bootstrap(project, "specimens", 8, CARD, "one")


def at_rest(done, name):
    return np.array(done.moduli[name][:, 0])


def commanded(folder, card, *command):
    constant_strips(folder)
    (folder / "out" / folder.name).mkdir(parents=True)
    write_card(card, folder / "out" / folder.name / "material.toml")
    done, out = in_process(*command, "--out", "there", cwd=folder), folder / "there"
    refused = in_process(*command, "--out", "there", cwd=folder, code=2)
    assert "already holds" in refused.output + refused.stderr
    result = json.loads((out / "result.json").read_text())
    return done.output, result, (out / "report.html").read_text(), out


def test_specimens_are_drawn_again(drawn_again):
    done = drawn_again
    assert [g.name for g in done.groups] == ["one: warp", "one: fill"]
    units = [u.name for u in done.groups[0].units]
    assert units == ["one: warp, specimen a", "one: warp, specimen b"]
    for k, (name, direction, fit) in enumerate((("E1", "warp", 330.0), ("E2", "fill", 190.0))):
        counts = np.array([sample.counts[k] for sample in done.samples])
        assert (counts.sum(axis=1) == 2).all() and len({*counts[:, 0].tolist()}) > 1
        expected = counts @ np.array(STRIP_MODULI["one"][direction]) / 2
        np.testing.assert_allclose(at_rest(done, name), expected, rtol=1e-4)
        assert done.sigma[name][0] == pytest.approx(expected.std(ddof=1) / fit, rel=1e-3)
        low, high = np.quantile(expected, [0.025, 0.975])
        np.testing.assert_allclose(done.bands[name][:, 0], [low, high], rtol=1e-4)
    assert all(
        1 <= s.analyses <= MAX_ANALYSES or s.counts == [[1, 1], [1, 1]] for s in done.samples
    )
    assert done.analyses == done.optimum_analyses + sum(s.analyses for s in done.samples)
    # The process of the samples has run the analysis at the optimum once more.
    assert done.optimum_analyses == done.optimum.analyses + 1
    few = [(FEW_UNITS, of) for of in ("one: warp", "one: fill", "")]
    assert [(n.kind, n.of) for n in done.notes] == few
    correlations = done.coefficients()
    assert correlations["unknown"].to_list() == ["beta_3", "beta_7", "beta_11"]
    both = np.corrcoef(at_rest(done, "E1"), at_rest(done, "E2"))[0, 1]
    assert correlations["beta_7"].to_list()[1:] == pytest.approx([1.0, both])


def test_tests_are_drawn_again(tmp_path):
    project = read_project(constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5")))
    done = bootstrap(project.with_fit(jobs=1, seed=3), "tests", 6, CARD)
    (group,) = done.groups
    assert (group.name, [u.name for u in group.units]) == ("strips", ["one", "two"])
    for sample, found in zip(done.samples, at_rest(done, "E1"), strict=True):
        one, two = sample.counts[0]
        assert found == pytest.approx(best_warp(one, 0.5 * two), rel=1e-3)
    assert {tuple(s.counts[0]) for s in done.samples} == {(2, 0), (1, 1), (0, 2)}


def test_frames_are_drawn_again(project, tmp_path):
    text = CONSTANT_BUBBLE.replace("pressures = [22, 59]", "pressures = [22, 40, 59]")
    bubble = read_project(project_file(tmp_path, text)).with_fit(jobs=1)
    card = MaterialCard(HypoelasticLaw.linear(790.0, 395.0, 85.0, 0.24), 0.81, "near")
    found = module.find_optimum(bubble, card, None)
    (group,) = module.groups_of(found, "frames")
    assert [u.name.split(": ")[-1] for u in group.units] == ["22 kPa", "40 kPa", "59 kPa"]
    words = "--over: no kind has two tests or more"
    raised(InputError, words, module.groups_of, found, "tests")
    problem = found.problem
    norms = problem.blocks.norms(found.point.residual).reshape(3, 3).sum(axis=1)
    factors = module.factors_of(problem, [group], [[2, 0, 1]])
    weighted = problem.blocks.value(factors * found.point.residual)
    assert weighted == pytest.approx(2 * norms[0] + norms[2])
    (part,) = [
        p for p in module.omittable_parts(found.setup, "frames") if p.name.endswith(": 40 kPa")
    ]
    y = problem.unknowns.at(np.array([80.0, 390.0, 790.0]))
    rest = found.setup.problem(part.masks).evaluate(y, False)
    factors = module.factors_of(problem, [group], [[1, 0, 1]])
    own = problem.blocks.value(factors * problem.evaluate(y, False).residual)
    assert own == pytest.approx(rest.value, rel=1e-6)
    problem = module.find_optimum(project, CARD, "one").problem
    (warp, _) = problem.comparisons
    warp.objective.spread_over_residuals = lambda values: None
    with pytest.raises(InputError, match="--over: one: warp"):
        module.rows_of(problem, {"one: warp": np.ones(22, dtype=bool)})


def test_interrupted_bootstrap_is_resumed(project, drawn_again, tmp_path, monkeypatch):
    fitted, write = [], module.StudyRecord.write

    def stops(record, sample):
        fitted.append(sample.number)
        write(record, sample)
        if len(fitted) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(module.StudyRecord, "write", stops)
    given = {"card": CARD, "tests": "one", "out": tmp_path / "out"}
    raised(KeyboardInterrupt, "", bootstrap, project, "specimens", 4, **given)
    raised(OutputError, "already holds results", bootstrap, project, "specimens", 4, **given)
    counted = []

    def count(*event):
        if len(event) == 3:
            counted.append(event[:2])

    done = bootstrap(project, "specimens", 4, **given, resume=True, progress=count)
    assert fitted == [0, 1, 2, 3] and counted == [(2, 4), (3, 4), (4, 4)]
    assert [s.counts for s in done.samples] == [s.counts for s in drawn_again.samples[:4]]
    np.testing.assert_allclose(done.unknowns, drawn_again.unknowns[:4], rtol=1e-6)
    # Samples of an earlier run with more of them do not count.
    bootstrap(project, "specimens", 2, **given, resume=True, progress=count)
    assert counted[3:] == [(2, 2)] and fitted == [0, 1, 2, 3]
    bootstrap(project, "specimens", 2, **given, resume=True, seed=8)
    assert fitted == [0, 1, 2, 3, 0, 1]


def test_bootstrap_command_writes_page_and_tables(tmp_path):
    words, said, page, folder = commanded(
        tmp_path, CARD, "bootstrap", "project.toml", "--over", "specimens", "--samples", "5",
        "--test", "one", "--jobs", "2", "--seed", "4", "--quiet",
    )  # fmt: skip
    assert (said["samples"], said["over"], said["seed"]) == (5, "specimens", 4)
    assert said["groups"]["one: fill"] == ["one: fill, specimen a", "one: fill, specimen b"]
    assert f"; {said['analyses']} analyses" in words
    sigma = f"E1 {percent(said['sigma_relative']['E1'])}"
    assert sigma in words and sigma in page.replace("\u00a0", " ")
    table = pd.read_csv(folder / "bootstrap.csv")
    own = table[(table["modulus"] == "E1")]
    assert (own["lower_MPa"] <= own["median_MPa"]).all()
    assert own["sigma_relative"].iloc[0] == pytest.approx(said["sigma_relative"]["E1"], rel=1e-6)
    fit, low, high = charts_of(folder)["bootstrap"][0].series
    drawn = {"fit_MPa": fit.y, "fit_lower_MPa": fit.lower, "fit_upper_MPa": fit.upper}
    for column, values in (drawn | {"lower_MPa": low.y, "upper_MPa": high.y}).items():
        assert values == pytest.approx(own[column], rel=1e-5)
    assert low.name == high.name != fit.name
    assert (folder / "bootstrap.png").stat().st_size > 10_000
    unknowns = pd.read_csv(folder / "coefficients.csv")
    of_fit = (unknowns["sigma_of_fit"] / unknowns["value"]).to_list()
    # The fit's own, of which the coefficients are without bounds: nothing is near one.
    quoted = said["sigma_relative_of_fit"]
    assert [quoted["E1"], quoted["E2"]] == pytest.approx(of_fit[:0:-1], rel=0.01)
    assert f"(fit {percent(quoted['E1'])})" in words and f"(fit {UNKNOWN})" in words


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


@pytest.mark.parametrize(("count", "samples", "of"), [(4, 40, ["a"]), (5, 39, [""]), (6, 40, [])])
def test_few_units_or_samples_are_noted(count, samples, of):
    optimum = SimpleNamespace(notes=[])
    groups = [SimpleNamespace(name="a", units=list(range(count)))]
    drawn = module.Bootstrap(optimum, "specimens", groups, [None] * samples, 1)
    assert [(note.kind, note.of) for note in drawn.notes] == [(FEW_UNITS, name) for name in of]
