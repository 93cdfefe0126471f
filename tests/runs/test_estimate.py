"""Estimates by virtual work: the known solution with and without noise, starts, real tests."""

import json
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import FitProblem
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.runs.check import check
from bubblefit.runs.estimate import GAP, closed_form_coefficients, estimate_of, with_start
from bubblefit.storage.writing import json_text

from ..builders.projects import constant_strips, edited_project, fit_setup, project_file
from ..builders.unknowns import project as project_with_unknowns
from ..support.commands import in_process
from ..support.paths import EXAMPLES, KNOWN
from ..support.refusals import raised


def test_specimens_that_differ_by_a_factor_are_fitted():
    u = np.linspace(0.1, 2.0, 20)
    loads = 20 * (700 * np.log1p(u / 20) - 750 * np.log1p(u / 20) ** 2)
    factors = {"warp": (0.95, 1.0, 1.02, 1.04), "fill": (0.9, 0.94, 0.99, 1.01)}
    curves = {way: [(u, f * loads) for f in factors[way]] for way in factors}
    strips = bf.Strips(curves, gauge=20.0, match="points", increments=5)
    law = bf.Law("linear", strain_range=[0.1, 0.1, 0.1])
    fit = bf.fit([strips], law, fabric=bf.Fabric("made", 0.8), starts=1, jobs=1)
    assert np.isfinite(fit.bands()["upper_MPa"]).all() and fit.findings


def noisy(setup, sigma, seed):
    """The known solution with white noise that the test says."""
    random, (prepared,) = np.random.default_rng(seed), setup.tests
    fields = tuple(
        replace(f, displacement=f.displacement + sigma * random.standard_normal((len(f.points), 3)))
        for f in prepared.fields
    )
    test = replace(prepared.test, noise=sigma)
    return replace(setup, tests=(replace(prepared, fields=fields, test=test),))


def errors(found, truth):
    """Relative errors along the strains reached, by modulus, and whether bands have the truth."""
    off, inside = {}, {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, found.best.valid[component], 31)
        true, own = truth.modulus(name, strain), found.law.modulus(name, strain)
        low, high = found.best.certainty.at(found.law, name, strain).band
        off[name] = np.abs(own / true - 1.0)
        inside[name] = np.mean((low <= true) & (true <= high))
    return off, inside


def test_known_solution_without_noise_is_estimated(known):
    found = estimate_of(known)
    off, _ = errors(found, known.tests[0].known)
    assert off["E1"].max() < 1e-3 and off["E2"].max() < 2e-3 and np.median(off["G12"]) < 0.01
    assert found.problem.analyses < 20 and 0.01 < found.gaps[0].chi < 0.2


def test_bands_of_estimate_cover_noise(known):
    every = [noisy(known, 0.03, seed) for seed in range(12)]
    found = [estimate_of(setup) for setup in every]
    offs, insides = zip(*(errors(f, known.tests[0].known) for f in found), strict=True)
    for name, most in (("E1", 0.006), ("E2", 0.012), ("G12", 0.15)):
        assert np.median([np.median(off[name]) for off in offs]) < most
        assert np.mean([inside[name] for inside in insides]) > 0.8
    assert 0.9 < np.mean([f.gaps[0].chi for f in found]) < 1.1


def test_biaxial_tests_and_strips_are_estimated(strips_project):
    path = EXAMPLES / "biaxial-computed" / "project.toml"
    found = bf.estimate(bf.read_project(path))
    off, _ = errors(found, bf.fit(bf.read_project(path), starts=1, jobs=1).law)
    assert np.median(off["E1"]) < 0.05 and np.median(off["E2"]) < 0.02
    fitted = bf.fit(strips_project, starts=1, jobs=1).law
    law = bf.estimate(strips_project).law
    for name in ("E1", "E2"):
        assert law.modulus(name, 0.01) == pytest.approx(fitted.modulus(name, 0.01), rel=0.1)


@pytest.mark.parametrize(("weight", "modulus"), [(1e-4, 330.0), (1e4, 370.0)])
def test_weights_of_tests_count_in_an_estimate(tmp_path, weight, modulus):
    setup = fit_setup(constant_strips(tmp_path, ("weight = 3.0", f"weight = {weight}")))
    assert estimate_of(setup).law.modulus("E1", 0.0) == pytest.approx(modulus, rel=1e-3)


def test_weights_of_directions_count_in_an_estimate(tmp_path):
    balanced = ('form = "constant"', 'form = "constant"\nsymmetry = "balanced"')
    weights = ('files = ["one.csv"]', 'files = ["one.csv"]\n[strips.weights]\nfill = 1e-4')
    path = constant_strips(tmp_path, balanced, ("E2 = [0.03, 1.0]\n", ""), weights)
    setup = fit_setup(path, "one")
    assert estimate_of(setup).law.modulus("E1", 0.0) == pytest.approx(330.0, rel=1e-3)


def test_analyses_of_both_rounds_of_an_estimate_are_counted(tmp_path, monkeypatch):
    counted = []
    evaluate = FitProblem.evaluate

    def count(*arguments):
        counted.append(1)
        return evaluate(*arguments)

    monkeypatch.setattr(FitProblem, "evaluate", count)
    assert estimate_of(fit_setup(constant_strips(tmp_path))).problem.analyses == len(counted)


def test_estimate_is_the_same_from_command_page_and_python(tmp_path):
    path = project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 240"))
    result = json.loads(in_process("estimate", str(path), "--json", cwd=tmp_path).stdout)
    own = json.loads(json_text(bf.estimate(bf.read_project(path)).result))
    assert {**own, "cpu_s": 0} == {**result, "cpu_s": 0}
    assert {"E1", "E2", "G12"} == set(result["moduli"]) and result["chi"]["bubble"] < 1
    assert "chi" in in_process("estimate", str(path), cwd=tmp_path).stdout
    found = check(bf.read_project(path))
    page = found.report(tmp_path / "out").read_text()
    assert "An estimate by virtual work" in page and (tmp_path / "out/equilibrium.png").exists()
    assert found.result["estimate"]["chi"] == pytest.approx(result["chi"])


def test_no_estimate_under_an_unknown_first_shape(tmp_path):
    project = edited_project(
        tmp_path, "[bubble.nuisance]", "[bubble.sheet]\nfrom_pressure = 59\n\n[bubble.nuisance]"
    )
    raised(InputError, "from_pressure", bf.estimate, project)
    # Then all starts are random.
    project = project.with_fit(starts_from="estimate")
    setup = fit_setup(project)
    assert with_start(setup) is setup


def test_start_is_in_closed_form_where_virtual_work_gives_none(known, monkeypatch):
    coefficients = closed_form_coefficients(known)
    beta = np.zeros(12)
    beta[list(known.law.form.free)] = coefficients
    truth = known.tests[0].known
    mean = np.sqrt(truth.modulus("E1", 0.04) * truth.modulus("E2", 0.04))
    assert known.law.with_beta(beta).modulus("E1", 0.04) == pytest.approx(mean, rel=0.15)

    def refuse(*_):
        raise InputError(None, "data", "no shape was measured")

    monkeypatch.setattr(type(known.tests[0]), "virtual_work", refuse)
    setup = replace(known, project=known.project.with_fit(starts_from="estimate"))
    assert (with_start(setup).starts.coefficients == coefficients).all()


@pytest.mark.parametrize("name", ["nu12", "thickness"])
def test_unknown_with_prior_is_estimated_and_keeps_its_sigma(tmp_path, name):
    changes = (("nu12 = 0.0", "nu12 = 0.2"),)
    project = project_with_unknowns(tmp_path, f"{name} = {{ prior = 0.05 }}", *changes)
    found = estimate_of(fit_setup(project))
    noise = Noise.from_residual(found.problem, found.best.point.residual)
    assert (noise.residual_sigma * found.problem.scale)[-1] == pytest.approx(0.05)
    fit = bf.fit(project, starts=1, starts_from="estimate", jobs=1)
    for modulus in ("E1", "E2"):
        fitted = fit.law.modulus(modulus, 0.05)
        assert found.law.modulus(modulus, 0.05) == pytest.approx(fitted, rel=0.1)
    assert found.law.nu12 == pytest.approx(0.2, abs=0.05)
    checked = check(project.with_fit(starts_from="estimate"))
    assert "one: fine: nothing doubtful" in checked.lines()


def test_check_begins_with_modulus_in_closed_form(known):
    first = check(known.project).lines()[0]
    assert first.startswith("bubble: note: closed form, E1 = E2, MPa: ")


def test_estimate_of_real_tests_notes_their_gap(shared_data, tmp_path):
    text = (EXAMPLES / "bubble-valmex7318" / "test1-linear.toml").read_text()
    found = bf.estimate(bf.read_project(project_file(tmp_path, text), shared_data / "bubble"))
    (gap,) = found.gaps
    assert 10 < gap.chi < 500 and 0.3 < np.linalg.norm(gap.displacement, axis=1).max() < 10
    assert found.problem.analyses < 40 and GAP in [note.kind for note in found.notes]


def test_first_start_begins_at_estimate_and_all_agree(tmp_path):
    path = project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 240"))
    found = bf.fit(bf.read_project(path), starts=3, starts_from="estimate", jobs=1)
    first, *others = found.best.records
    assert first.analyses < min(one.analyses for one in others)
    assert "all 3" in found.agreement and "estimate" in found.agreement
    assert found.objective < 1e-6
