"""Bootstrap over specimens, tests and frames: closed forms, what is kept, written and said."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, Note, OutputError, SolverFailure
from bubblefit.inference.assessment import uncertainty_from
from bubblefit.inference.likelihood import BOUND, THRESHOLD, Side
from bubblefit.inference.noise import Noise
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.reports.html import percent
from bubblefit.runs import bootstrap as module
from bubblefit.runs import plan as plan_module
from bubblefit.runs import weights as study_of
from bubblefit.runs.best import NOT_THE_CARD
from bubblefit.runs.bootstrap import FEW_UNITS, MOST, Bootstrap, bootstrap
from bubblefit.runs.plan import NOW, Plan, Present, Prospect, plan
from bubblefit.runs.poisson import Nu12Study, PartRatios, by_response, ratios, vary_nu12
from bubblefit.runs.profile import NOT_CLOSED, Profile, profile
from bubblefit.runs.result import Fit
from bubblefit.runs.simulation import FAILED
from bubblefit.runs.weights import COUNTS, weight_study
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.optimize import minimize_scalar

from ..bars import STRETCH, BarTest, project_of
from ..commands import in_process
from ..drawings import data
from ..page_charts import charts_of
from ..projects import BUBBLE, ELONGATION, MODULI, constant_strips, project_file, small
from ..published_laws import TABLE_4_2

# Packages of kinds have functions of the same names.
bubbles = import_module("bubblefit.experiments.bubble.candidates")
strips = import_module("bubblefit.experiments.strips.candidates")
#: MPa, near the optima of the tests.
CARD = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "near")
ENDS = {"one": 2.9, "two": 2.5}


def moduli(done: Bootstrap, name: str) -> np.ndarray:
    """(samples,) MPa at rest."""
    return np.array(done.moduli[name][:, 0])


def test_specimens_drawn_again(tmp_path):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    done = bootstrap(project, "specimens", 8, CARD, "one")
    assert [g.name for g in done.groups] == ["one: warp", "one: fill"]
    assert [u.name for u in done.groups[0].units] == [
        "one: warp, specimen a", "one: warp, specimen b"
    ]  # fmt: skip
    for k, (name, direction) in enumerate((("E1", "warp"), ("E2", "fill"))):
        counts = np.array([sample.counts[k] for sample in done.samples])
        assert (counts.sum(axis=1) == 2).all() and len({*counts[:, 0].tolist()}) > 1
        expected = counts @ np.array(MODULI["one"][direction]) / 2
        np.testing.assert_allclose(moduli(done, name), expected, rtol=1e-4)
        own, _ = done.sigma[name]
        assert own == pytest.approx(expected.std(ddof=1) / moduli_of_fit(name), rel=1e-3)
        low, high = np.quantile(expected, [0.025, 0.975])
        np.testing.assert_allclose(done.bands[name][:, 0], [low, high], rtol=1e-4)
    assert all(1 <= s.analyses <= MOST or s.counts == [[1, 1], [1, 1]] for s in done.samples)
    assert done.analyses == done.before + sum(s.analyses for s in done.samples)
    # Two specimens and eight samples are few.
    assert [(n.kind, n.of) for n in done.notes] == [
        (FEW_UNITS, "one: warp"), (FEW_UNITS, "one: fill"),
        (FEW_UNITS, ""),
    ]  # fmt: skip
    correlations = done.coefficients()
    assert correlations["unknown"].to_list() == ["beta_3", "beta_7", "beta_11"]
    both = correlations["beta_7"].to_list()[1:]
    assert both == pytest.approx([1.0, np.corrcoef(moduli(done, "E1"), moduli(done, "E2"))[0, 1]])


def moduli_of_fit(name: str) -> float:
    return {"E1": 330.0, "E2": 190.0}[name]


def relative_error(test: str, direction: str, modulus: float) -> float:
    """RMS error of a constant modulus (MPa) over the largest load."""
    strain = np.log1p(ELONGATION[ELONGATION <= ENDS[test]] / 20)
    loads = np.array([20 * e * strain for e in MODULI[test][direction]])
    return float(np.sqrt(np.mean((20 * modulus * strain - loads) ** 2)) / loads.max())


def test_tests_drawn_again(tmp_path):
    project = read_project(constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5")))
    done = bootstrap(project.with_fit(jobs=1, seed=3), "tests", 6, CARD)
    (group,) = done.groups
    assert (group.name, [u.name for u in group.units]) == ("strips", ["one", "two"])
    seen = set()
    for sample, found in zip(done.samples, moduli(done, "E1"), strict=True):
        (counts,) = sample.counts
        seen.add(tuple(counts))

        def total(modulus, one=counts[0], two=counts[1]):
            own = one * relative_error("one", "warp", modulus) / 2
            return own + 0.5 * two * relative_error("two", "warp", modulus)

        best = minimize_scalar(total, bounds=(200, 500), method="bounded")
        assert found == pytest.approx(best.x, rel=1e-3)
    assert seen == {(2, 0), (1, 1), (0, 2)}


def test_frames_drawn_again(tmp_path):
    text = BUBBLE.replace("pressures = [22, 59]", "pressures = [22, 40, 59]")
    project = read_project(project_file(tmp_path, text)).with_fit(jobs=1)
    law = HypoelasticLaw.linear(790.0, 395.0, 85.0, 0.24)
    card = MaterialCard(law, 0.81, "near")
    found = module.find_optimum(project, card, None)
    (group,) = module.groups_of(found, "frames")
    assert [u.name.split(": ")[-1] for u in group.units] == ["22 kPa", "40 kPa", "59 kPa"]
    problem = found.problem
    norms = problem.blocks.norms(found.point.residual).reshape(3, 3).sum(axis=1)
    factors = module.factors_of(problem, [group], [[2, 0, 1]])
    weighted = problem.blocks.value(factors * found.point.residual)
    assert weighted == pytest.approx(2 * norms[0] + norms[2])
    # As a fit to the rest has it, which is not given the frame at all.
    setup = found.setup
    (part,) = [p for p in module.parts_of(setup, "frames") if p.name == "40 kPa"]
    y = problem.unknowns.at(np.array([80.0, 390.0, 790.0]))
    rest = setup.problem(part.masks).evaluate(y, False)
    whole = problem.evaluate(y, False)
    factors = module.factors_of(problem, [group], [[1, 0, 1]])
    assert problem.blocks.value(factors * whole.residual) == pytest.approx(rest.value, rel=1e-6)


def test_a_bootstrap_goes_on_where_it_was(tmp_path, monkeypatch):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    whole = bootstrap(project, "specimens", 4, CARD, "one")
    write = module.StudyRecord.write

    def stops(record, sample):
        write(record, sample)
        if len(record.rows) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(module.StudyRecord, "write", stops)
    with pytest.raises(KeyboardInterrupt):
        bootstrap(project, "specimens", 4, CARD, "one", out=tmp_path / "out")
    fitted: list[int] = []

    def counts(record, sample):
        fitted.append(sample.number)
        write(record, sample)

    monkeypatch.setattr(module.StudyRecord, "write", counts)
    with pytest.raises(OutputError, match="already holds results"):
        bootstrap(project, "specimens", 4, CARD, "one", out=tmp_path / "out")
    given = {"card": CARD, "tests": "one", "out": tmp_path / "out", "resume": True}
    done = bootstrap(project, "specimens", 4, **given)
    assert fitted == [2, 3]
    assert [s.counts for s in done.samples] == [s.counts for s in whole.samples]
    np.testing.assert_allclose(done.unknowns, whole.unknowns, rtol=1e-6)
    # Samples of other draws are others.
    bootstrap(project, "specimens", 2, **given, seed=8)
    assert fitted == [2, 3, 0, 1]


def test_values_of_no_known_part(tmp_path):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    problem = module.find_optimum(project, CARD, "one").problem
    (warp, _) = problem.comparisons
    warp.objective = SimpleNamespace(sizes=warp.objective.sizes)
    with pytest.raises(InputError, match="--over: one: warp does not tell which"):
        module.rows_of(problem, {"one: warp": np.ones(22, dtype=bool)})


def test_the_command(tmp_path):
    constant_strips(tmp_path)
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(CARD, tmp_path / "out" / tmp_path.name / "material.toml")
    command = ("bootstrap", "project.toml", "--over", "specimens", "--samples", "5",
               "--test", "one", "--out", "there", "--jobs", "2", "--seed", "4")  # fmt: skip
    done = in_process(*command, "--quiet", cwd=tmp_path)
    folder = tmp_path / "there"
    said = json.loads((folder / "result.json").read_text())
    assert (said["samples"], said["over"], said["seed"]) == (5, "specimens", 4)
    assert said["groups"]["one: fill"] == ["one: fill, specimen a", "one: fill, specimen b"]
    assert f"; {said['analyses']} analyses" in done.output
    sigma = f"E1 {percent(said['sigma_relative']['E1'])} (fit "
    page = (folder / "report.html").read_text()
    assert sigma in done.output and sigma[:-6] in page
    table = pd.read_csv(folder / "bootstrap.csv")
    own = table[(table["modulus"] == "E1")]
    assert (own["lower_MPa"] <= own["median_MPa"]).all()
    assert own["sigma_relative"].iloc[0] == pytest.approx(said["sigma_relative"]["E1"], rel=1e-6)
    _, low, high = charts_of(folder)["bootstrap"][0].series
    assert low.y == pytest.approx(own["lower_MPa"], rel=1e-5)
    assert high.y == pytest.approx(own["upper_MPa"], rel=1e-5)
    assert (folder / "bootstrap.png").stat().st_size > 10_000
    assert len(pd.read_csv(folder / "coefficients.csv")) == 3
    assert {row["kind"] for row in said["notes"]} == {"few to draw from"}


ENDS_PLAN = (0.1, 0.1, 0.05)
#: MPa; without contraction loads of strips along the yarns are 20 mm^2 E ln(1 + u/20).
PLANNED = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "linear")
STRAIN = np.log1p(ELONGATION / 20)


@pytest.fixture
def few(monkeypatch):
    """Coarse models of candidates."""
    monkeypatch.setattr(bubbles, "ELEMENTS", 32)
    monkeypatch.setattr(bubbles, "ANGLES", ())
    monkeypatch.setattr(strips, "ANGLES", ())
    monkeypatch.setattr(strips, "INCREMENTS", 4)


def known(made: Plan) -> dict[str, Prospect]:
    return {planned.name: planned for planned in made.candidates}


def test_strips_of_constant_moduli(tmp_path, few, monkeypatch):
    monkeypatch.setattr(bubbles, "ANGLES", (45.0,))
    project = read_project(constant_strips(tmp_path))
    made = plan(project, PLANNED, strain=ENDS_PLAN)
    one = np.tile(STRAIN[ELONGATION <= 2.9], 2)
    two = np.tile(STRAIN[ELONGATION <= 2.5], 2)

    def spread(loads, strain, law):
        """RMS of two specimens about a law: the noise that a fit reckons with."""
        half = len(strain) // 2
        off = np.concatenate([20 * (m - law) * strain[:half] for m in loads])
        return float(np.sqrt(np.mean(off**2)))

    scatter = [project.tests[name].strips["warp"].scatter for name in ("one", "two")]
    noise = [
        max(spread((300.0, 360.0), one, 330.0), scatter[0]),
        max(spread((330.0, 410.0), two, 330.0), scatter[1]),
    ]
    # The loads of a specimen count as one; one of two is taken up by their mean.
    each = [np.mean((20 * s) ** 2) / n**2 for s, n in zip((one, two), noise, strict=True)]
    assert made.now.summary["E1"] == pytest.approx(sum(each) ** -0.5 / 330, rel=2e-3)
    assert made.now.summary["G12"] == pytest.approx(10.0)  # nothing is known of it
    # Three more specimens as those of the first test, of which there are two.
    more = known(made)["warp strip"]
    assert more.specimens == 3
    levels = np.log1p(2.9 * np.arange(1, 5) / 4 / 20)
    value = noise[0] * np.sqrt(2 * len(levels))
    added = 3 * np.sum((20 * levels) ** 2) / value**2
    assert more.summary["E1"] == pytest.approx((sum(each) + added) ** -0.5 / 330, rel=2e-3)
    assert more.summary["E2"] == pytest.approx(made.now.summary["E2"], rel=1e-9)
    assert more.noise == f"{value:.3g} N at 4 values (that of one)"
    # Only what shears the sheet says anything of G12.
    sheared = [p.name for p in made.candidates if p.summary["G12"] < 1]
    assert set(sheared) == {"strip at 45 degrees", "bubble, elliptic rim at 45 degrees"} | {
        p.name for p in made.candidates if p.name.startswith("bubble") and p.summary["G12"] < 1
    }
    worst = [max(p.summary.values()) for p in made.candidates]
    assert worst == sorted(worst)
    assert made.candidates[0].name in sheared
    # By E1 alone a strip across the yarns is no good.
    by_warp = plan(project, PLANNED, strain=ENDS_PLAN, rank="E1")
    values = [p.summary["E1"] for p in by_warp.candidates]
    assert values == sorted(values) and by_warp.criterion.startswith("1 sigma of E1,")
    following = by_warp.following
    assert following is not None and following.summary["E1"] < values[0]


def test_a_test_made_again_halves_the_variance(tmp_path, few):
    # So little noise that what is known before any test does not count.
    project = read_project(small(tmp_path, ('objective = "e"', 'objective = "e"\nnoise = 1e-3')))
    made = plan(project, bubble_card())
    again = known(made)["the same bubble again"]
    for name in ("E1", "E2"):
        ratio = again.summary[name] / made.now.summary[name]
        assert ratio == pytest.approx(0.5**0.5, rel=1e-3)
    # Twice noisier values of the new bubble alone: 1 + 1/4 of what is known now.
    noisy = plan(project, bubble_card(), noise={"bubble": 2e-3})
    ratio = known(noisy)["the same bubble again"].summary["E1"] / noisy.now.summary["E1"]
    assert ratio == pytest.approx(1.25**-0.5, rel=1e-3)
    assert "(given)" in known(noisy)["the same bubble again"].noise
    # Four specimens say as much as four tests.
    four = plan(project, bubble_card(), specimens=4)
    ratio = known(four)["the same bubble again"].summary["E2"] / four.now.summary["E2"]
    assert ratio == pytest.approx(0.2**0.5, rel=1e-3)


def bubble_card() -> MaterialCard:
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.1, 0.1, 0.08])
    return MaterialCard(law, 0.81, "Table 4.2")


def test_what_is_known_now_is_what_a_fit_says_its_tests_pin_down(tmp_path, few):
    path = small(tmp_path, ("displacement_offset = false", "displacement_offset = true"),
                 ("pressure_offset = false", "pressure_offset = true"))  # fmt: skip
    here: list[Present] = []
    original = plan_module.present_tests

    def remember(*given):
        here.append(original(*given))
        return here[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_module, "present_tests", remember)
        made = plan(read_project(path), bubble_card())
    present = here[0]
    noise = Noise.of(present.problem, present.point.residual).rows
    pinned = uncertainty_from(present.problem, present.point, present.law, made.ends, [0], noise)
    for name, sigma in made.now.sigma.items():
        np.testing.assert_allclose(sigma, pinned[name], rtol=1e-6)


def test_what_cannot_be_computed_is_left_out_and_named(tmp_path, few, monkeypatch):
    made = strips._made

    def fails(pull, *rest):
        if pull.direction == "fill":
            raise SolverFailure("no equilibrium", "membrane")
        return made(pull, *rest)

    monkeypatch.setattr(strips, "_made", fails)
    told: list[tuple[int, int, str]] = []
    found = plan(read_project(constant_strips(tmp_path)), PLANNED, strain=ENDS_PLAN,
                 progress=lambda *event: told.append(event))  # fmt: skip
    assert "fill strip" not in known(found)
    failed = [note for note in found.notes if note.kind == FAILED]
    assert [note.of for note in failed] == ["fill strip"] and "no equilibrium" in failed[0]
    assert [done for done, _, _ in told] == list(range(len(told)))
    assert {total for _, total, _ in told} == {len(told)}
    assert "fill strip" in [name for _, _, name in told]


def test_strains_at_which_moduli_are_asked_for(tmp_path, few):
    project = read_project(constant_strips(tmp_path))
    limited = replace(PLANNED, law=replace(PLANNED.law, strain_range=np.array([0.09, 0.2, 0.03])))
    # The card's valid range, but no further than the law of the project goes.
    np.testing.assert_allclose(plan(project, limited).ends, [0.09, 0.14, 0.03])
    # A card without one: as far as the present tests are strained.
    reached = plan(project, PLANNED).ends
    np.testing.assert_allclose(reached[:2], np.log([22.9 / 20] * 2), rtol=1e-3)
    for strain in ((0.1, 0.1), (0.1, 0.0, 0.1)):
        with pytest.raises(InputError, match="--strain: expected three strains above 0"):
            plan(project, PLANNED, strain=strain)


def test_the_command_plan(tmp_path, few):
    constant_strips(tmp_path)
    with_range = replace(PLANNED, law=replace(PLANNED.law, strain_range=np.array(ENDS_PLAN)))
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(with_range, tmp_path / "out" / tmp_path.name / "material.toml")
    done = in_process("plan", "project.toml", "--out", "plan", cwd=tmp_path)
    result = json.loads((tmp_path / "plan" / "result.json").read_text())
    table = pd.read_csv(tmp_path / "plan" / "plan.csv")
    assert result["card"] == "of the fit" and result["tests"] == ["one", "two"]
    assert table["test"].tolist() == [NOW, *(c["test"] for c in result["candidates"])]
    assert table["rank"].tolist() == list(range(len(table)))
    first = result["candidates"][0]
    assert table.loc[1, "sigma_G12"] == pytest.approx(first["sigma"]["G12"], rel=1e-5)
    assert table.loc[1, "sigma_E1_at_0.1"] == pytest.approx(first["sigma_at"]["E1"][2], rel=1e-5)
    assert result["now"]["unknown"] == ["G12"]
    said = done.output.splitlines()
    now = next(line for line in said if line.split()[:1] == [NOW])
    assert now.split()[-1] == "unknown"
    assert next(line for line in said if line.startswith(" 1. ")).split()[1] in first["test"]
    assert any(line.startswith("Assumed:") for line in said)
    page = (tmp_path / "plan" / "report.html").read_text()
    assert first["test"] in page and "unknown" in page
    (chart,) = charts_of(tmp_path / "plan")["plan"]
    assert chart.x_names[0] == "the present tests alone"
    for rank, (own, one) in enumerate(zip(chart.x_names[1:], result["candidates"], strict=True), 1):
        assert own.startswith(f"{rank}. {one['test']}")
    for series in chart.series:
        if series.name.endswith(", not known"):
            assert set(series.y) == {100.0}
            continue
        own = 100 * table[f"sigma_{series.name}"].to_numpy()
        assert series.y == [pytest.approx(v, rel=1e-4) if v < 100 else None for v in own]
    assert "Assumed:" in page
    again = in_process("plan", "project.toml", "--out", "plan", cwd=tmp_path, code=2)
    assert "already holds a result" in again.output
    bad = in_process("plan", "project.toml", "--noise", "strips", "--out", "p", cwd=tmp_path,
                     code=2)  # fmt: skip
    assert "--noise: expected KIND=VALUE, such as strips=20" in bad.output


#: MPa; not quite the optimum of test "one", which is at 330 and 190.
PROFILED = MaterialCard(HypoelasticLaw.linear(328.0, 190.5, 10.0, 0.0), 0.8, "near")
STRAIN_PROFILE = np.log1p(ELONGATION[ELONGATION <= 2.9] / 20)


def sigma_of(specimens: tuple[float, float], scatter: float) -> float:
    """One standard deviation (MPa) of the mean modulus of two specimens, from their loads."""
    best = np.mean(specimens)
    off = np.concatenate([20 * (m - best) * STRAIN_PROFILE for m in specimens])
    noise = max(float(np.sqrt(np.mean(off**2))), scatter)
    return float(noise / np.sqrt(np.mean((20 * STRAIN_PROFILE) ** 2)))


def test_a_linear_modulus_has_the_ends_of_its_sigma(tmp_path):
    """A load is linear in a constant modulus: -2 log L is a parabola, and nothing is curved."""
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    told: list[tuple[int, int, str]] = []
    found = profile(project, {"E1": [0.05], "E2": [0.0]}, PROFILED, "one",
                    progress=lambda *event: told.append(event))  # fmt: skip
    strips = project.tests["one"].strips
    for one, specimens, direction in zip(
        found.each, ((300.0, 360.0), (200.0, 180.0)), ("warp", "fill"), strict=True
    ):
        best, sigma = np.mean(specimens), sigma_of(specimens, strips[direction].scatter)
        assert one.best == pytest.approx(best, rel=1e-5)
        assert one.sigma == pytest.approx(sigma, rel=1e-3)
        away = np.sqrt(THRESHOLD) * sigma
        assert one.ends == pytest.approx((best - away, best + away), rel=1e-4)
        values, ratios = (np.array(v) for v in one.curve)
        assert (np.diff(values) > 0).all() and len(values) >= 7
        np.testing.assert_allclose(ratios, ((values - best) / sigma) ** 2, atol=0.01)
        assert one.asymmetry == pytest.approx(1.0, abs=1e-3) and "asymmetric" not in one.words
        # Four places and no refits: one analysis each, at a linear problem.
        assert one.analyses <= 2 * len(values)
    # The card's moduli are not the optimum's, but near them.
    assert not found.notes
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    assert told[-1][:2] == (4, 4) and "E1 at 0.05" in {name for _, _, name in told}


def test_what_no_test_knows_is_not_closed(tmp_path):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    far = replace(PROFILED, law=HypoelasticLaw.linear(360.0, 190.0, 10.0, 0.0))
    found = profile(project, {"G12": []}, far, "one")
    (one,) = found.each
    assert one.ends == (None, None) and one.numbers["lower_MPa"] is None
    assert one.below.why == one.above.why == BOUND
    assert one.allowed == pytest.approx((5.0, 200.0), rel=1e-6)
    assert [one.below.values[-1], one.above.values[-1]] == pytest.approx([5.0, 200.0], rel=1e-6)
    kinds = [note.kind for note in found.notes]
    assert kinds == [NOT_THE_CARD, NOT_CLOSED, NOT_CLOSED]
    assert "moved E1 by -8.3 %" in found.notes[0]
    assert "5 MPa" in found.notes[1]


def test_words_of_what_is_uneven():
    below = Side((10.0, 9.0, 8.0), (0.0, 1.0, 4.0), "", 2)
    above = Side((10.0, 12.0, 14.0), (0.0, 1.0, 4.0), "", 2)
    one = Profile("G12", 0.02, 10.0, 1.0, (8.0, 12.0), below, above, (1.0, 99.0))
    root = np.sqrt(THRESHOLD)
    assert one.ends == pytest.approx((10 - root, 10 + 2 * root), rel=0.01)
    assert one.asymmetry == pytest.approx(2.0)
    assert one.words.endswith("; asymmetric: 1.96 below, 3.92 above")
    better = replace(one, above=Side((10.0, 12.0), (0.0, -3.0), "bound", 2))
    kinds = {note.kind: str(note) for note in better.notes}
    assert "another optimum fits the data better" in kinds[NOT_THE_CARD]
    assert kinds[NOT_CLOSED].startswith("not closed above")


def test_the_command_profile(tmp_path):
    constant_strips(tmp_path)
    (tmp_path / "out" / tmp_path.name).mkdir(parents=True)
    write_card(PROFILED, tmp_path / "out" / tmp_path.name / "material.toml")
    command = ("profile", "project.toml", "--modulus", "E1", "--modulus", "E2=0.02,0.1",
               "--strain", "0.04", "--test", "one", "--out", "there")  # fmt: skip
    done = in_process(*command, "--quiet", "--jobs", "2", cwd=tmp_path)
    folder = tmp_path / "there"
    said = json.loads((folder / "result.json").read_text())
    names = [(one["modulus"], one["strain"]) for one in said["profiles"]]
    assert names == [("E1", 0.04), ("E2", 0.02), ("E2", 0.1)]
    table = pd.read_csv(folder / "profile.csv")
    first = said["profiles"][0]
    own = table[(table["modulus"] == "E1") & (table["strain"] == 0.04)]
    np.testing.assert_allclose(own["MPa"], first["curve_MPa"], rtol=1e-8)
    np.testing.assert_allclose(own["minus_2_log_L"], first["curve_minus_2_log_L"], rtol=1e-8)
    np.testing.assert_allclose(own["by_sigma"], own["minus_2_log_L"], atol=0.01)
    assert said["analyses"] > sum(one["analyses"] for one in said["profiles"])
    assert f"{said['analyses']} analyses" in done.output
    charts = charts_of(folder)["profiles"]
    assert len(charts) == 3 and charts[0].series[0].x == pytest.approx(own["MPa"], rel=1e-5)
    assert charts[0].series[0].y == pytest.approx(own["minus_2_log_L"], rel=1e-5, abs=1e-9)
    ends = [series.x[0] for series in charts[0].series if series.name == "ends"]
    assert ends == pytest.approx([first["lower_MPa"], first["upper_MPa"]], rel=1e-5)
    assert (folder / "profile.png").stat().st_size > 10_000
    refused = in_process(*command, "--quiet", cwd=tmp_path, code=2)
    assert "already holds a result" in refused.output + refused.stderr


VARIED = MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0), 0.5, "soft")
END = "load at the end, N"


def test_ratios_leave_out_what_failed():
    found = ratios([0.1, 0.2, 0.3], [2.0, np.nan, 4.0], 2.5)
    assert found.to_base == pytest.approx([0.8, np.nan, 1.6], nan_ok=True)
    assert found.to_mean == pytest.approx([2 / 3, np.nan, 4 / 3], nan_ok=True)
    assert found.spread == pytest.approx((-0.2, 0.6))
    assert np.isnan(ratios([0.1], [np.nan], 1.0).spread).all()
    named = by_response([0.1, 0.2], [{"a": 1.0}, None], {"a": 2.0})
    assert named["a"].to_base == pytest.approx([0.5, np.nan], nan_ok=True)
    early = by_response([0.1, 0.2], [{"a": 1.0}, {"a": 2.0, "b": 1.0}], {"a": 2.0, "b": 4.0})
    assert early["b"].to_base == pytest.approx([np.nan, 0.25], nan_ok=True)


def test_a_bar_in_closed_form(bars, tmp_path, drawn):
    study = vary_nu12(project_of(BarTest("a bar")), VARIED, [0.4, 0.0, 0.4])
    found = study.parts["a bar"].responses[END]
    assert found.nu12.tolist() == [0.0, 0.4] and study.base == 0.24
    eps = np.log1p(STRETCH)
    assert found.to_base == pytest.approx(np.exp(-(found.nu12 - 0.24) * eps), rel=1e-9)
    study.write(tmp_path)
    table = pd.read_csv(tmp_path / "nu12.csv")
    pd.testing.assert_frame_equal(table, study.table())
    text = (tmp_path / "result.json").read_text()
    assert text == json.dumps(study.result, indent=1) + "\n"
    assert (tmp_path / "nu12.png").exists()
    shown, base = data(drawn[0].charts[0])
    np.testing.assert_allclose(shown, [found.nu12, found.to_base], rtol=1e-5)
    assert base.ravel().tolist() == [0.24, 1.0]
    (chart,) = charts_of(tmp_path)["nu12"]
    assert chart.series[0].x == found.nu12.tolist() and chart.series[0].name == END
    assert chart.series[0].y == pytest.approx(found.to_base, rel=1e-5)
    assert any(line.startswith(f"a bar, {END}") for line in study.lines())


def test_a_value_that_fails_is_named(bars):
    bars.law_fails = lambda law: law.nu12 > 0.4
    study = vary_nu12(project_of(BarTest("a bar")), VARIED)
    assert study.parts["a bar"].failed == {"0.45": "the bar breaks"}
    assert study.result["models"]["a bar"]["responses"][END]["to_base"][-1] is None
    assert "note: a bar, nu12 = 0.45: the bar breaks" in study.lines()
    with pytest.raises(SolverFailure):
        vary_nu12(project_of(BarTest("a bar")), VARIED, [0.45])
    with pytest.raises(SolverFailure):  # the card as it is
        vary_nu12(project_of(BarTest("a bar")), replace(VARIED, law=replace(VARIED.law, nu12=0.41)))


def test_a_straight_strip_in_closed_form():
    """Constant thickness: the width follows nu12, so the load falls with exp(-nu12 eps)."""
    model = straight_strip("warp", 20.0, 22.0, 0.8, increments=20)

    def load(nu12):
        law = HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=nu12)
        return float(MembraneSolver().run(model, law).load[-1])

    found = ratios([0.0, 0.4], [load(0.0), load(0.4)], load(0.24))
    eps = np.log(1.1)
    assert found.to_base == pytest.approx(np.exp(-(found.nu12 - 0.24) * eps), rel=1e-6)


def test_all_that_is_told_of_the_responses():
    nu12 = [0.05, 0.45]
    responses = {
        "a, N": ratios(nu12, [4.4, 3.6], 4.0),
        "long, N": ratios(nu12, [9.0, np.nan], 10.0),
    }
    note = Note(FAILED, "breaks", "nu12 = 0.45")
    part = PartRatios("load", responses, {"0.45": "breaks"}, [note])
    study = Nu12Study(Path("a.toml"), "soft", "bars", 0.24, {"bar": part})
    assert len(study.lines()) == 5 and "0.9000      nan" in study.lines()[3]
    table = study.table()
    assert list(table.columns) == ["model", "response", "nu12", "value", "to_base", "to_mean"]
    assert table["response"].tolist() == ["a, N", "a, N", "long, N", "long, N"]
    numbers = table[["nu12", "value", "to_base", "to_mean"]].to_numpy().ravel()
    assert numbers == pytest.approx(
        [0.05, 4.4, 1.1, 1.1, 0.45, 3.6, 0.9, 0.9, 0.05, 9.0, 0.9, 1.0, 0.45, *[np.nan] * 3],
        nan_ok=True,
    )
    result = study.result
    assert result["models"]["bar"]["failed"] == {"0.45": "breaks"}
    assert result["models"]["bar"]["responses"]["long, N"]["value"] == [9.0, None]
    assert (result["command"], result["base_nu12"], result["response"]) == (
        "study nu12", 0.24, "load"
    )  # fmt: skip
    other = Nu12Study(
        Path("a"), "soft", "bars", 0.24, {"x": part, "y": replace(part, response="rise")}
    )
    assert other.response == "load or rise"


@pytest.mark.parametrize("value", [0.0, 0.999])
def test_all_of_the_range_of_nu12_can_be_asked_for(bars, value):
    study = vary_nu12(project_of(BarTest("a bar")), VARIED, [value])
    assert study.parts["a bar"].responses[END].nu12.tolist() == [value]
    for wrong in (-1e-9, 1.0, 1.5):
        with pytest.raises(InputError, match="--nu12"):
            vary_nu12(project_of(BarTest("a bar")), VARIED, [wrong])


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    """The page of the fit is no matter here, and takes most of the time."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))


def best_warp(weight: float) -> float:
    """E1 (MPa) that both tests together ask for: fill of "one" has half of its weight."""

    def total(modulus: float) -> float:
        own = relative_error("one", "warp", modulus) / 2
        return own + weight * relative_error("two", "warp", modulus)

    found = minimize_scalar(total, bounds=(200, 500), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


def test_moduli_and_errors_follow_the_weight(tmp_path):
    """E1 at every weight of "two", whose weight in the project is 3, and the error of each test."""
    constant_strips(tmp_path, ("weight = 3.0", "weight = 0.5"))
    command = ("validate", "project.toml", "--weights", "two", "--starts", "1", "--quiet")
    done = in_process(*command, "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "weights.csv")
    assert table["weight_times"].to_list() == pytest.approx(COUNTS)
    (column,) = {name for name in table if name.startswith("E1_MPa at 0.0")} - {"E1_MPa at 0"}
    expected = [best_warp(0.5 * count) for count in COUNTS]
    # It matters: from near the mean of one to near the mean of the other.
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
    (warp,) = (s for s in charts["moduli"][0].series if s.name == f"at {float(column[10:]):.3g}")
    assert warp.y == pytest.approx(table[column], rel=1e-5)
    assert (tmp_path / "out" / "weights.png").stat().st_size > 10_000


def test_a_study_of_weights_goes_on_where_it_was(tmp_path, monkeypatch):
    project = read_project(constant_strips(tmp_path))
    whole = study_of.refit
    asked: list[float] = []

    def counting(found, names, count, y):
        asked.append(count)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return whole(found, names, count, y)

    monkeypatch.setattr(study_of, "refit", counting)
    given = {"starts": 1, "counts": (0.5, 1, 2, 4), "out": tmp_path / "out"}
    with pytest.raises(KeyboardInterrupt):
        weight_study(project, "two", **given)
    study = weight_study(project, "two", **given, resume=True)
    assert asked == [2, 4, 4, 0.5]
    assert [run.count for run in study.runs] == [0.5, 1, 2, 4]
    assert all(run.analyses < 20 for run in study.runs)  # from the optimum beside it
    with pytest.raises(InputError, match=r"run\.json: parts: .*another counted"):
        weight_study(project, "one", **given, resume=True)


@pytest.mark.parametrize(
    ("study", "given", "said"),
    [
        (bootstrap, {"over": "frames"}, "--over: no test has two or more frames"),
        (
            bootstrap,
            {"over": "tests"},
            "--over: no kind of which the project has two tests or more",
        ),
        (bootstrap, {"samples": 1}, "--samples: expected two or more, got 1"),
        (profile, {"moduli": {"G23": []}}, "--modulus: expected one of E1, E2, G12, got 'G23'"),
        (profile, {"moduli": {"E1": [-0.1]}}, "--modulus: expected strains of 0 or more, got -0.1"),
        (profile, {"moduli": {"E1": [0.3]}}, "E1 is fitted up to strain 0.12; got 0.3"),
        (
            profile,
            {"card": MaterialCard(HypoelasticLaw(np.ones(12)), 0.8, "cubic")},
            "of this project's",
        ),
        (profile, {"card": None}, "fit first"),
        (plan, {"rank": "G23"}, "--rank: expected one of worst, E1, E2, G12, got 'G23'"),
        (plan, {"noise": {"strips": 0.0}}, "--noise: expected KIND=VALUE above 0, KIND of: "),
        (plan, {"noise": {"torsion": 1.0}}, "got torsion=1"),
        (plan, {"card": None}, "fit first"),
        (weight_study, {"counted": "strips"}, r"--weights: .* not of all: strips, one, two; got"),
        (weight_study, {"counted": "three"}, r"--weights: .* not of all: strips, one, two; got"),
    ],
)
def test_what_cannot_be_meant(tmp_path, study, given, said):
    project = read_project(constant_strips(tmp_path)).with_fit(jobs=1)
    usual = {
        bootstrap: {"over": "specimens", "card": CARD, "tests": "one"},
        profile: {"card": PROFILED},
        plan: {"card": PLANNED},
        weight_study: {},
    }
    with pytest.raises(InputError, match=said):
        study(project, **{**usual[study], **given})
