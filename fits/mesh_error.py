"""The error of the mesh in the moduli of a fit: one analysis of a finer model at the best fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..experiments.refinable import Refinable
from ..identification.assessment import Certainty, certainty
from ..identification.discretisation import Limit, limit_of, residual_of
from ..identification.problem import FitProblem
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind
from .best import BestFit
from .setup import FitSetup

Array = NDArray[np.float64]

#: Elements and increments are divided by it, once.
FINER = 2.0
#: Less of a modulus is no matter, whatever the noise.
LEAST = 0.01


def with_mesh_error(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """The best fit, its certainty with what the mesh does to the moduli.

    What the mesh leaves is then no noise: that is what finer models would leave.

    As it is where its derivatives are not known, where another program runs the tests (a finer
    run of it is not made unasked), or where a kind of test knows no finer model.
    """
    sure, slopes = best.certainty, best.differentiated
    if sure is None or slopes is None or problem.solver.external:
        return best
    if not all(isinstance(test, Refinable) for test in setup.tests):
        return best
    try:
        limit = _limit(setup, problem, best)
    except (InputError, SolverFailure) as error:
        words = f"the error of the mesh is not known: {str(error).splitlines()[0]}"
        sure = replace(sure, undetermined=(*sure.undetermined, Note(NoteKind.MESH, words)))
        return replace(best, certainty=sure)
    if limit is None:
        return best
    left = replace(slopes, residual=limit.residual)
    sure = certainty(problem, left, best.law, best.valid)
    law = best.law.with_beta(problem.unknowns.beta(slopes.unknowns + limit.step))
    mesh = {
        name: law.modulus(name, strain) / best.law.modulus(name, strain) - 1.0
        for name, strain in sure.strain.items()
    }
    told = (*sure.undetermined, *notes_of_mesh(sure, mesh))
    return replace(best, certainty=replace(sure, mesh=mesh, undetermined=told))


def _limit(setup: FitSetup, problem: FitProblem, best: BestFit) -> Limit | None:
    assert best.differentiated is not None
    finer = [
        comparison
        for test, weighting in zip(setup.tests, setup.weightings, strict=True)
        if isinstance(test, Refinable)
        for comparison in test.finer(setup.make_solver, weighting, FINER)
    ]
    residual = residual_of(problem, finer, best.differentiated, best.law)
    return limit_of(problem, best.differentiated, residual, FINER)


def notes_of_mesh(sure: Certainty, mesh: dict[str, Array]) -> list[Note]:
    """Each modulus that the mesh moves by more than the noise does, where that is most."""
    notes = []
    for name in COMPONENTS:
        beyond = np.abs(mesh[name]) - np.maximum(sure.sigma[name], LEAST)
        worst = int(beyond.argmax())
        if beyond[worst] > 0:
            strain, by = sure.strain[name][worst], 100 * mesh[name][worst]
            words = (
                f"on a fine mesh {name} would be {by:+.2g} % at strain {strain:.3f}, more than the "
                f"noise makes uncertain ({100 * sure.sigma[name][worst]:.2g} %): more elements help"
            )
            notes.append(Note(NoteKind.MESH, words))
    return notes
