"""Certainty of a fit: derivatives, given noise, the error of the mesh and its correction."""

from dataclasses import replace
from io import StringIO

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.base import Weighting
from bubblefit.inference.assessment import Certainty, certainty
from bubblefit.inference.linear import limit_of, residual_of
from bubblefit.inference.problem import ANALYSES_USED_UP
from bubblefit.inference.reported import ReportedModulus
from bubblefit.materials.admissibility import is_positive
from bubblefit.materials.card import read_card
from bubblefit.materials.exports.base import band_table
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.notes import gravest_notes
from bubblefit.project.project import read_project
from bubblefit.project.schema import FitSection
from bubblefit.runs import certainty as mesh_error
from bubblefit.runs.certainty import (
    LARGEST_CORRECTION,
    MESH,
    TAKEN_OUT,
    TOO_LARGE,
    UNKNOWN,
    notes_of_mesh,
    with_certainty,
)
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.starts import best_fit
from bubblefit.runs.verdict import answers

from ..builders.projects import known_bubble
from ..support.paths import KNOWN


class WithoutDerivatives:
    """A solver that runs models as another one does, and gives no derivatives."""

    name, external = "plain", False

    def __init__(self, solver):
        self.run = lambda model, law, *_: solver.run(model, law)


def led_by_surrogate(fit):
    """Return the problem of a fit, whose solver leaves derivatives to a surrogate."""
    leading = fit.setup.problem()
    problem = leading.with_solvers([WithoutDerivatives(c.solver) for c in leading.comparisons])
    problem.surrogate = leading
    return problem


def test_derivatives_of_solver_and_surrogate_give_same_certainty(strips_fit):
    problem, known = strips_fit.setup.problem(), strips_fit.best.certainty
    again = best_fit(problem, strips_fit.best.records, 0.0)
    assert again.with_derivatives is again.point and again.point.jacobian is not None
    assert again.certainty is None
    for name, sigma in with_certainty(strips_fit.setup, problem, again).certainty.sigma.items():
        np.testing.assert_allclose(sigma, known.sigma[name], rtol=1e-12)
    problem = led_by_surrogate(strips_fit)
    again = best_fit(problem, strips_fit.best.records, 0.0)
    assert again.point.jacobian is None
    assert again.with_derivatives is not None and again.with_derivatives.jacobian is not None
    assert with_certainty(strips_fit.setup, problem, again).certainty is not None
    problem.surrogate.evaluate = lambda *_, **__: None
    again = best_fit(problem, strips_fit.best.records, 0.0)
    assert again.with_derivatives is None
    assert with_certainty(strips_fit.setup, problem, again) is again


def test_residual_of_a_fit_is_the_solvers_and_not_that_of_its_surrogate(strips_fit):
    problem = led_by_surrogate(strips_fit)
    evaluate = problem.surrogate.evaluate

    def off(*arguments, **options):
        point = evaluate(*arguments, **options)
        return replace(point, residual=point.residual + 0.1, value=point.value + 1.0)

    problem.surrogate.evaluate = off
    again = best_fit(problem, strips_fit.best.records, 0.0)
    np.testing.assert_array_equal(again.with_derivatives.residual, again.point.residual)
    assert again.with_derivatives.value == again.point.value


def test_given_noise_makes_the_uncertainty(bubble, tmp_path):
    fit, sigmas = bubble.fit, []
    for noise in (0.02, 0.2):
        said = ("[bubble.match]", f"noise = {noise}\n[bubble.match]")
        project = read_project(known_bubble(tmp_path, said))
        problem = prepare_fit(project, [*project.tests.values()]).problem()
        point = problem.evaluate(fit.best.point.unknowns, True, warm=False)
        sure = certainty(problem, point, fit.law, fit.best.valid)
        assert sure.noise.level == {"bubble": noise}
        assert problem.comparisons[0].objective.noise_is == "given"
        sigmas.append(sure.linear_sigma["E1"])
    np.testing.assert_allclose(sigmas[1], 10 * sigmas[0], rtol=1e-6)


#: Quads of the fit's disk; of a mesh so fine beside it that it is the limit.
COARSE, FINE = 192, 7200


def known(elements):
    project = bf.read_project(KNOWN).with_fit(starts=1)
    (test,) = project.tests.values()
    case = replace(test, elements=COARSE, data=replace(test.data, elements=elements))
    project = project.with_fit(mesh_error="told")
    return bf.fit(replace(project, tests={test.name: case}))


@pytest.fixture(scope="module")
def off():
    return known(FINE)


@pytest.fixture(scope="module")
def own():
    return known(COARSE)


def errors(fitted):
    """By modulus: how far the truth is off the fit along its strains, and how far it is said to."""
    sure, (test,) = fitted.best.certainty, fitted.setup.tests
    return [
        (test.known.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0, sure.mesh[name])
        for name, strain in sure.strain.items()
    ]


def test_estimated_mesh_error_is_the_true_error(off):
    for true, said in errors(off):
        largest = np.abs(true).max()
        assert largest > 0.07
        assert np.abs((1 + said) / (1 + true) - 1).max() < largest / 3


def test_data_of_the_same_mesh_have_no_mesh_error(own):
    for true, said in errors(own):
        assert np.abs(true).max() < 1e-3
        assert np.abs(said).max() < 1e-3
    best = replace(own.best.with_derivatives, residual=0 * own.best.with_derivatives.residual)
    limit = limit_of(own.problem, best, best.residual, 2.0)
    assert not limit.step.any() and not limit.residual.any()


def test_mesh_error_beyond_noise_is_noted():
    strain = dict.fromkeys(COMPONENTS, np.array([0.0, 0.05, 0.1]))
    sigma = {"E1": [0.02, 0.03, 0.03], "E2": [0.001] * 3, "G12": [0.5] * 3}
    mesh = {"E1": [0.01, -0.044, 0.031], "E2": [0.009] * 3, "G12": [-0.4] * 3}
    sigma, mesh = ({n: np.array(v) for n, v in of.items()} for of in (sigma, mesh))

    def with_mesh(changes, taken_out=False):
        """A certainty whose noise has the sigmas above, beside an error of the mesh."""
        sure = Certainty(None, {}, sigma, (), changes, None, None, taken_out)
        moduli = {
            name: ReportedModulus(strain[name], *[np.ones(3)] * 3, np.hypot(own, left), *[no] * 2)
            for (name, own), left in zip(sigma.items(), sure.of_mesh.values(), strict=True)
        }
        return replace(sure, moduli=moduli)

    no = np.zeros(3, dtype=bool)
    told = with_mesh(mesh)
    for name, own in sigma.items():
        assert told.noise_sigma[name] == pytest.approx(own)
    (note,) = notes_of_mesh(told)
    assert note.kind is MESH
    assert "E1" in note and "-4.4 %" in note and "5 % of" in note and "(3 %)" in note
    # Of what is taken out a tenth may be left, of the modulus that is reported.
    assert not notes_of_mesh(with_mesh(mesh, True))
    large = {**mesh, "E1": np.array([0.0, 0.5, 1.0])}
    (note,) = notes_of_mesh(with_mesh(large, True))
    assert (note.kind, note.kind.weight) == (MESH, 16) and "+100 %" in note and "(3 %)" in note


class Unable:
    """A test of a kind that has nothing finer."""


def test_mesh_error_is_unknown_where_finer_mesh_cannot_run(off, monkeypatch):
    plain = replace(off.best, certainty=None)

    def again(**changes):
        return with_certainty(replace(off.setup, **changes), off.problem, plain)

    assert again(tests=(Unable(),)).certainty.mesh is None
    # An error that is not known is not taken out.
    settings = off.project.fit.model_copy(update={"mesh_error": "taken out"})
    best = again(tests=(Unable(),), project=replace(off.project, fit=settings))
    assert best.law is off.best.law and not best.certainty.taken_out
    assert "not taken out" in best.certainty.notes[-1]
    monkeypatch.setattr(type(off.problem.solver), "external", True)
    assert again().certainty.mesh is None
    monkeypatch.undo()
    for error in (SolverFailure("no equilibrium", "membrane"), InputError(None, "elements", "no")):
        monkeypatch.setattr(mesh_error, "residual_of", lambda *_, e=error: (_ for _ in ()).throw(e))
        sure = again().certainty
        assert sure.mesh is None and sure.noise_sigma == sure.sigma
        assert sure.notes[-1].kind is UNKNOWN
        assert str(sure.notes[-1]).startswith("the error of the mesh is not known: ")


def test_residual_of_mesh_error_is_no_noise(off):
    before = off.misfits["bubble"].rms
    assert before > 0.02
    assert off.best.certainty.noise.level["bubble"] == 0.05  # the least, whatever is left
    problem, best = off.problem, off.best.with_derivatives
    (test,) = off.setup.tests
    finer = test.finer(off.setup.make_solver, Weighting(), 2.0)
    limit = limit_of(problem, best, residual_of(problem, finer, best, off.law), 2.0)
    assert float(np.sqrt(np.mean((limit.residual * problem.scale) ** 2))) < 0.5 * before
    with pytest.raises(SolverFailure, match="does not give what was matched"):
        residual_of(problem, problem.comparisons * 2, best, off.law)


def corrected(fitted):
    """Return the fit as it is by default: what the mesh moves is taken out."""
    setup = replace(
        fitted.setup, project=fitted.project.with_fit(mesh_error=FitSection().mesh_error)
    )
    plain = replace(fitted.best, certainty=None)
    return replace(fitted, setup=setup, best=with_certainty(setup, fitted.problem, plain))


def with_mesh_error(fitted, monkeypatch, error):
    """Return the fit, corrected by default, as if a finer mesh gave another residual."""
    monkeypatch.setattr(mesh_error, "residual_of", lambda _p, _f, best, _l: best.residual + error)
    return corrected(fitted)


def assert_possible(fitted, folder):
    """Every modulus, sigma and band of a fit, of its card and of its draws is possible."""
    table = fitted.moduli()
    least = table["modulus"].map(fitted.problem.unknowns.bounds.smallest)
    assert (table["MPa"] >= least - 1e-6 * table["MPa"].abs()).all()
    assert (table["lower_MPa"] >= 0.0).all() and (table["upper_MPa"] >= table["MPa"]).all()
    assert (table[["sigma_relative", "noise_relative"]] >= 0.0).all(axis=None)
    assert (table["mesh_relative"] > -1.0).all()
    assert all(answer.sigma >= 0.0 < answer.value for answer in answers(fitted.best, 1.0))
    fitted.card.write(folder / "card.toml")
    card = read_card(folder / "card.toml")
    for law in [*fitted.laws, *fitted.draw_laws(20), *card.certainty.laws(card.law, 5, ROUND)]:
        assert is_positive(replace(law, strain_range=fitted.best.valid))


ROUND = np.random.default_rng(0)


def test_correction_beyond_linear_step_is_not_taken(off, monkeypatch, tmp_path):
    plain = off.best.with_derivatives.residual
    (test,) = off.setup.tests
    finer = test.finer(off.setup.make_solver, Weighting(), 2.0)
    error = mesh_error.residual_of(off.problem, finer, off.best.with_derivatives, off.law) - plain
    fitted = with_mesh_error(off, monkeypatch, 30.0 * error)
    sure = fitted.best.certainty
    # The law is that of the mesh, and its band reaches to that of finer meshes, within the bounds.
    assert fitted.law is off.law and not sure.taken_out and sure.corrected is not None
    assert off.problem.unknowns.keeps_bounds(sure.corrected.best)
    assert max(np.abs(change).max() for change in sure.mesh.values()) > LARGEST_CORRECTION
    for name, strain in sure.strain.items():
        limit = fitted.law.modulus(name, strain) * (1.0 + sure.mesh[name])
        lower, upper = sure.moduli[name].band
        assert (lower <= fitted.law.modulus(name, strain)).all()
        assert ((lower <= 1.05 * limit) & (0.95 * limit <= upper)).all()
    assert_possible(fitted, tmp_path)

    first = gravest_notes(fitted.notes)[0]
    assert first.kind is TOO_LARGE and "a linear step is not valid" in first
    assert not [note for note in fitted.notes if note.kind in (MESH, TAKEN_OUT)]
    verdict = fitted.verdict
    assert verdict.state == "not to be used"
    assert verdict.reasons[0] == "the error of the mesh is too large to be taken out"
    assert verdict.next_step == "fit on a finer mesh (more elements)"
    unfinished = replace(
        fitted.best,
        ranked=[replace(record, status=ANALYSES_USED_UP) for record in fitted.best.ranked],
    )
    verdict = replace(fitted, best=unfinished).verdict
    assert verdict.reasons[:2] == (
        "the fit has not converged", "the error of the mesh is too large to be taken out"
    )  # fmt: skip
    assert verdict.next_step.startswith("let it run longer")


@pytest.mark.parametrize("seed", range(12))
def test_no_mesh_error_makes_a_modulus_impossible(off, monkeypatch, tmp_path, seed):
    random = np.random.default_rng(seed)
    plain = off.best.with_derivatives.residual
    size = 10.0 ** random.uniform(-2.0, 3.0) * np.abs(plain).mean()
    error = size * random.standard_normal(len(plain))
    assert_possible(with_mesh_error(off, monkeypatch, error), tmp_path)


def test_corrected_fit_is_nearer_to_the_truth(off):
    (test,) = off.setup.tests
    for name, (told, out) in {"E1": (0.07, 0.02), "E2": (0.07, 0.02), "G12": (0.2, 0.07)}.items():
        strain = off.best.certainty.strain[name]
        true = test.known.modulus(name, strain)
        for fitted, least, most in ((off, told, 1.0), (corrected(off), 0.0, out)):
            wrong = np.abs(fitted.law.modulus(name, strain) / true - 1.0).max()
            assert least < wrong < most, name


def test_corrected_moduli_lie_well_within_their_band(off):
    """Value and band weigh the data alike, whatever the noise beside what is left."""
    fitted = corrected(off)
    sure = fitted.best.certainty
    sigma = np.sqrt(np.diag(sure.corrected.covariance))
    assert (np.abs(sure.corrected.centre - sure.corrected.best) < 0.06 * sigma).all()
    for name, strain in sure.strain.items():
        value = fitted.law.modulus(name, strain)
        low, high = sure.moduli[name].band
        room = np.minimum(value - low, high - value) / (high - low)
        assert room.min() > 0.3, name


@pytest.mark.parametrize("change", [lambda fitted: fitted, corrected], ids=["told", "taken out"])
def test_band_is_the_same_in_card_export_table_and_terminal(off, change, tmp_path):
    """Card and export, moduli.csv and terminal: the same ends, and the value between them."""
    fitted = change(off)
    table, told = fitted.moduli(), answers(fitted.best, fitted.thickness)
    fitted.card.write(tmp_path / "card.toml")
    card = read_card(tmp_path / "card.toml")
    beside = pd.read_csv(StringIO(band_table(card, "MPa")), comment="#")
    for name in COMPONENTS:
        mine, export = (t[t["modulus"] == name] for t in (table, beside))
        for rows in (mine, export):
            assert (rows["lower_MPa"] <= rows["MPa"]).all()
            assert (rows["MPa"] <= rows["upper_MPa"]).all()
        for end in ("lower_MPa", "upper_MPa"):
            again = np.interp(export["log_strain"], mine["strain"], mine[end])
            assert export[end].to_numpy() == pytest.approx(again, rel=2e-3)
        for one in (one for one in told if one.modulus == name):
            assert one.band[0] <= one.value <= one.band[1]
            ends = [float(end[0]) for end in card.certainty.band(card.law, name, [one.strain])]
            assert ends == pytest.approx(one.band, rel=1e-5)


def test_mesh_error_is_taken_out_of_moduli(off):
    fitted = off
    again = corrected(fitted)
    best, plain = again.best, replace(fitted.best, certainty=None)
    told, sure = fitted.best.certainty, best.certainty
    assert sure.taken_out and not told.taken_out
    assert best.point is plain.point and best.point.value == fitted.objective
    a, c = fitted.problem.unknowns.inequalities
    assert (a @ sure.corrected.best >= c - 1e-9).all()
    for name, strain in sure.strain.items():
        moved = best.law.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0
        assert moved == pytest.approx(told.mesh[name], abs=1e-12)
        # What may be left is a tenth of it; the band is about the card.
        left = 0.1 * sure.mesh[name] / (1.0 + sure.mesh[name])
        linear = np.hypot(sure.linear_sigma[name], left)
        share = sure.linear_sigma[name] / linear
        assert sure.noise_sigma[name] == pytest.approx(sure.sigma[name] * share)
        for which, law in ((sure, best.law), (told, fitted.law)):
            lower, upper = which.moduli[name].band
            own = law.modulus(name, strain)
            assert (lower <= own).all() and (own <= upper).all()
        wide, narrow = (np.ptp(which.moduli[name].band, axis=0) for which in (told, sure))
        assert (narrow <= wide * (1 + 1e-9)).all()
    (note,) = [n for n in sure.notes if n.kind is TAKEN_OUT]
    assert "is taken out of the moduli (E1 " in note
    assert not [n for n in sure.notes if n.kind is MESH]
    assert again.card.source.endswith(", error of the mesh taken out")
    assert again.law is best.law and again.laws[0] is best.law
    rows = again.moduli().query("modulus == 'E1'")
    assert rows["upper_MPa"].to_numpy() == pytest.approx(sure.moduli["E1"].upper, rel=1e-9)
