"""The error of the mesh in the moduli of a fit: one analysis of a finer model at the best fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..experiments.refinable import Refinable
from ..identification.assessment import Certainty
from ..identification.discretisation import Limit, limit_of, residual_of
from ..identification.problem import FitProblem
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind
from .best import BestFit
from .setup import FitSetup
from .shared import with_shared

Array = NDArray[np.float64]

#: Elements and increments are divided by it, once.
FINER = 2.0
#: What a project says of it (`fit.mesh_error`).
TOLD, TAKEN_OUT = "told", "taken out"
#: Less of a modulus is no matter, whatever the noise.
LEAST = 0.01


def limit_of_meshes(setup: FitSetup, problem: FitProblem, best: BestFit) -> Limit | None:
    """Where ever finer meshes would take the best fit, and what they would leave.

    None where its derivatives are not known, where another program runs the tests (a finer run of
    it is not made unasked), or where a kind of test knows no finer model.

    Raises
    ------
    InputError, SolverFailure : the finer model cannot be made or does not run.
    """
    if best.differentiated is None or problem.solver.external:
        return None
    if not all(isinstance(test, Refinable) for test in setup.tests):
        return None
    finer = [
        comparison
        for test, weighting in zip(setup.tests, setup.weightings, strict=True)
        if isinstance(test, Refinable)
        for comparison in test.finer(setup.make_solver, weighting, FINER)
    ]
    finer = [*with_shared(finer, problem.unknowns.nuisance.shared)]
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


def note_of_limit(mesh: dict[str, Array]) -> Note:
    """That the card is not that of the mesh that the fit was run with."""
    by = ", ".join(f"{name} {100 * off[np.abs(off).argmax()]:+.2g} %" for name, off in mesh.items())
    words = (
        f"the error of the mesh is taken out of the moduli ({by} at most): the card is the law of "
        "ever finer meshes, to first order; objective, residuals and what is drawn of the tests "
        "are those of the mesh of the fit"
    )
    return Note(NoteKind.TAKEN_OUT, words)
