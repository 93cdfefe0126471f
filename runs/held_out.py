"""The errors of a law at a test that it was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..experiments.base import MakeSolver, Masks, PreparedTest, Weighting
from ..experiments.fitted import FittedTest
from ..experiments.presenter import presenter_of
from ..experiments.run_records import unstable_words
from ..experiments.strains import notes_beyond, strains_of
from ..inference.noise import misfits
from ..inference.problem import ANALYSES_USED_UP, Evaluation, FitProblem
from ..inference.search import fit_nuisance, problem_at
from ..materials.law import HypoelasticLaw
from ..notes import Note
from .best import reached_by
from .simulation import FAILED
from .verdict import NOT_CONVERGED

NUISANCE_NOT_CONVERGED = (
    "offsets and sheet of the test had not converged after {} analyses: its error may be smaller"
)
#: Values of nuisance unknowns by comparison and name, in their units.
NuisanceValues = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The errors of a law at one test.
    error : mean relative RMS error, None where an analysis failed. rms : by comparison, in `units`.
    words, numbers : the quality in the test's own terms, as of a fit."""

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()
    words: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


def held_out(
    prepared: PreparedTest,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
    part: Masks | None = None,
    nuisance: NuisanceValues | None = None,
    name: str = "",
) -> HeldOut:
    """Run a law, with its known strain range, on a test and fit the test's nuisance unknowns.
    part : judge it at these points alone, with `nuisance` values of the rest; name : of the part.
    """
    name = name or prepared.test.name
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True), part)
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    status = ""
    if nuisance is None:
        point, status = fit_nuisance(problem, y)
    else:
        for comparison in comparisons:
            known = nuisance.get(comparison.name, {})
            places = problem.unknowns.nuisance_places(comparison.name)
            y[places] = [known.get(n.name, 0.0) for n in comparison.nuisance]
        point = problem.evaluate(y, False, warm=False)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units)
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    if status == ANALYSES_USED_UP:
        notes += (Note(NOT_CONVERGED, NUISANCE_NOT_CONVERGED.format(problem.analyses), name),)
    rms = errors(problem, point.residual)
    if nuisance is not None:
        norms = np.concatenate(list(problem.norms(point.residual).values()))
        return HeldOut(name, float(norms.sum()), rms, units, notes)
    # As after a fit, in the test's own objective.
    reached = reached_by(point)
    each = nuisance_of(problem, point.unknowns).values()
    fitted = FittedTest(
        prepared.comparisons(make_solver, Weighting()),
        point.histories,
        {name: value for of_one in each for name, value in of_one.items()},
        law,
        [law],
        reached,
        np.minimum(reached, law.strain_range),
        None,
    )
    own = presenter_of(prepared.test.kind).findings(prepared, fitted)
    return HeldOut(name, point.value, rms, units, notes, own.quality, own.numbers)


def not_judged(name: str, why: str, units: Mapping[str, str]) -> HeldOut:
    """Return the errors of a test, or a part of it, without any."""
    return HeldOut(name, None, {}, units, (Note(FAILED, why, name),))


UP_TO = "{} strain {} % is beyond {} %, up to which the law is known: modulus held there"


def _notes(problem: FitProblem, point: Evaluation, law: HypoelasticLaw) -> list[Note]:
    notes = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        part = comparison.name if len(problem.comparisons) > 1 else ""
        held = notes_beyond(strains_of(history), law.strain_range, words=UP_TO)
        own = [*held, *unstable_words(history.unstable)]
        notes += [Note(n.kind, str(n), part) for n in own]
    return notes


def nuisance_of(problem: FitProblem, y: np.ndarray) -> NuisanceValues:
    """Return the values of the nuisance unknowns of every comparison."""
    return {c.name: problem.unknowns.nuisance_values(c.name, y) for c in problem.comparisons}


def errors(problem: FitProblem, residual: np.ndarray) -> dict[str, float]:
    """Return the root mean square by comparison, in its unit."""
    return {name: misfit.rms for name, misfit in misfits(problem, residual).items()}
