"""A fit from Python: the same result as the command, tables, interruption, several tests."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.sampling import Around, laws_around
from bubblefit.materials.card import CardCertainty, MaterialCard, read_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.reports.content import read_page_data
from bubblefit.reports.maps import Maps, Solid
from bubblefit.runs import best
from bubblefit.runs.best import best_fit, noise_of
from bubblefit.runs.certainty import with_certainty
from bubblefit.runs.law_setup import shared_unknowns
from bubblefit.runs.predictions import predict
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.starts import EvaluationRecord, StartRecord
from bubblefit.solvers import registry

from ..builders.bent_cylinders import STOPS, ClosedFormCylinder, write_cylinder_project
from ..builders.projects import constant_strips, fit_setup, known_bubble
from ..support.commands import in_process, result_in
from ..support.refusals import raised

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
def fitted(bubble):
    return bubble.fit


def test_one_objective_everywhere(fitted, bubble):
    said = result_in(bubble.out)
    assert said["objective"] == fitted.objective == fitted.best.point.value
    assert min(s["objective"] for s in said["starts"]) == fitted.objective
    assert f"objective {fitted.objective:.4g}" in fitted.card.source
    assert f"{fitted.objective:.3g}" in bubble.page
    assert fitted.starts()["objective"].min() == fitted.objective
    starts = [r for r in bubble.heard if isinstance(r, StartRecord)]
    analyses = sum(isinstance(r, EvaluationRecord) for r in bubble.heard)
    assert analyses == sum(s.analyses for s in starts) == fitted.result["analyses"]


def test_tables(fitted, bubble):
    moduli = fitted.moduli()
    sigma = ["sigma_relative", "noise_relative", "mesh_relative"]
    band = ["lower_MPa", "upper_MPa"]
    flags = ["at_lower_bound", "at_upper_bound", "determined"]
    assert list(moduli.columns) == ["modulus", "strain", "MPa", *band, *sigma, *flags]
    sure = fitted.best.certainty
    for name, reported in sure.moduli.items():
        own = moduli[moduli["modulus"] == name]
        for column, end in zip(band, reported.band, strict=True):
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
    for name, table in (("residuals", residuals), ("moduli", moduli)):
        assert len(pd.read_csv(bubble.out / f"{name}.csv")) == len(table)
    card = bf.read_card(bubble.out / "material.toml")
    assert card.law.beta == pytest.approx(fitted.law.beta)
    assert card.law.strain_range == pytest.approx(fitted.best.valid)
    said = result_in(bubble.out)["valid_strain"]["warp"]
    assert said == pytest.approx(card.law.strain_range[0])


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
        assert again.ranked[0].objective == pytest.approx(fitted.objective, abs=1e-9)


def maps_and_surface_say_what_the_table_says(fit, folder):
    """Of the first bubble: every value of the page beside residuals.csv and the history."""
    parts = list(read_page_data(folder).parts)
    (maps,) = [p for p in parts if isinstance(p, Maps) and p.name == "bubble 1 maps"]
    (solid,) = [p for p in parts if isinstance(p, Solid) and p.name == "bubble 1 bubble"]
    table = fit.residuals().query("test == 'bubble 1'")
    assert len(maps.panels) == 9 and sum(maps.counts) == len(table) // 3
    for panel in maps.panels:
        quantity, what = panel.name.split(", ")
        column = "difference" if "−" in what else {"known": "measured"}.get(what, what)
        own = table[table["quantity"] == quantity][column].to_numpy()
        np.testing.assert_allclose(panel.values.values, own, atol=0.51 * panel.values.step + 1e-9)
    history = fit.tests["bubble 1"].histories[0]
    heights = [float(u[:, 2].max()) for u in history.displacement]
    assert solid.points.values[..., 2].max(axis=1) == pytest.approx(heights, rel=1e-4)
    strain = {shade.name: shade.values.values for shade in solid.shades}
    most = 100 * history.strain_max[0]
    assert strain["strain along the warp ε1"].max() == pytest.approx(most, rel=0.1)
    # Pulled everywhere, and by no more than the law's stiffest tangent.
    stress, e1 = strain["stress along the warp σ1"], fit.law.modulus("E1", np.linspace(0, 0.1, 50))
    assert 0 < stress.min() and stress[-1].max() < 1.3 * e1.max() * history.strain_max.max()


def test_two_bubbles_with_offsets_of_their_own(tmp_path):
    fit = bf.fit(bf.read_project(known_bubble(tmp_path, ("[fit]", SECOND))), starts=1, jobs=1)
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


def test_derivatives_by_the_solver_or_a_surrogate(together):
    problem, known = together.setup.problem(), together.best.certainty
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is again.point and again.point.jacobian is not None
    assert again.certainty is None
    for name, sigma in with_certainty(together.setup, problem, again).certainty.sigma.items():
        np.testing.assert_allclose(sigma, known.sigma[name], rtol=1e-12)
    problem.surrogate = together.setup.problem()
    again = best_fit(problem, together.best.records, 0.0)
    assert again.point.jacobian is None
    assert again.differentiated is not None and again.differentiated.jacobian is not None
    assert with_certainty(together.setup, problem, again).certainty is not None
    problem.surrogate.evaluate = lambda *_, **__: None
    again = best_fit(problem, together.best.records, 0.0)
    assert again.differentiated is None
    assert with_certainty(together.setup, problem, again) is again


@pytest.mark.parametrize(("external", "tries"), [(True, 2), (False, 1)])
def test_another_program_gets_a_second_try(together, external, tries):
    problem = together.setup.problem()
    asked = []

    def fail(*_, **__):
        asked.append(True)
        problem.failure = "no licence"

    problem.evaluate = fail
    problem.solver.external = external
    said = "the best fit does not run again: no licence; its starts are kept, --resume goes on"
    raised(SolverFailure, said, best_fit, problem, together.best.records, 0.0)
    assert len(asked) == tries


@pytest.mark.parametrize(("off", "fails"), [(0.9, False), (1.1, True), (-0.9, False), (-1.1, True)])
def test_what_counts_as_the_same_objective(together, off, fails):
    problem, first = together.setup.problem(), together.best.ranked[0]
    noise = noise_of(problem)
    assert first.objective is not None
    limit = 1e-5 * first.objective + 1e-6 * sum(noise.values())
    other = replace(first, objective=first.objective + off * limit)
    if fails:
        with pytest.raises(SolverFailure, match="start 0 ended with an objective of"):
            best_fit(problem, [replace(other, number=0)], 0.0)
    else:
        assert best_fit(problem, [other], 0.0).ranked[0].objective == first.objective


def test_noise_is_what_a_perfect_law_leaves(together):
    noise = noise_of(together.setup.problem())
    for prepared, shares in zip(together.setup.tests, ((0.5, 0.5), (3.0,)), strict=True):
        for direction, share in zip(prepared.test.matched, shares, strict=True):
            strip = prepared.test.strips[direction]
            expected = share * strip.scatter / strip.points[1].max()
            assert noise[prepared.part(direction)] == pytest.approx(expected)


#: MPa: E1 of the card, and by how much (1 sigma) two directions move it.
E1, OFF = 500.0, (0.6, -0.8)
#: G12, E2, E1 of each direction.
DIRECTIONS = np.array([[0.1, 2.0, OFF[0]], [0.2, -3.0, OFF[1]]])


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    monkeypatch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)


def card(directions=DIRECTIONS, e1=E1):
    law = HypoelasticLaw.linear(e1, 150.0, 20.0)
    return MaterialCard(law, 0.81, "sure", "", CardCertainty(directions, "made"))


def predictions(folder, own, **options):
    project = read_project(write_cylinder_project(folder))
    return predict(project, "high", cards={"sure": own}, jobs=1, **options)


def slope(folder):
    loads = [predictions(folder, replace(card(), certainty=None,
                                         law=HypoelasticLaw.linear(e, 150.0, 20.0))).curves()
             for e in (E1 - 1, E1 + 1)]  # fmt: skip
    return np.asarray((loads[1]["load_N"] - loads[0]["load_N"]) / 2)


def test_steps_and_draws_give_the_spread_to_first_order(tmp_path):
    events = []
    done = predictions(tmp_path, card(), progress=events.append)
    assert events[-1].total == 3  # the prediction, and a run a direction
    curve, (run,) = done.curves(), done.predicted_runs
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
    # The standard deviation of 300 draws is known to 4 %.
    drawn = predictions(tmp_path, card(), samples=300)
    np.testing.assert_allclose(drawn.curves()["load_sigma_N"], expected, rtol=0.1, atol=1e-9)
    assert drawn.predicted_runs[0].around.words == "300 laws drawn"
    few = [predictions(tmp_path, card(), samples=5).curves()["load_sigma_N"] for _ in range(2)]
    np.testing.assert_array_equal(*few)
    own, two = np.array([0.0, 10.0, 20.0]), [np.array([0.0, 11.0, 22.0]), np.array([0.0, 9.0])]
    for how, shares, curves, sigma in (
        ("directions", (1.0, -0.5), two, [0.0, np.hypot(1, 2), np.nan]),
        ("samples", (1.0, 1.0), [*two, None], [0.0, np.sqrt(2), np.nan]),
        ("directions", (1.0, 1.0), [two[0], None], [np.nan] * 3),
        ("samples", (1.0, 1.0), [two[0], None], [np.nan] * 3),
    ):
        np.testing.assert_allclose(Around(how, shares).sigma(own, curves), sigma)


def test_another_program_is_not_run_unasked(tmp_path, monkeypatch):
    monkeypatch.setattr(ClosedFormCylinder, "external", True)
    assert predictions(tmp_path, card()).predicted_runs[0].around is None


@pytest.mark.parametrize(
    ("off", "e1", "known", "words"),
    [
        (E1 - STOPS, E1, 25, ""),
        (5.0, STOPS - 5.0, 13, ""),
        (3.0, 10.0, 0, "1 of its least certain directions, 1 failed"),
    ],
)
def test_what_is_not_known_is_not_said(tmp_path, off, e1, known, words):
    done = predictions(tmp_path, card(np.array([[0, 0, off]]), e1=e1))
    assert done.curves()["load_sigma_N"].notna().tolist() == [k < known for k in range(25)]
    assert words in done.predicted_runs[0].around.words
    assert (done.result["runs"][0]["load_sigma_N"]["40 mm"] is None) == (not known)


def test_a_step_keeps_the_moduli_positive(tmp_path):
    around, laws = laws_around(card(np.array([[-30.0, 0, 0], [-15.0, 0, 0]])), None)
    assert around.steps == [-1.0, 1.0]
    assert [float(law.G12(0.0)) for law in laws] == pytest.approx([50.0, 5.0])
    around, laws = laws_around(card(np.array([[-300.0, 1000.0, 0], [300.0, 0, 0]])), None)
    assert all(float(law.E2(0.0)) > 0 and float(law.G12(0.0)) > 0 for law in laws)
    hopeless = card(np.array([[-3000.0, 2e5, 0]]))
    with pytest.raises(InputError, match="card 'sure': a modulus is not positive next to"):
        predictions(tmp_path, hopeless)
    assert laws_around(replace(card(), certainty=None), None) == (None, ())


FIT = "[fit]\nstarts = 2\nseed = 7\n"


def project(folder, unknowns, *changes):
    return read_project(constant_strips(folder, (FIT, f"{FIT}[fit.unknowns]\n{unknowns}\n"),
                                        *changes))  # fmt: skip


def test_a_fit_with_the_thickness_unknown(together, tmp_path):
    unknown = "[fit.unknowns]\nthickness = { bounds = [0.5, 1.1], prior = 0.04 }\n"
    fixed = together.result
    constant_strips(tmp_path, (FIT, FIT + unknown))
    done = in_process("uniaxial", "project.toml", "--starts", 1, "--jobs", 1, "--out", "free",
                      cwd=tmp_path)  # fmt: skip
    free = result_in(tmp_path / "free")
    said = free["unknowns"]["thickness"]
    assert said["value"] == pytest.approx(0.8, abs=1e-3)
    assert said["sigma"] == pytest.approx(0.04, rel=0.01) and not said["determined"]
    assert "unknowns" not in fixed
    assert f"thickness: {said['verdict']}" in " ".join(done.output.split())
    page = (tmp_path / "free" / "report.html").read_text()
    assert said["verdict"] in page and "thickness (fitted)" in page and "nu12 (fixed)" in page
    kinds = [n["kind"] for n in free["notes"] if n["note"].startswith("thickness is")]
    assert kinds == ["uncertain"]
    for name in ("E1", "E2"):
        own, without = (r["uncertainty"]["median_relative_sigma"][name] for r in (free, fixed))
        assert own == pytest.approx(np.hypot(without, 0.05), rel=0.02)
    assert read_card(tmp_path / "free" / "material.toml").thickness == pytest.approx(said["value"])
    assert "thickness" in pd.read_csv(tmp_path / "free" / "history.csv").columns


def test_what_is_shared_stands_before_each_comparisons_own(tmp_path):
    both = "nu12 = {}\nthickness = { prior = 0.02 }"
    problem = prepare_fit(own := project(tmp_path, both), own.chosen(None, fitted=True)).problem()
    assert problem.unknowns.nuisance.names == ("nu12", "thickness")
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
    assert problem.unknowns.at(np.array([10.0, 200.0, 300.0]))[3:].tolist() == [0.0, 0.8]


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
        fit_setup(own)
    assert told.value.field == f"fit.unknowns.{key}"
    assert words in told.value.problem
