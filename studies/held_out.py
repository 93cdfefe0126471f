"""A law judged at a test that it was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..experiments.base import MakeSolver
from ..experiments.fittable import FittedTest, Masks, PreparedTest, Weighting
from ..experiments.notes import beyond, strains_of, unstable_words
from ..fits.best import LEAST_STRAIN
from ..identification.blocks import Blocks
from ..identification.given_law import evaluate_law, problem_at
from ..identification.problem import Evaluation, FitProblem
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from .folds import errors

#: Values of what is no law, by comparison and name, in its units.
NuisanceValues = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How a law does at one test.

    test : its name. error : mean relative RMS error, None where an analysis failed. rms : by
    comparison, in `unit`s. notes : what a reader should know of it. words, numbers : what the test
    itself says of how good it is, as it does of a fit.
    """

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()
    words: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


def held_out(prepared: PreparedTest, law: HypoelasticLaw, make_solver: MakeSolver) -> HeldOut:
    """Run a law on a test; what the test leaves open beside the law is fitted to it.

    law : with the strain range for which it is known.
    """
    name = prepared.test.name
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True))
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    point = evaluate_law(problem, y)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units)
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    rms = errors(problem, point.residual)
    own = prepared.findings(_fitted(prepared, problem, point, law, make_solver))
    return HeldOut(name, point.value, rms, units, notes, own.quality, own.numbers)


def held_out_part(
    prepared: PreparedTest,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
    part: Masks,
    nuisance: NuisanceValues,
    name: str,
) -> HeldOut:
    """Run a law on a test and judge it at a part of it alone.

    What the test leaves open beside the law is what the fit to the rest of it has found.

    Parameters
    ----------
    part : the points of the part, of every comparison of the test. nuisance : by comparison and
    name. name : of the test with its part.
    """
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True), part)
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    for comparison in comparisons:
        known = nuisance.get(comparison.name, {})
        places = problem.unknowns.nuisance_places(comparison.name)
        y[places] = [known.get(n.name, 0.0) for n in comparison.nuisance]
    point = problem.evaluate(y, False, warm=False)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units)
    blocks = point.residual[: sum(sum(c.objective.sizes) for c in comparisons)]
    error = float(np.sum(Blocks([n for c in comparisons for n in c.objective.sizes]).norms(blocks)))
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    return HeldOut(name, error, errors(problem, point.residual), units, notes)


def not_judged(name: str, why: str, units: Mapping[str, str]) -> HeldOut:
    """Of a test, or a part of it, at which no law was judged."""
    return HeldOut(name, None, {}, units, (Note(NoteKind.FAILED, why, name),))


def _fitted(
    prepared: PreparedTest,
    problem: FitProblem,
    point: Evaluation,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
) -> FittedTest:
    """The test as it is after a fit, in its own objective."""
    reached = np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)
    own = prepared.comparisons(make_solver, Weighting())
    values = [problem.unknowns.nuisance_values(c.name, point.unknowns) for c in own]
    nuisance = {name: value for of_one in values for name, value in of_one.items()}
    valid = np.minimum(reached, law.strain_range)
    return FittedTest(own, point.histories, nuisance, law, [law], reached, valid, None)


def _notes(problem: FitProblem, point: Evaluation, law: HypoelasticLaw) -> list[Note]:
    notes = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        part = comparison.name if len(problem.comparisons) > 1 else ""
        words = [
            Note(
                NoteKind.BEYOND_CARD,
                f"{strain} strain {at:.3f} is beyond {end:.3f}, up to which the law is known: "
                "modulus held there",
                part,
            )
            for strain, at, end in beyond(strains_of(history), law.strain_range)
        ]
        unstable = [Note(n.kind, str(n), part) for n in unstable_words(history.unstable)]
        notes += [*words, *unstable]
    return notes
