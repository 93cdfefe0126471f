"""A law judged at a test that it was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..experiments.base import MakeSolver, PreparedTest, Weighting
from ..experiments.notes import beyond, strains_of, unstable_words
from ..identification.bounds import LawBounds
from ..identification.given_law import evaluate_law
from ..identification.problem import Evaluation, FitProblem
from ..identification.unknowns import Unknowns
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from .folds import errors

#: MPa: the law is given and not looked for; bounds only size the unknowns.
ANY = {"E1": (1e-3, 1e6), "E2": (1e-3, 1e6), "G12": (1e-3, 1e6)}


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How a law does at one test.

    test : its name. error : mean relative RMS error, None where an analysis failed. rms : by
    comparison, in `unit`s. notes : what a reader should know of it.
    """

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()


def held_out(prepared: PreparedTest, law: HypoelasticLaw, make_solver: MakeSolver) -> HeldOut:
    """Run a law on a test; what the test leaves open beside the law is fitted to it.

    law : with the strain range for which it is known.
    """
    name = prepared.test.name
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True))
    ends = law.strain_range.tolist()
    bounds = LawBounds.of_moduli(ANY)
    unknowns = Unknowns.of(law.form, law.nu12, ends, bounds, comparisons)
    problem = FitProblem(comparisons, law, unknowns)
    units = {c.name: c.objective.unit for c in comparisons}
    point = evaluate_law(problem, unknowns.at(law.beta[list(unknowns.free)]))
    if point is None:
        note = Note(NoteKind.FAILED, f"no analysis: {problem.failure}", name)
        return HeldOut(name, None, {}, units, (note,))
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    return HeldOut(name, point.value, errors(problem, point.residual), units, notes)


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
