"""Studies that begin at a card: bootstrap, plan, profiles, nu12, weights; closed forms, files."""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, OutputError, SolverFailure
from bubblefit.experiments.registry import kinds
from bubblefit.inference.information import information_of
from bubblefit.inference.likelihood import BOUND, THRESHOLD, ProfileSide
from bubblefit.inference.moduli import moduli_sigmas
from bubblefit.inference.reported import UNKNOWN, ReportedModulus
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.reports.html import percent
from bubblefit.runs import bootstrap as module
from bubblefit.runs import plan as plan_module
from bubblefit.runs import weight_study as study_of
from bubblefit.runs.bootstrap import FEW_UNITS, MAX_ANALYSES, bootstrap
from bubblefit.runs.optimum import NOT_THE_CARD, find_optimum
from bubblefit.runs.plan import plan
from bubblefit.runs.profile import NOT_CLOSED, Profile, profile
from bubblefit.runs.refinement import ratios, vary_nu12
from bubblefit.runs.result import Fit
from bubblefit.runs.simulation import FAILED
from bubblefit.runs.weight_study import COUNTS, weights
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.optimize import minimize_scalar

from ..builders.bars import STRETCH, BarTest, project_of
from ..builders.laws import TABLE_4_2
from ..builders.projects import (
    CONSTANT_BUBBLE,
    STRIP_ELONGATION,
    STRIP_MODULI,
    constant_strips,
    known_bubble,
    project_file,
)
from ..support.charts import charts_of, data
from ..support.commands import in_process
from ..support.refusals import raised

# Packages of kinds have functions of the same names.
bubbles = import_module("bubblefit.experiments.bubble.planning")
strips = import_module("bubblefit.experiments.strips.planning")
#: MPa, near the optima of the tests; without contraction loads along the yarns are 20 mm^2 E eps.
CARD = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "near")
ENDS = {"one": 2.9, "two": 2.5}
STRAIN = {
    test: np.log1p(STRIP_ELONGATION[STRIP_ELONGATION <= end] / 20) for test, end in ENDS.items()
}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return read_project(constant_strips(tmp_path_factory.mktemp("strips"))).with_fit(jobs=1)


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


def test_specimens_drawn_again(drawn_again):
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
    few = [(FEW_UNITS, of) for of in ("one: warp", "one: fill", "")]
    assert [(n.kind, n.of) for n in done.notes] == few
    correlations = done.coefficients()
    assert correlations["unknown"].to_list() == ["beta_3", "beta_7", "beta_11"]
    both = np.corrcoef(at_rest(done, "E1"), at_rest(done, "E2"))[0, 1]
    assert correlations["beta_7"].to_list()[1:] == pytest.approx([1.0, both])


def relative_error(test, direction, modulus):
    loads = np.array([20 * e * STRAIN[test] for e in STRIP_MODULI[test][direction]])
    return float(np.sqrt(np.mean((20 * modulus * STRAIN[test] - loads) ** 2)) / loads.max())


def best_warp(one, two):
    """E1 (MPa) that both tests together ask for: fill of "one" has half of its weight."""

    def total(modulus):
        own = one * relative_error("one", "warp", modulus) / 2
        return own + two * relative_error("two", "warp", modulus)

    found = minimize_scalar(total, bounds=(200, 500), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


def test_tests_drawn_again(tmp_path):
    project = read_project(constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5")))
    done = bootstrap(project.with_fit(jobs=1, seed=3), "tests", 6, CARD)
    (group,) = done.groups
    assert (group.name, [u.name for u in group.units]) == ("strips", ["one", "two"])
    for sample, found in zip(done.samples, at_rest(done, "E1"), strict=True):
        one, two = sample.counts[0]
        assert found == pytest.approx(best_warp(one, 0.5 * two), rel=1e-3)
    assert {tuple(s.counts[0]) for s in done.samples} == {(2, 0), (1, 1), (0, 2)}


def test_frames_drawn_again(project, tmp_path):
    text = CONSTANT_BUBBLE.replace("pressures = [22, 59]", "pressures = [22, 40, 59]")
    bubble = read_project(project_file(tmp_path, text)).with_fit(jobs=1)
    card = MaterialCard(HypoelasticLaw.linear(790.0, 395.0, 85.0, 0.24), 0.81, "near")
    found = module.find_optimum(bubble, card, None)
    (group,) = module.groups_of(found, "frames")
    assert [u.name.split(": ")[-1] for u in group.units] == ["22 kPa", "40 kPa", "59 kPa"]
    problem = found.problem
    norms = problem.blocks.norms(found.point.residual).reshape(3, 3).sum(axis=1)
    factors = module.factors_of(problem, [group], [[2, 0, 1]])
    weighted = problem.blocks.value(factors * found.point.residual)
    assert weighted == pytest.approx(2 * norms[0] + norms[2])
    (part,) = [p for p in module.parts_of(found.setup, "frames") if p.name.endswith(": 40 kPa")]
    y = problem.unknowns.at(np.array([80.0, 390.0, 790.0]))
    rest = found.setup.problem(part.masks).evaluate(y, False)
    factors = module.factors_of(problem, [group], [[1, 0, 1]])
    own = problem.blocks.value(factors * problem.evaluate(y, False).residual)
    assert own == pytest.approx(rest.value, rel=1e-6)
    problem = module.find_optimum(project, CARD, "one").problem
    (warp, _) = problem.comparisons
    warp.objective.of_points = lambda values: None
    with pytest.raises(InputError, match="--over: one: warp"):
        module.rows_of(problem, {"one: warp": np.ones(22, dtype=bool)})


def test_a_bootstrap_goes_on_where_it_was(project, drawn_again, tmp_path, monkeypatch):
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
    done = bootstrap(project, "specimens", 4, **given, resume=True)
    assert fitted == [0, 1, 2, 3]
    assert [s.counts for s in done.samples] == [s.counts for s in drawn_again.samples[:4]]
    np.testing.assert_allclose(done.unknowns, drawn_again.unknowns[:4], rtol=1e-6)
    bootstrap(project, "specimens", 2, **given, resume=True, seed=8)
    assert fitted == [0, 1, 2, 3, 0, 1]


def test_the_command(tmp_path):
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


PLANNED_ENDS = (0.1, 0.1, 0.05)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(bubbles, "USUAL", replace(bubbles.USUAL, elements=32))
    monkeypatch.setattr(bubbles, "CANDIDATES", replace(bubbles.CANDIDATES, angles=()))
    few = replace(strips.CANDIDATES, angles=(), increments=4)
    monkeypatch.setattr(strips, "CANDIDATES", few)


def named(made):
    return {planned.name: planned for planned in made.candidates}


def test_strips_of_constant_moduli(project, few, monkeypatch):
    monkeypatch.setattr(bubbles, "CANDIDATES", replace(bubbles.CANDIDATES, angles=(45.0,)))
    made = plan(project, CARD, strain=PLANNED_ENDS)
    sure = find_optimum(project, CARD, None).certainty
    for name in ("E1", "E2"):
        assert made.present.summary[name] == pytest.approx(sure.moduli[name].rms_sigma, rel=1e-9)
    assert made.present.words["G12"] == UNKNOWN
    # Three more specimens as those of the first test, of which there are two.
    more = named(made)["warp strip"]
    assert more.specimens == 3
    strain, law = STRAIN["one"], find_optimum(project, CARD, None).best.law
    off = np.concatenate(
        [20 * (m - float(law.E1(0.0))) * strain for m in STRIP_MODULI["one"]["warp"]]
    )
    scatter = project.tests["one"].strips["warp"].scatter
    noise = max(float(np.sqrt(np.mean(off**2))), scatter)
    levels = np.log1p(2.9 * np.arange(1, 5) / 4 / 20)
    value = noise * np.sqrt(2 * len(levels))
    added = 3 * np.sum((20 * levels) ** 2) / value**2 * float(law.E1(0.0)) ** 2
    before = made.present.summary["E1"] ** -2
    assert more.summary["E1"] == pytest.approx((before + added) ** -0.5, rel=2e-3)
    assert more.summary["E2"] == pytest.approx(made.present.summary["E2"], rel=1e-9)
    assert more.noise == f"{value:.3g} N at 4 values (that of one)"
    sheared = [p.name for p in made.candidates if p.words["G12"] != UNKNOWN]
    others = {name for name in sheared if not name.startswith("bubble")}
    assert (
        others == {"strip at 45 degrees", "torsion of a tube"}
        and "bubble, elliptic rim at 45 degrees" in sheared
    )
    worst = [float(f"{max(p.summary.values()):.2g}") for p in made.candidates]
    assert worst == sorted(worst) and made.candidates[0].name in sheared
    by_warp = plan(project, CARD, strain=PLANNED_ENDS, rank="E1")
    values = [float(f"{p.summary['E1']:.2g}") for p in by_warp.candidates]
    assert values == sorted(values) and by_warp.criterion.startswith("1 sigma of E1,")
    assert by_warp.following is not None and by_warp.following.summary["E1"] < values[0]
    # The card's valid range, but no further than the law; without one, the strains of the tests.
    monkeypatch.setattr(plan_module, "kinds", lambda: {"strips": kinds()["strips"]})
    limited = replace(CARD, law=replace(CARD.law, strain_range=np.array([0.09, 0.2, 0.03])))
    np.testing.assert_allclose(plan(project, limited).ends, [0.09, 0.14, 0.03])
    reached = plan(project, CARD).ends
    np.testing.assert_allclose(reached[:2], np.log([22.9 / 20] * 2), rtol=1e-3)
    # After three more specimens along the warp three more again.
    again = plan(project, CARD, strain=PLANNED_ENDS, rank="E1").following
    assert again.name == "warp strip" and again.specimens == 3
    assert again.summary["E1"] == pytest.approx((before + 2 * added) ** -0.5, rel=2e-3)


KNOWN = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.1, 0.1, 0.08])
BUBBLE_CARD = MaterialCard(KNOWN, 0.81, "Table 4.2")


def test_a_test_made_again_adds_as_much_information_as_it_has(tmp_path, few):
    # So little noise that what is known before does not count.
    project = read_project(
        known_bubble(tmp_path, ('objective = "e"', 'objective = "e"\nnoise = 1e-3'))
    )
    found = find_optimum(project, BUBBLE_CARD, None)
    (comparison,) = found.problem.comparisons
    unknowns, law = found.problem.unknowns, found.best.law
    once, _ = information_of(comparison, law, unknowns)
    once = once / found.certainty.noise.correlated_count["bubble"]
    once = once * (comparison.objective.least_noise / found.certainty.noise.level["bubble"]) ** 2
    before = (found.certainty.fine or found.certainty.posterior).covariance
    for options, times in (
        ({}, 1.0),
        # Twice noisier values say a quarter.
        ({"noise": {"bubble": 2 * found.certainty.noise.level["bubble"]}}, 0.25),
        # Four specimens say as much as four tests.
        ({"specimens": 4}, 4.0),
    ):
        made = plan(project, BUBBLE_CARD, **options)
        again = named(made)["the same bubble again"]
        assert ("(given)" in again.noise) == ("noise" in options)
        after = np.linalg.inv(np.linalg.inv(before) + times * once)
        _, sigma = moduli_sigmas(unknowns, law, made.ends, after)
        for name in ("E1", "E2"):
            assert again.summary[name] < made.present.summary[name]
            expected = np.sqrt(np.mean(sigma[name] ** 2))
            # To first order: G12 is not far from its bounds.
            assert again.summary[name] == pytest.approx(expected, rel=0.06)


def test_row_now_is_what_the_fit_reports(tmp_path, few):
    path = known_bubble(tmp_path, ("displacement_offset = false", "displacement_offset = true"),
                 ("pressure_offset = false", "pressure_offset = true"))  # fmt: skip
    project = read_project(path)
    made, found = plan(project, BUBBLE_CARD), find_optimum(project, BUBBLE_CARD, None)
    for name, modulus in made.present.moduli.items():
        value = found.best.law.modulus(name, modulus.strain)
        fit = found.certainty.moduli[name].at(modulus.strain, value)
        np.testing.assert_allclose(modulus.sigma, fit.sigma, rtol=0.02)
        np.testing.assert_allclose(modulus.band, fit.band, rtol=0.02)


def test_what_cannot_be_computed_is_left_out_and_named(project, few, monkeypatch):
    made, told = strips._computed, []

    def fails(name, *rest):
        if name == "fill strip":
            raise SolverFailure("no equilibrium", "membrane")
        return made(name, *rest)

    monkeypatch.setattr(strips, "_computed", fails)
    found = plan(project, CARD, strain=PLANNED_ENDS, progress=lambda *event: told.append(event))
    assert "fill strip" not in named(found)
    (failed,) = [note for note in found.notes if note.kind == FAILED]
    assert failed.of == "fill strip" and "no equilibrium" in failed
    assert [event[:2] for event in told] == [(k, len(told)) for k in range(len(told))]
    assert "fill strip" in [name for _, _, name in told]


#: MPa; not quite the optimum of test "one", which is at 330 and 190.
PROFILED = MaterialCard(HypoelasticLaw.linear(328.0, 190.5, 10.0, 0.0), 0.8, "near")


def test_a_linear_modulus_has_the_ends_of_its_sigma(project):
    """A load is linear in a constant modulus: -2 log L is a parabola, and nothing is curved."""
    told, strain = [], STRAIN["one"]
    found = profile(project, {"E1": [0.05], "E2": [0.0]}, PROFILED, "one",
                    progress=lambda *event: told.append(event))  # fmt: skip
    for one, direction in zip(found.profiles, ("warp", "fill"), strict=True):
        best = np.mean(STRIP_MODULI["one"][direction])
        off = np.concatenate([20 * (m - best) * strain for m in STRIP_MODULI["one"][direction]])
        scatter = project.tests["one"].strips[direction].scatter
        noise = max(float(np.sqrt(np.mean(off**2))), scatter)
        sigma = noise / np.sqrt(np.mean((20 * strain) ** 2))
        assert one.best == pytest.approx(best, rel=1e-5)
        assert one.sigma == pytest.approx(sigma, rel=5e-3)
        away = np.sqrt(THRESHOLD) * sigma
        assert one.ends == pytest.approx((best - away, best + away), rel=1e-4)
        values, ratios = (np.array(v) for v in one.curve)
        assert (np.diff(values) > 0).all() and len(values) >= 7
        np.testing.assert_allclose(ratios, ((values - best) / sigma) ** 2, atol=0.01)
        assert one.asymmetry == pytest.approx(1.0, abs=1e-3) and "asymmetric" not in one.words
        # Four places and no refits: one analysis each, at a linear problem.
        assert one.analyses <= 2 * len(values)
    assert not found.notes  # the card's moduli are near the optimum's
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    assert told[-1][:2] == (4, 4) and "E1 at 0.05" in {name for _, _, name in told}
    far = replace(PROFILED, law=HypoelasticLaw.linear(360.0, 190.0, 10.0, 0.0))
    found = profile(project, {"G12": []}, far, "one")
    (one,) = found.profiles
    assert one.ends == (None, None) and one.numbers["lower_MPa"] is None
    assert one.lower_side.reason == one.upper_side.reason == BOUND
    assert one.allowed == pytest.approx((5.0, 200.0), rel=1e-6)
    assert [one.lower_side.values[-1], one.upper_side.values[-1]] == pytest.approx(
        [5.0, 200.0], rel=1e-6
    )
    assert [note.kind for note in found.notes] == [NOT_THE_CARD, NOT_CLOSED, NOT_CLOSED]
    assert "moved E1 by -8.3 %" in found.notes[0] and "5 MPa" in found.notes[1]


def test_words_of_what_is_uneven():
    below = ProfileSide((10.0, 9.0, 8.0), (0.0, 1.0, 4.0), "", 2)
    above = ProfileSide((10.0, 12.0, 14.0), (0.0, 1.0, 4.0), "", 2)
    numbers = ([number] for number in (0.02, 10.0, 8.0, 12.0, 0.1, False, False))
    reported = ReportedModulus(*map(np.array, numbers))
    one = Profile("G12", 0.02, reported, below, above, (1.0, 99.0))
    assert "(the fit's band 8 to 12)" in one.words
    root = np.sqrt(THRESHOLD)
    assert one.ends == pytest.approx((10 - root, 10 + 2 * root), rel=0.01)
    assert one.asymmetry == pytest.approx(2.0)
    assert one.words.endswith("; asymmetric: 1.96 below, 3.92 above")
    better = replace(one, upper_side=ProfileSide((10.0, 12.0), (0.0, -3.0), "bound", 2))
    assert {note.kind for note in better.notes} == {NOT_THE_CARD, NOT_CLOSED}


VARIED = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
END, NAN = "load at the end, N", np.nan


def test_ratios_leave_out_what_failed():
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


def test_a_bar_in_closed_form(bars, tmp_path, drawn):
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


def test_a_value_that_fails_is_named(bars):
    bars.law_fails = lambda law: law.nu12 > 0.4
    project = project_of(BarTest("a bar"))
    study = vary_nu12(project, VARIED, [0.2, 0.45])
    assert study.result["models"]["a bar"]["responses"][END]["to_base"][-1] is None
    raised(SolverFailure, "", vary_nu12, project, VARIED, [0.45])
    with pytest.raises(SolverFailure):  # the card as it is
        vary_nu12(project, replace(VARIED, law=replace(VARIED.law, nu12=0.41)))


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


def test_moduli_and_errors_follow_the_weight(tmp_path):
    constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5"))
    command = ("validate", "project.toml", "--weights", "two", "--starts", "1", "--quiet")
    done = in_process(*command, "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "weights.csv")
    assert table["weight_times"].to_list() == pytest.approx(COUNTS)
    (column,) = {name for name in table if name.startswith("E1_MPa at 0.0")} - {"E1_MPa at 0"}
    expected = [best_warp(1, 0.5 * count) for count in COUNTS]
    assert expected[-1] - expected[0] > 25
    assert table[column].to_numpy() == pytest.approx(expected, rel=2e-4)
    for test in ("one", "two"):
        errors = np.array([relative_error(test, "warp", e) for e in expected])
        if test == "one":
            errors = (errors + relative_error("one", "fill", 190.0)) / 2
        assert table[f"relative {test}"].to_numpy() == pytest.approx(errors, rel=1e-3)
    said = json.loads((tmp_path / "out" / "result.json").read_text())
    own = expected[len(COUNTS) // 2]
    change = [min(expected) / own - 1, max(expected) / own - 1]
    assert said["change"]["E1"] == pytest.approx(change, abs=1e-3)
    assert said["change"]["E2"] == pytest.approx([0, 0], abs=1e-4)
    assert f"E1 changes by {100 * change[0]:+.2g} to {100 * change[1]:+.2g} %" in done.output
    charts = charts_of(tmp_path / "out")
    for series in charts["errors"][0].series:
        assert series.x == pytest.approx(COUNTS, rel=1e-5)
        assert series.y == pytest.approx(100 * table[f"relative {series.name}"], rel=1e-5)
    name = f"at {100 * float(column[10:]):.3g} %"
    (warp,) = (s for s in charts["moduli"][0].series if s.name == name)
    assert warp.y == pytest.approx(table[column], rel=1e-5)


def test_a_study_of_weights_goes_on_where_it_was(project, tmp_path, monkeypatch):
    whole, asked = study_of.refit, []

    def counting(found, names, count, y):
        asked.append(count)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return whole(found, names, count, y)

    monkeypatch.setattr(study_of, "refit", counting)
    given = {"starts": 1, "counts": (0.5, 1, 2, 4), "out": tmp_path / "out"}
    raised(KeyboardInterrupt, "", weights, project, "two", **given)
    study = weights(project, "two", **given, resume=True)
    assert asked == [2, 4, 4, 0.5]
    assert [run.count for run in study.runs] == [0.5, 1, 2, 4]
    assert all(run.analyses < 20 for run in study.runs)  # from the optimum beside it
    with pytest.raises(InputError, match=r"run\.json: parts: .*another counted"):
        weights(project, "one", **given, resume=True)


OTHER_FORM = MaterialCard(HypoelasticLaw(np.ones(12)), 0.8, "cubic")
OVER = {"over": "specimens", "card": CARD, "tests": "one"}
BAD = [
    (bootstrap, OVER | {"over": "frames"}, "--over: .* frames"),
    (bootstrap, OVER | {"over": "tests"}, "--over: .* two tests or more"),
    (bootstrap, OVER | {"samples": 1}, "samples: expected int of 2 or more, got 1"),
    (profile, {"card": PROFILED, "moduli": {"G23": []}}, "--modulus: .* E1, E2, G12, got 'G23'"),
    (profile, {"card": PROFILED, "moduli": {"E1": [-0.1]}}, "--modulus: .* got -0.1"),
    (profile, {"card": PROFILED, "moduli": {"E1": [0.3]}}, "E1 .* up to a strain of 0.12; got 0.3"),
    (profile, {"card": OTHER_FORM}, "of this project's"), (profile, {"card": None}, "fit first"),
    (plan, {"card": CARD, "rank": "G23"}, "--rank: .* worst, E1, E2, G12, got 'G23'"),
    (plan, {"card": CARD, "noise": {"strips": 0.0}}, "--noise: .* above 0, KIND of: "),
    (plan, {"card": CARD, "noise": {"torsion": 1.0}}, "--noise: .* got torsion=1"),
    (plan, {"card": CARD, "strain": (0.1, 0.1)}, "--strain: "),
    (plan, {"card": CARD, "strain": (0.1, 0.0, 0.1)}, "--strain: "),
    (plan, {"card": None}, "fit first"), (vary_nu12, {"card": CARD, "values": [-1e-9]}, "--nu12"),
    (vary_nu12, {"card": CARD, "values": [1.0]}, "--nu12"),
    (weights, {"counted": "strips"}, r"--weights: .* strips, one, two; got"),
    (weights, {"counted": "three"}, r"--weights: .* strips, one, two; got"),
]  # fmt: skip


@pytest.mark.parametrize(("study", "given", "said"), BAD)
def test_what_cannot_be_meant(project, study, given, said):
    raised(InputError, said, study, project, **given)
