"""How sure the best fit is: the noise of its data, and the error of its mesh."""

from __future__ import annotations

from dataclasses import replace

from ..errors import InputError, SolverFailure
from ..identification.assessment import certainty
from ..identification.problem import FitProblem
from ..notes import Note, NoteKind
from .best import BestFit
from .mesh_error import limit_of_meshes, moved_moduli, notes_of_mesh
from .setup import FitSetup


def with_certainty(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """The best fit with its certainty; as it is where its derivatives are not known.

    What the mesh leaves is no noise: that is what finer models would leave.
    """
    slopes = best.differentiated
    if slopes is None:
        return best
    limit = None
    unknown: tuple[Note, ...] = ()
    try:
        limit = limit_of_meshes(setup, problem, best)
    except (InputError, SolverFailure) as error:
        words = f"the error of the mesh is not known: {str(error).splitlines()[0]}"
        unknown = (Note(NoteKind.MESH, words),)
    leading = problem.surrogate or problem
    left = None if limit is None else limit.residual
    sure = certainty(leading, slopes, best.law, best.valid, left)
    sure = replace(sure, undetermined=(*sure.undetermined, *unknown))
    if limit is not None:
        law = best.law.with_beta(problem.unknowns.beta(slopes.unknowns + limit.step))
        mesh = moved_moduli(best.law, law, sure.strain)
        told = (*sure.undetermined, *notes_of_mesh(sure, mesh))
        sure = replace(sure, mesh=mesh, mesh_step=limit.step, undetermined=told)
    return replace(best, certainty=sure)
