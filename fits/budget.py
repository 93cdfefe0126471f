"""How sure the best fit is: the noise of its data, and the error of its mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..identification.assessment import Certainty, certainty
from ..identification.discretisation import Limit
from ..identification.linear import Linear
from ..identification.noise import Noise
from ..identification.problem import Evaluation, FitProblem
from ..identification.second_order import (
    NOT_DEFINITE,
    TOO_LITTLE,
    WORTH,
    Order,
    definite,
    large,
    second_of,
)
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from .best import BestFit
from .mesh_error import TAKEN_OUT, limit_of_meshes, note_of_limit, notes_of_mesh
from .setup import FitSetup

Array = NDArray[np.float64]

NOT_TAKEN_OUT = "the error of the mesh is not known here and is not taken out of the moduli"


def with_certainty(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """The best fit with its certainty; as it is where its derivatives are not known.

    What the mesh leaves is no noise: that is what finer models would leave. Where the project asks
    for it, the law is that of ever finer meshes; the analysis stays that of the fit.
    """
    slopes = best.differentiated
    if slopes is None:
        return best
    out = setup.project.fit.mesh_error == TAKEN_OUT
    limit, notes = _limit(setup, problem, best)
    law = best.law
    if limit is None and out:
        notes.append(Note(NoteKind.MESH, NOT_TAKEN_OUT))
    elif limit is not None and out:
        law = problem.unknowns.law(law, slopes.unknowns + limit.step)
    sure = _certainty(problem.surrogate or problem, slopes, law, best.valid, limit)
    if sure.mesh is not None:
        notes += [note_of_limit(sure.mesh)] if out else notes_of_mesh(sure, sure.mesh)
    if sure.order is not None:
        notes += sure.order.notes
    told = (*sure.undetermined, *notes)
    sure = replace(sure, undetermined=told, taken_out=out and limit is not None)
    return replace(best, law=law, certainty=sure)


def _certainty(
    problem: FitProblem, best: Evaluation, law: HypoelasticLaw, reached: Array, limit: Limit | None
) -> Certainty:
    """By the first derivatives; by the second where much is left, and they say something else."""
    first = certainty(problem, best, law, reached, limit)
    left = best.residual if limit is None else limit.residual
    if not large(problem, left):
        return first
    noise = Noise.of(problem, left)
    found = second_of(problem, best, noise)
    if not definite(Linear.of(problem, best, noise), found):
        order = Order(False, NOT_DEFINITE, {}, found.directions, found.analyses)
        return replace(first, order=order)
    second = certainty(problem, best, law, reached, limit, found)
    change = {}
    for name, sigma in second.sigma.items():
        by = sigma / first.sigma[name] - 1.0
        change[name] = float(by[np.abs(by).argmax()])
    used = max(map(abs, change.values())) > WORTH
    why = "" if used else TOO_LITTLE
    order = Order(used, why, change, found.directions, found.analyses)
    return replace(second if used else first, order=order)


def _limit(setup: FitSetup, problem: FitProblem, best: BestFit) -> tuple[Limit | None, list[Note]]:
    try:
        return limit_of_meshes(setup, problem, best), []
    except (InputError, SolverFailure) as error:
        words = f"the error of the mesh is not known: {str(error).splitlines()[0]}"
        return None, [Note(NoteKind.MESH, words)]
