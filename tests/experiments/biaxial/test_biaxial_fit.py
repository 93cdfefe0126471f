"""Biaxial tests in fits: the law behind computed data, ratios foretold, what is said."""

import json
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.biaxial.planning import candidates
from bubblefit.experiments.biaxial.prepared import PreparedBiaxial
from bubblefit.experiments.doubts import Expected
from bubblefit.experiments.fitted import UNMATCHED
from bubblefit.experiments.planning import Planning, Precision
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import read_card
from bubblefit.materials.designers import shares
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import elongations
from bubblefit.runs import setup
from bubblefit.runs.check import check
from bubblefit.runs.compare import candidates as candidate_laws
from bubblefit.runs.result import Fit
from bubblefit.runs.simulation import simulate_cards
from bubblefit.solvers.registry import solver_named

from ...builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    HEAD,
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ...builders.projects import fit_setup
from ...support.commands import in_process
from ...support.refusals import complaint_with


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("biaxial")
    write_biaxial_rows(place / "test.csv", biaxial_rows(BENT_LAW, cycles=2, kept=0.01))
    biaxial_project(place)
    return place


@pytest.fixture(scope="module")
def fitted(folder):
    found = bf.fit(bf.read_project(folder / "project.toml"), starts=1)
    found.report(folder / "out")
    return found


def sixth(law):
    loads = np.outer(np.linspace(2, 30, 20), shares("1:5"))
    return biaxial_response(law, loads, THICKNESS).elongation


def test_the_law_behind_the_strains_is_found(fitted):
    strain = np.linspace(0.0, 0.04, 21)
    for name in ("E1", "E2"):
        found, wanted = (law.modulus(name, strain) for law in (fitted.law, BENT_LAW))
        np.testing.assert_allclose(found, wanted, rtol=1e-4)
    assert fitted.objective < 1e-6
    found, wanted = sixth(fitted.law), sixth(BENT_LAW)
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()
    # Nothing is known of the shear, and it is said.
    assert not fitted.best.certainty.moduli["G12"].determined.any()
    assert UNMATCHED in [note.kind for note in fitted.notes]
    assert fitted.best.reached[2] < 1e-3 and fitted.best.reached[0] > 0.02


def test_numbers_tables_and_files_say_the_strains_in_percent(fitted, folder):
    out = folder / "out"
    ratios = json.loads((out / "result.json").read_text())["ratios"]
    assert list(ratios) == list(FIVE_RATIOS)
    one = ratios["2:1"]
    assert one["end_load_warp_kN_per_m"] == 30.0 and one["end_load_fill_kN_per_m"] == 15.0
    assert (one["cycle"], one["cycles"], one["matched"]) == (2, 2, 30)
    assert one["rms_warp_percent"] < 1e-6
    table = pd.read_csv(out / "paths.csv")
    part = table[table.ratio == "1:2"]
    loads = np.outer(np.linspace(2, 30, 30), [0.5, 1.0])
    strain = 100 * biaxial_response(BENT_LAW, loads, THICKNESS).elongation
    np.testing.assert_allclose(part.warp_strain_percent, strain[:, 0] - strain[0, 0], atol=1e-9)
    np.testing.assert_allclose(part.fill_model_percent, strain[:, 1] - strain[0, 1], atol=1e-5)
    np.testing.assert_allclose(part.warp_load_kN_per_m, loads[:, 0])
    residuals = fitted.residuals()
    assert len(residuals) == 5 * 2 * 29 and set(residuals.unit) == {"%"}
    assert set(residuals.quantity) == {"warp_strain", "fill_strain"}
    off = residuals.modelled - residuals.measured
    np.testing.assert_allclose(residuals.difference, off, atol=1e-12)
    assert (out / "paths.png").is_file()


def test_residuals_and_their_derivatives(folder):
    setup = fit_setup(folder / "project.toml")
    (prepared,) = setup.tests
    comparisons = prepared.comparisons(setup.make_solver, Weighting())
    assert [c.name for c in comparisons] == [f"biaxial: {ratio}" for ratio in FIVE_RATIOS]
    law = BENT_LAW.with_beta(1.1 * BENT_LAW.beta)
    free = tuple(range(12))
    for comparison in comparisons:
        objective = comparison.objective
        history, jacobian = comparison.differentiate(law, free, {}, warm=False)
        residual = objective.residual(history, {})
        own = elongations(history.displacement)
        off = (own - own[0] - objective.strain)[1:]
        np.testing.assert_allclose(residual * objective.scale, 100 * off.T.ravel(), atol=1e-12)
        rms, largest = np.sqrt(np.mean(off[:, 0] ** 2)), np.abs(objective.strain).max()
        assert np.linalg.norm(residual[: objective.sizes[0]]) == pytest.approx(rms / largest)
        for place in (7, 11):
            step = 1e-4 * np.eye(12)[place]
            laws = [law.with_beta(law.beta + s) for s in (step, -step)]
            up, down = (objective.residual(comparison.run(x, free, {}, False), {}) for x in laws)
            slope = (up - down) / 2e-4
            least = 1e-6 * np.abs(jacobian[:, [7, 11]]).max()
            np.testing.assert_allclose(jacobian[:, place], slope, rtol=1e-5, atol=least)
        larger = np.linspace(2, 30, 30)[1:, None]
        assert [len(at) for at in objective.positions] == list(objective.sizes)
        np.testing.assert_allclose(objective.positions[1], larger)
        # Weights of one test among others add up to that of the test.
    weighted, own = prepared.comparisons(setup.make_solver, Weighting(True, 3.0)), comparisons[0]
    history, other = (own.run(one, free, {}, False) for one in (law, BENT_LAW))
    residual = own.objective.residual(history, {})
    ratio = weighted[0].objective.residual(history, {}) / residual
    np.testing.assert_allclose(ratio, 3.0 / 10)
    shifted = own.objective.shifted(history, other)
    np.testing.assert_allclose(shifted.residual(other, {}), residual, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "noise", "how"), [("noise = 0.03", 0.03, "given"), ("", 0.01, "assumed")]
)
def test_noise_is_what_the_section_says_in_percent(tmp_path, line, noise, how):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    (prepared,) = fit_setup(biaxial_project(tmp_path, line)).tests
    (comparison,) = prepared.comparisons(lambda *a: None, Weighting())
    assert comparison.objective.least_noise == pytest.approx(noise)
    assert comparison.objective.noise_is == how and comparison.objective.unit == "%"


def test_the_section_chooses_ratios_loads_cycle_and_how_many_points(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, cycles=3, kept=0.01))

    def read(lines, file):
        path = biaxial_project(tmp_path, lines)
        path.write_text(path.read_text().replace('["test.csv"]', file))
        (test,) = bf.read_project(path).tests.values()
        return test

    lines = 'ratios = ["1:2", "2/1"]\nrange = [5, 20]\ncycle = 2\npoints = 8\nname = "cross"'
    test = read(lines, '["test.csv"]')
    assert [p.ratio for p in test.paths] == ["2:1", "1:2"] and test.name == "cross"
    for path in test.paths:
        assert path.cycle.number == 2 and len(path.load) == 8
        assert 5 <= path.load.max(axis=1).min() < 6 and 19 < path.load.max() <= 20
    ends = np.max([path.strain.max(axis=0) for path in test.paths], axis=0)
    assert test.reach.strain == (*np.log1p(ends), None) and 0.01 < ends[0] < 0.03
    # Files may be listed by ratio.
    for ratio in ("1:1", "2:1"):
        rows = [row[1:] for row in biaxial_rows(BENT_LAW, [ratio])]
        write_biaxial_rows(tmp_path / f"{ratio[0]}.csv", rows, HEAD.removeprefix("ratio,"))
    test = read("", '{ "1:1" = ["1.csv"], "2/1" = ["2.csv"] }')
    assert [p.ratio for p in test.paths] == ["1:1", "2:1"]
    for lines, file, words in (
        ("range = [20, 5]", '["test.csv"]', ["project.toml", "biaxial[0].range", "[20, 5]"]),
        ('ratios = ["1:1", "2-1"]', '["test.csv"]', ["biaxial[0].ratios[1]", "'2-1'"]),
        ("cycle = 4", '["test.csv"]', ["number 4"]), ("cycle = 0", "[]", ["biaxial[0].cycle"]),
        ("", '["none.csv"]', ["biaxial[0].data.files[0]", "--data"]),
        ("", '{ warp = ["1.csv"] }', ["biaxial[0].data.files.warp", "2:1"]),
    ):  # fmt: skip
        complaint_with(words, read, lines, file)


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
    assert set(ratios) == set(FIVE_RATIOS)
    assert all(told["rms_warp_percent"] < 1e-5 for told in ratios.values())
    assert ratios["1:0"]["shown_to_kN_per_m"] == 30.0
    assert (tmp_path / "paths.png").is_file() and len(pd.read_csv(tmp_path / "paths.csv")) == 150


TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)
#: What one ratio, unlike the others, was computed with.
ELSE = HypoelasticLaw.linear(1100.0, 600.0, 30.0, 0.24)


def test_a_ratio_is_foretold_by_the_other(tmp_path, monkeypatch):
    """Each of two was made of a fabric of its own, of which the other knows nothing."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))
    write_biaxial_rows(
        tmp_path / "test.csv", [*biaxial_rows(TRUE, ["1:1"]), *biaxial_rows(ELSE, ["2:1"])]
    )
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
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(TRUE, ["1:1", "2:1"]))
    setup = fit_setup(biaxial_project(tmp_path, form="constant"))
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
        (path,) = candidate.make().test.paths
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
    write_biaxial_rows(place / "test.csv", biaxial_rows(KNOWN))
    path = biaxial_project(place, form="load-ratio")
    # Its moduli depend on no strain: it needs no range, as the constant form needs none.
    path.write_text(path.read_text().replace("strain_range = [0.07, 0.07, 0.1]\n", ""))
    return place


def test_five_ratios_give_its_unknowns_back_and_how_sure_they_are(fitted_folder, tmp_path):
    """The moduli at equal loads alone would leave two directions of five out."""
    found = bf.fit(bf.read_project(fitted_folder / "project.toml"), starts=1)
    assert found.objective < 1e-7
    np.testing.assert_allclose(sixth(found.law), sixth(KNOWN), atol=1e-8)
    found.card.write(tmp_path / "material.toml")
    card = read_card(tmp_path / "material.toml")
    assert len(card.certainty.directions) == 5
    sigma = np.sqrt(np.diag(card.certainty.covariance))
    np.testing.assert_allclose(card.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    assert (sigma[1:] > 0.05).all() and (sigma[1:] < 5.0).all()
    assert sigma[0] > 50.0  # nothing shears the fabric
    assert min(card.law.modulus(name, 0.0, end) for name in ("E1", "E2") for end in (0.0, 1.0)) > 0


def test_which_forms_are_compared_and_which_solver_takes_them(fitted_folder, tmp_path, monkeypatch):
    path, other = fitted_folder / "project.toml", tmp_path / "project.toml"
    text = path.read_text().replace("test.csv", str(fitted_folder / "test.csv"))

    def solved_by(solver):
        other.write_text(text.replace("starts = 1", f'starts = 1\nsolver = "{solver}"'))
        return bf.read_project(other)

    assert "load-ratio" in candidate_laws(bf.read_project(path))
    project = solved_by("marc")
    assert "cubic" in candidate_laws(project) and "load-ratio" not in candidate_laws(project)
    # Where it is asked for, it is refused before anything runs.
    assert "load-ratio" in candidate_laws(project, ["load-ratio"])
    said = ["project.toml", "law.form", "membrane", "marc"]
    monkeypatch.setattr(setup, "usable_solver", lambda name, *options: solver_named(name))
    complaint_with(said, bf.fit, project, starts=1)


EXPECTED = Expected({"E1": (300.0, 3000.0), "E2": (200.0, 3000.0), "G12": (1.0, 300.0)})
ROWS = biaxial_rows(BENT_LAW)


def scaled(load=1.0, strain=1.0):
    return [(r, load * a, load * b, strain * c, strain * d) for r, a, b, c, d in ROWS]


#: Rows, and of each trap that they fall into whether it stops a fit and a word of it.
TRAPS = {
    "shares for percent": (scaled(strain=0.01), {"strain-unit": (True, "in the unit")}),
    "percent times a hundred": (scaled(strain=100), {"strain-unit": (True, "changes by")}),
    "newtons a metre": (scaled(load=1e3), {"load-unit": (True, "per width")}),
    "loads of a fiftieth": (scaled(load=0.02), {"modulus": (True, "is the thickness right")}),
    "yarns of the loads swapped": (
        [(r, b, a, c, d) for r, a, b, c, d in ROWS], {"ratio": (True, "columns")},
    ),
    "another ratio": (
        [("3:1" if r == "2:1" else r, *rest) for r, *rest in ROWS],
        {"ratio": (False, "which is 2:1")},
    ),
    "yarns of the strains swapped": (
        [(r, a, b, d, c) for r, a, b, c, d in ROWS], {"swapped": (True, "stretches more")},
    ),
}  # fmt: skip


def doubts(folder, rows):
    write_biaxial_rows(folder / "test.csv", rows)
    (test,) = bf.read_project(biaxial_project(folder)).tests.values()
    return {doubt.name: doubt for doubt in PreparedBiaxial(test).doubts(EXPECTED)}


@pytest.mark.parametrize("trap", TRAPS)
def test_traps_are_named(tmp_path, trap):
    rows, wanted = TRAPS[trap]
    found = doubts(tmp_path, rows)
    for name, (sure, words) in wanted.items():
        assert found[name].sure == sure and words in found[name].text, found
    if trap == "loads of a fiftieth":
        (_, first, _, low, _), (_, last, _, high, _) = rows[0], rows[29]
        modulus = (last - first) / (0.01 * (high - low)) / THICKNESS
        assert f"is about {modulus:.3g} MPa" in found["modulus"].text
    if trap in ("another ratio", "yarns of the strains swapped"):
        assert set(found) == set(wanted)


def test_good_data_raise_no_doubt(tmp_path):
    assert doubts(tmp_path, ROWS) == {}
    noise = 0.005 * np.random.default_rng(3).standard_normal((len(ROWS), 4))
    rows = [(r, *(np.array(rest) + n)) for (r, *rest), n in zip(ROWS, noise, strict=True)]
    assert doubts(tmp_path, rows) == {}
