"""What the mesh does to the moduli of a fit: estimated from one finer run, and told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.bubble.test import BubbleTest
from bubblefit.experiments.kinds import Weighting
from bubblefit.inference.assessment import Certainty
from bubblefit.inference.linear import limit_of, residual_of
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.notes import NoteKind
from bubblefit.runs import best as mesh_error
from bubblefit.runs.best import notes_of_mesh, with_certainty

from ..places import KNOWN
from ..projects import constant_strips

#: Quads of the fit's disk; of a mesh so fine beside it that it is the limit.
COARSE, FINE = 192, 7200


@cache
def fit(own_data: bool = False) -> bf.Fit:
    """The known solution's data of a fine mesh, matched on a coarse one."""
    project = bf.read_project(KNOWN).with_fit(starts=1)
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest)
    data = replace(test.data, elements=COARSE if own_data else FINE)
    case = replace(test, elements=COARSE, data=data)
    return bf.fit(replace(project, tests={test.name: case}))


def errors(fitted: bf.Fit) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """By modulus: how far the truth is off the fit along its strains, and how far it is said to
    be."""
    sure, (test,) = fitted.best.certainty, fitted.setup.tests
    return {
        name: (
            test.known.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0,
            sure.mesh[name],
        )
        for name, strain in sure.strain.items()
    }


def test_the_estimate_is_the_error() -> None:
    """Moduli of a coarse mesh are off by 7 to 28 %; two thirds of that and more is foretold."""
    for name, (true, said) in errors(fit()).items():
        largest = np.abs(true).max()
        assert largest > 0.07, name
        assert np.abs((1 + said) / (1 + true) - 1).max() < largest / 3, name


def test_data_of_the_same_model_have_no_mesh_error() -> None:
    for name, (true, said) in errors(fit(own_data=True)).items():
        assert np.abs(true).max() < 1e-3, name
        assert np.abs(said).max() < 1e-3, name


def test_noise_and_mesh_are_put_together_everywhere() -> None:
    fitted = fit()
    sure = fitted.best.certainty
    table = fitted.moduli()
    for name in COMPONENTS:
        assert sure.total[name] == pytest.approx(
            np.sqrt(sure.sigma[name] ** 2 + sure.mesh[name] ** 2)
        )
        rows = table[table["modulus"] == name]
        for column, along in (
            ("sigma_relative", sure.total),
            ("noise_relative", sure.sigma),
            ("mesh_relative", sure.mesh),
        ):
            expected = np.interp(rows["strain"], sure.strain[name], along[name])
            assert rows[column].to_numpy() == pytest.approx(expected, rel=1e-12)
    said = fitted.result["uncertainty"]
    for name in COMPONENTS:
        assert said["largest_relative_mesh"][name] == np.abs(sure.mesh[name]).max()
        assert said["largest_relative_total"][name] == sure.total[name].max()


def test_a_mesh_that_moves_a_modulus_more_than_the_noise_is_told() -> None:
    strain = np.array([0.0, 0.05, 0.1])
    sure = Certainty({}, dict.fromkeys(COMPONENTS, strain), {
        "E1": np.array([0.02, 0.03, 0.03]), "E2": np.full(3, 0.001), "G12": np.full(3, 0.5),
    }, ())  # fmt: skip
    mesh = {
        "E1": np.array([0.01, -0.044, 0.031]), "E2": np.full(3, 0.009), "G12": np.full(3, -0.4),
    }  # fmt: skip
    (note,) = notes_of_mesh(sure, mesh)
    assert note.kind is NoteKind.MESH
    assert note == (
        "on a fine mesh E1 would be -4.4 % at strain 0.050, more than the noise makes uncertain "
        "(3 %): more elements help"
    )


def test_strips_are_asked_on_finer_quads(tmp_path: Any) -> None:
    """The straight ones are homogeneous: no error."""
    fitted = bf.fit(bf.read_project(constant_strips(tmp_path)), starts=1)
    prepared = fitted.setup.tests[0]
    own = prepared.comparisons(fitted.setup.make_solver, Weighting())
    finer = prepared.finer(fitted.setup.make_solver, Weighting(), 2.0)
    for coarse, fine in zip(own, finer, strict=True):
        assert len(fine.model.mesh.quads) == 4 * len(coarse.model.mesh.quads)
        assert fine.model.elongations == coarse.model.elongations
        assert fine.name == coarse.name
    assert fitted.best.certainty.mesh is not None
    assert all(np.abs(off).max() < 1e-6 for off in fitted.best.certainty.mesh.values())


def test_where_it_cannot_be_known(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted = fit()
    plain = replace(fitted.best, certainty=None)

    def again(**changes: Any) -> Certainty | None:
        setup = replace(fitted.setup, **changes)
        return with_certainty(setup, fitted.problem, plain).certainty

    class Unable:
        """A test of a kind that has nothing finer."""

    assert again(tests=(Unable(),)).mesh is None
    monkeypatch.setattr(type(fitted.problem.solver), "external", True)
    assert again().mesh is None
    monkeypatch.undo()
    for error in (SolverFailure("no equilibrium", "membrane"), InputError(None, "elements", "no")):
        monkeypatch.setattr(mesh_error, "residual_of", lambda *_, e=error: (_ for _ in ()).throw(e))
        sure = again()
        assert sure.mesh is None and sure.total == sure.sigma
        assert sure.undetermined[-1].kind is NoteKind.MESH
        assert str(sure.undetermined[-1]).startswith("the error of the mesh is not known: ")


def test_a_finer_model_of_other_rows_is_refused() -> None:
    fitted = fit()
    problem, best = fitted.problem, fitted.best.differentiated
    with pytest.raises(SolverFailure, match="does not give what was matched"):
        residual_of(problem, problem.comparisons * 2, best, fitted.law)


def test_nothing_to_move() -> None:
    fitted = fit(own_data=True)
    best = replace(fitted.best.differentiated, residual=0 * fitted.best.differentiated.residual)
    limit = limit_of(fitted.problem, best, best.residual, 2.0)
    assert not limit.step.any() and not limit.residual.any()


def test_what_the_mesh_leaves_is_no_noise() -> None:
    """Data without noise: what is left on the coarse mesh is the mesh's, and mostly gone."""
    fitted = fit()
    before = fitted.misfits["bubble"].rms
    assert before > 0.02
    assert fitted.best.certainty.noise["bubble"] == 0.05  # the least, whatever is left
    problem, best = fitted.problem, fitted.best.differentiated
    (test,) = fitted.setup.tests
    finer = test.finer(fitted.setup.make_solver, Weighting(), 2.0)
    limit = limit_of(problem, best, residual_of(problem, finer, best, fitted.law), 2.0)
    after = float(np.sqrt(np.mean((limit.residual * problem.scale) ** 2)))
    assert after < 0.5 * before


def test_the_error_is_taken_out_where_the_project_says_so() -> None:
    """The card is the law of ever finer meshes, within the bounds; objective and run stay."""
    fitted = fit()
    settings = fitted.project.fit.model_copy(update={"mesh_error": "taken out"})
    setup = replace(fitted.setup, project=replace(fitted.project, fit=settings))
    plain = replace(fitted.best, certainty=None)
    best = with_certainty(setup, fitted.problem, plain)
    told, sure = fitted.best.certainty, best.certainty
    assert sure.taken_out and not told.taken_out
    assert best.point is plain.point and best.objective == fitted.objective
    a, c = fitted.problem.unknowns.inequalities
    assert (a @ sure.fine.best >= c - 1e-9).all()
    for name, strain in sure.strain.items():
        moved = best.law.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0
        assert moved == pytest.approx(told.mesh[name], abs=1e-12)
        # What may be left is a tenth of it; the band is about the card.
        assert sure.total[name] == pytest.approx(np.hypot(sure.sigma[name], 0.1 * sure.mesh[name]))
        for which, law in ((sure, best.law), (told, fitted.law)):
            lower, upper = which.band[name]
            own = law.modulus(name, strain)
            assert (lower <= own).all() and (own <= upper).all()
        wide, narrow = (np.ptp(which.band[name], axis=0) for which in (told, sure))
        assert (narrow <= wide * (1 + 1e-9)).all()
    (note,) = [n for n in sure.undetermined if n.kind is NoteKind.TAKEN_OUT]
    assert "is taken out of the moduli (E1 " in note
    assert not [n for n in sure.undetermined if n.kind is NoteKind.MESH]
    again = replace(fitted, setup=setup, best=best)
    assert again.card.source.endswith(", error of the mesh taken out")
    assert again.law is best.law and again.laws[0] is best.law
    rows = again.moduli().query("modulus == 'E1'")
    assert rows["upper_MPa"].to_numpy() == pytest.approx(sure.band["E1"][1], rel=1e-9)


def test_an_error_that_is_not_known_is_not_taken_out() -> None:
    fitted = fit()
    settings = fitted.project.fit.model_copy(update={"mesh_error": "taken out"})

    class Unable:
        """A test of a kind that has nothing finer."""

    project = replace(fitted.project, fit=settings)
    setup = replace(fitted.setup, project=project, tests=(Unable(),))
    best = with_certainty(setup, fitted.problem, replace(fitted.best, certainty=None))
    assert best.law is fitted.best.law and not best.certainty.taken_out
    assert best.certainty.undetermined[-1] == (
        "the error of the mesh is not known here and is not taken out of the moduli"
    )
