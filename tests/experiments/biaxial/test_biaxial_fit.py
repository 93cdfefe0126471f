"""Biaxial tests in fits: the law behind computed data, ratios foretold, what is said."""

import json
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.biaxial.prepared import candidates
from bubblefit.experiments.kinds import UNMATCHED, Planning, Precision, Weighting
from bubblefit.materials.card import read_card
from bubblefit.materials.designers import shares
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.meshes.strip_models import elongations
from bubblefit.runs.compare import candidates as candidate_laws
from bubblefit.runs.fit import check
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.simulation import simulate_cards

from ...biaxial_files import BENT, FIVE, THICKNESS, biaxial_project, rows_of, write_rows
from ...commands import in_process
from ...complaints import complaint_with


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("biaxial")
    write_rows(place / "test.csv", rows_of(BENT, cycles=2, kept=0.01))
    biaxial_project(place)
    return place


@pytest.fixture(scope="module")
def fitted(folder):
    found = bf.fit(bf.read_project(folder / "project.toml"), starts=1)
    found.report(folder / "out")
    return found


def test_the_law_behind_the_strains_is_found(fitted):
    strain = np.linspace(0.0, 0.04, 21)
    for name in ("E1", "E2"):
        np.testing.assert_allclose(
            fitted.law.modulus(name, strain), BENT.modulus(name, strain), rtol=1e-4
        )
    assert fitted.objective < 1e-6


def test_nothing_is_known_of_the_shear_and_it_is_said(fitted):
    assert fitted.best.certainty.sigma["G12"].min() > 1.0
    told = [str(note) for note in fitted.notes if note.kind == UNMATCHED]
    assert any("nothing of G12" in words for words in told)
    assert fitted.best.reached[2] < 1e-3 and fitted.best.reached[0] > 0.02


def test_numbers_tables_and_files_say_the_strains_in_percent(fitted, folder):
    out = folder / "out"
    ratios = json.loads((out / "result.json").read_text())["ratios"]
    assert list(ratios) == list(FIVE)
    one = ratios["2:1"]
    assert one["end_load_warp_kN_per_m"] == 30.0 and one["end_load_fill_kN_per_m"] == 15.0
    assert (one["cycle"], one["cycles"], one["matched"]) == (2, 2, 30)
    assert one["rms_warp_percent"] < 1e-6
    table = pd.read_csv(out / "paths.csv")
    part = table[table.ratio == "1:2"]
    loads = np.outer(np.linspace(2, 30, 30), [0.5, 1.0])
    strain = 100 * biaxial_response(BENT, loads, THICKNESS).elongation
    np.testing.assert_allclose(part.warp_strain_percent, strain[:, 0] - strain[0, 0], atol=1e-9)
    np.testing.assert_allclose(part.fill_model_percent, strain[:, 1] - strain[0, 1], atol=1e-5)
    np.testing.assert_allclose(part.warp_load_kN_per_m, loads[:, 0])
    residuals = fitted.residuals()
    assert len(residuals) == 5 * 2 * 29 and set(residuals.quantity) == {
        "warp_strain", "fill_strain",
    }  # fmt: skip
    assert set(residuals.unit) == {"%"}
    off = residuals.modelled - residuals.measured
    np.testing.assert_allclose(residuals.difference, off, atol=1e-12)
    assert (out / "paths.png").is_file() and "Misfit by ratio" in (out / "report.html").read_text()


def test_a_sixth_ratio_is_foretold(fitted):
    """Within 1 % of the largest strain, asked of five computed ratios of a law that bends."""
    loads = np.outer(np.linspace(2, 30, 20), shares("1:5"))
    wanted, found = (
        biaxial_response(law, loads, THICKNESS).elongation for law in (BENT, fitted.law)
    )
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_residuals_and_their_derivatives(folder):
    project = bf.read_project(folder / "project.toml")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    comparisons = prepared.comparisons(setup.make_solver, Weighting())
    assert [c.name for c in comparisons] == [f"biaxial: {ratio}" for ratio in FIVE]
    law = BENT.with_beta(1.1 * BENT.beta)
    free = tuple(range(12))
    for comparison in comparisons:
        objective = comparison.objective
        history, jacobian = comparison.differentiate(law, free, {}, warm=False)
        residual = objective.residual(history, {})
        own = elongations(history.displacement)
        off = (own - own[0] - objective.strain)[1:]
        np.testing.assert_allclose(residual * objective.scale, 100 * off.T.ravel(), atol=1e-12)
        largest = np.abs(objective.strain).max()
        assert np.linalg.norm(residual[: objective.sizes[0]]) == pytest.approx(
            np.sqrt(np.mean(off[:, 0] ** 2)) / largest
        )
        for place in (7, 11):
            step = 1e-4 * np.eye(12)[place]
            ends = [
                objective.residual(comparison.run(law.with_beta(law.beta + s), free, {}, False), {})
                for s in (step, -step)
            ]
            slope = (ends[0] - ends[1]) / 2e-4
            least = 1e-6 * np.abs(jacobian[:, [7, 11]]).max()
            np.testing.assert_allclose(jacobian[:, place], slope, rtol=1e-5, atol=least)
        larger = np.linspace(2, 30, 30)[1:, None]
        assert [len(at) for at in objective.places] == list(objective.sizes)
        np.testing.assert_allclose(objective.places[1], larger)
        # Weights of one test among others add up to that of the test.
    weighted = prepared.comparisons(setup.make_solver, Weighting(True, 3.0))
    history = comparisons[0].run(law, free, {}, False)
    ratio = weighted[0].objective.residual(history, {}) / comparisons[0].objective.residual(
        history, {}
    )
    np.testing.assert_allclose(ratio, 3.0 / 10)
    shifted = comparisons[0].objective.shifted(history, comparisons[0].run(BENT, free, {}, False))
    np.testing.assert_allclose(
        shifted.residual(comparisons[0].run(BENT, free, {}, False), {}),
        comparisons[0].objective.residual(history, {}), atol=1e-12,
    )  # fmt: skip


def test_noise_is_what_the_section_says_in_percent(folder, tmp_path):
    write_rows(tmp_path / "test.csv", rows_of(BENT, ["1:1"]))
    project = bf.read_project(biaxial_project(tmp_path, "noise = 0.03"))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (comparison,) = setup.problem().comparisons
    assert comparison.objective.least_noise == pytest.approx(0.03)
    assert comparison.objective.noise_is == "given" and comparison.objective.unit == "%"
    (usual,) = prepare_fit(*_of(folder)).tests
    assert usual.comparisons(lambda *a: None, Weighting())[0].objective.least_noise == 0.01


def _of(folder: Path):
    project = bf.read_project(folder / "project.toml")
    return project, project.chosen(None, fitted=True)


def test_the_section_chooses_ratios_loads_cycle_and_how_many_points(tmp_path):
    write_rows(tmp_path / "test.csv", rows_of(BENT, cycles=3, kept=0.01))
    lines = 'ratios = ["1:2", "2/1"]\nrange = [5, 20]\ncycle = 2\npoints = 8\nname = "cross"'
    (test,) = bf.read_project(biaxial_project(tmp_path, lines)).tests.values()
    assert [p.ratio for p in test.data.paths] == ["2:1", "1:2"] and test.name == "cross"
    for path in test.data.paths:
        assert path.cycle.number == 2 and len(path.load) == 8
        assert 5 <= path.load.max(axis=1).min() < 6 and 19 < path.load.max() <= 20
    assert test.reach.strain[2] is None and 0.01 < test.reach.strain[0] < 0.03

    def read(lines, file="test.csv"):
        return bf.read_project(biaxial_project(tmp_path, lines, file=file))

    complaint_with(["project.toml", "biaxial[0].range", "[20, 5]"], read, "range = [20, 5]")
    complaint_with(["biaxial[0].ratios[1]", "'2-1'"], read, 'ratios = ["1:1", "2-1"]')
    complaint_with(["number 4"], read, "cycle = 4")
    complaint_with(["biaxial[0].data.files[0]", "--data"], read, "", file="none.csv")
    complaint_with(["biaxial[0].cycle"], read, "cycle = 0")


def test_files_may_be_listed_by_ratio(tmp_path):
    for ratio in ("1:1", "2:1"):
        rows = [row[1:] for row in rows_of(BENT, [ratio])]
        head = '"n_w, kN/m","n_f, kN/m","eps_w, %","eps_f, %"'
        write_rows(tmp_path / f"{ratio.replace(':', '-')}.csv", rows, head)
    path = biaxial_project(tmp_path)
    text = path.read_text().replace('["test.csv"]', '{ "1:1" = ["1-1.csv"], "2/1" = ["2-1.csv"] }')
    path.write_text(text)
    (test,) = bf.read_project(path).tests.values()
    assert [p.ratio for p in test.data.paths] == ["1:1", "2:1"]
    path.write_text(text.replace('"2/1"', '"warp"'))
    complaint_with(["biaxial[0].data.files.warp", "2:1"], bf.read_project, path)


def test_the_look_at_the_data_lists_every_cycle(folder, tmp_path):
    found = check(bf.read_project(folder / "project.toml"))
    assert found.sound
    found.report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "Cycles as read" in page and (tmp_path / "biaxial.png").is_file()
    assert page.count("<td>yes</td>") == 5 or page.count(">yes<") == 5


def test_cards_are_judged_ratio_by_ratio(folder, fitted, tmp_path):
    card = read_card(folder / "out" / "material.toml")
    project = bf.read_project(folder / "project.toml")
    found = simulate_cards(project, list(project.tests.values()), {"own": card}, tmp_path)
    ratios = found.numbers["cards"]["own"]["ratios"]
    assert set(ratios) == set(FIVE)
    assert all(told["rms_warp_percent"] < 1e-5 for told in ratios.values())
    assert ratios["1:0"]["shown_to_kN_per_m"] == 30.0
    assert (tmp_path / "paths.png").is_file() and len(pd.read_csv(tmp_path / "paths.csv")) == 150


TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)
#: What one ratio, unlike the others, was computed with.
ELSE = HypoelasticLaw.linear(1100.0, 600.0, 30.0, 0.24)


def test_a_ratio_is_foretold_by_the_other(tmp_path, monkeypatch):
    """Each of two was made of a fabric of its own, of which the other knows nothing."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))
    write_rows(tmp_path / "test.csv", [*rows_of(TRUE, ["1:1"]), *rows_of(ELSE, ["2:1"])])
    biaxial_project(tmp_path, form="constant")
    command = ("validate", "project.toml", "--leave", "ratios", "--starts", 1, "--out", "out")
    in_process(*command, cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "validation.csv").set_index("test")
    assert sorted(table.index) == ["biaxial: 1:1", "biaxial: 2:1"]
    for ratio in ("1:1", "2:1"):
        loads = np.outer(np.linspace(2, 30, 30), shares(ratio))
        one, other = (100 * biaxial_response(e, loads, THICKNESS).elongation for e in (ELSE, TRUE))
        off = ((one - one[0]) - (other - other[0]))[1:]
        foretold = table.loc[f"biaxial: {ratio}"].foretold_rms
        assert foretold == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-3)
    # A fit to both meets one of them at least half.
    assert (table.fitted_rms / table.foretold_rms).min() < 0.5


def planning(tmp_path, noise=None, own=True) -> Planning:
    write_rows(tmp_path / "test.csv", rows_of(TRUE, ["1:1", "2:1"]))
    project = bf.read_project(biaxial_project(tmp_path, form="constant"))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    law = HypoelasticLaw(TRUE.beta, 0.24, [0.03, 0.04, 0.1], form=TRUE.form)
    precision = {"biaxial: 1:1": Precision(0.02, 2.0, 29), "biaxial: 2:1": Precision(0.03, 4.0, 29)}
    tests = [prepared] if own else []
    place = prepared.test.place
    return Planning(place, tests, precision if own else {}, law, setup.make_solver, noise)


def test_each_ratio_is_offered_up_to_the_strains_that_the_law_is_known_for(tmp_path):
    offered = candidates(planning(tmp_path))
    assert [c.name for c in offered] == [
        f"biaxial {r}" for r in ("1:1", "2:1", "1:2", "1:0", "0:1", "1:5", "5:1")
    ]
    assert {c.noise_is for c in offered} == {"that of biaxial"}
    for candidate in offered:
        (path,) = candidate.make().test.data.paths
        share = np.log1p(path.strain[-1]) / [0.03, 0.04]
        assert share.max() == pytest.approx(1.0, rel=1e-6) and len(path.load) == 20
        wanted = biaxial_response(TRUE, path.load, THICKNESS).elongation
        np.testing.assert_allclose(path.strain, wanted, rtol=1e-12)
        np.testing.assert_allclose(path.load[0], 0.05 * path.load[-1])


def test_the_noise_of_a_ratio_is_the_project_s_own_or_given_or_assumed(tmp_path):
    def noise(**options):
        candidate = candidates(planning(tmp_path, **options))[0]
        (one,) = candidate.make().comparisons(lambda *a: None, Weighting())
        return candidate.noise_is, one.objective.least_noise

    # The worse of both ratios, of which four neighbours err as one.
    own, known = noise()
    assert own == "that of biaxial" and known == pytest.approx(0.03 * np.sqrt(4.0 * 19 / 29))
    assert noise(noise=0.05) == ("given", pytest.approx(0.05))
    assert noise(own=False) == ("assumed", pytest.approx(0.01 * np.sqrt(19 / 5)))


KNOWN = HypoelasticLaw([30.0, 800.0, 400.0, 1000.0, -300.0], 0.24, form=LoadRatio())


@pytest.fixture(scope="module")
def fitted_folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("ratio")
    write_rows(place / "test.csv", rows_of(KNOWN))
    path = biaxial_project(place, form="load-ratio")
    # Its moduli depend on no strain: it needs no range, as the constant form needs none.
    path.write_text(path.read_text().replace("strain_range = [0.07, 0.07, 0.1]\n", ""))
    return place


@pytest.fixture(scope="module")
def fitted_fit(fitted_folder):
    found = bf.fit(bf.read_project(fitted_folder / "project.toml"), starts=1)
    found.card.write(fitted_folder / "material.toml")
    return found


def test_five_ratios_give_its_unknowns_back(fitted_fit):
    np.testing.assert_allclose(fitted_fit.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    assert fitted_fit.objective < 1e-7


def test_a_sixth_ratio_is_foretold_fit(fitted_fit):
    loads = np.outer(np.linspace(2, 30, 20), shares("1:5"))
    wanted, found = (
        biaxial_response(law, loads, THICKNESS).elongation for law in (KNOWN, fitted_fit.law)
    )
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_the_card_is_as_sure_of_the_gains_as_of_the_moduli(fitted_folder, fitted_fit):
    """The moduli at equal loads alone would leave two directions of five out."""
    card = read_card(fitted_folder / "material.toml")
    assert len(card.certainty.directions) == 5
    sigma = np.sqrt(np.diag(card.certainty.covariance))
    np.testing.assert_allclose(card.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    assert (sigma[1:] > 0.05).all() and (sigma[1:] < 5.0).all()
    assert sigma[0] > 50.0  # nothing shears the fabric
    least = {name: float(card.law.modulus(name, 0.0, end)) for name, end in
             (("E1", 0.0), ("E1", 1.0), ("E2", 0.0), ("E2", 1.0))}  # fmt: skip
    assert min(least.values()) > 0


def test_which_forms_are_compared_unless_named(fitted_folder, tmp_path):
    path = fitted_folder / "project.toml"
    assert "load-ratio" in candidate_laws(bf.read_project(path))
    other = tmp_path / "project.toml"
    text = path.read_text().replace("test.csv", str(fitted_folder / "test.csv"))
    other.write_text(text.replace("starts = 1", 'starts = 1\nsolver = "marc"'))
    project = bf.read_project(other)
    assert "cubic" in candidate_laws(project) and "load-ratio" not in candidate_laws(project)
    # Where it is asked for, it is refused before anything runs.
    assert "load-ratio" in candidate_laws(project, ["load-ratio"])


def test_another_solver_is_refused_in_one_line(fitted_folder, tmp_path, ccx):
    path = tmp_path / "project.toml"
    text = (
        (fitted_folder / "project.toml")
        .read_text()
        .replace("test.csv", str(fitted_folder / "test.csv"))
    )
    path.write_text(text.replace("starts = 1", 'starts = 1\nsolver = "calculix"'))
    said = ["project.toml", "law.form", "solver membrane", "calculix takes moduli of strain"]
    complaint_with(said, bf.fit, bf.read_project(path), starts=1)
