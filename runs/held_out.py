"""Errors of a law at a test, or at a part of a test, to which it was not fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..experiments.base import FittedTest, MakeSolver, Masks, PreparedTest, Weighting
from ..experiments.forward import notes_beyond, strains_of, unstable_words
from ..experiments.registry import presenter_of
from ..inference.comparison import Comparison
from ..inference.noise import misfits
from ..inference.nuisance_fit import fit_nuisance, problem_at
from ..inference.problem import ANALYSES_USED_UP, Evaluation, FitProblem
from ..materials.law import HypoelasticLaw
from ..notes import Note
from .simulation import FAILED
from .starts import reached_by
from .verdict import NOT_CONVERGED

NUISANCE_NOT_CONVERGED = (
    "offsets and sheet of the test had not converged after {} analyses: its error may be smaller"
)
#: Values of nuisance unknowns (offsets, shape of the sheet) by comparison and by their name.
NuisanceValues = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The errors of a law at one test, or at a part of it.

    Attributes
    ----------
    test : str
        Name of the test, or of a part of it.
    error : float or None
        Mean relative RMS error; None if an analysis failed.
    rms : dict of float
        RMS error by comparison, in `units`.
    units : dict of str
        Unit of each comparison.
    notes : tuple of Note
    words : str
        The quality of the prediction in the terms of the kind of test, as a fit states it.
    numbers : mapping
        The same as plain values.
    analyses : int
        Number of analyses that the prediction took, with those of a fit to the remaining data.
    """

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()
    words: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    analyses: int = 0


def held_out(
    prepared: PreparedTest,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
    part: Masks | None = None,
    nuisance: NuisanceValues | None = None,
    name: str = "",
    parameters: NuisanceValues | None = None,
    thickness: float | None = None,
) -> HeldOut:
    """Run a test with a law, and return its errors with nuisance unknowns fitted or given.

    Parameters
    ----------
    prepared : PreparedTest
    law : HypoelasticLaw
        The law, whose strain range is the one for which it is known.
    make_solver : callable
        Makes a solver.
    part : dict of (m,) bool arrays, optional
        By comparison, the data points at which the law is judged; by default all.
    nuisance : dict, optional
        Values of the nuisance unknowns, such as those of a fit to the rest of the test. By default
        they are fitted to the test.
    name : str
        Name of the part; by default that of the test.
    parameters : dict, optional
        Nuisance values of a fit to other tests: it decides on parameters of decks that it has.
    thickness : float, mm, optional
        That of the fit of the law; by default that of the fabric.
    """
    name = name or prepared.test.name
    of_fabric = prepared.comparisons(make_solver, Weighting(relative=True), part)
    comparisons = _with_thickness(of_fabric, thickness)
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    status = ""
    if nuisance is None and parameters is not None and _decides(parameters, comparisons):
        nuisance = parameters
    if nuisance is None:
        point, status = fit_nuisance(problem, y)
    else:
        point = problem.evaluate(with_nuisance(problem, y, nuisance), False, warm=False)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units, problem.analyses)
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    if status == ANALYSES_USED_UP:
        notes += (Note(NOT_CONVERGED, NUISANCE_NOT_CONVERGED.format(problem.analyses), name),)
    rms = errors(problem, point.residual)
    error = problem.value_of_data(point.residual)
    if nuisance is not None:
        return HeldOut(name, error, rms, units, notes, analyses=problem.analyses)
    findings = presenter_of(prepared.test.kind).findings(
        prepared, fitted_test(prepared, law, make_solver, problem, point, thickness)
    )
    quality = findings.quality, findings.numbers
    return HeldOut(name, error, rms, units, notes, *quality, problem.analyses)


def _decides(parameters: NuisanceValues, comparisons: Sequence[Comparison]) -> bool:
    """Return whether all nuisance unknowns are parameters of decks that another fit has."""
    fitted_names = {name for values in parameters.values() for name in values}
    unknowns = [n for comparison in comparisons for n in comparison.nuisance]
    # Parameters of decks (`drawn`) are those of the material; offsets are of each test.
    return bool(unknowns) and all(n.drawn and n.name in fitted_names for n in unknowns)


def _with_thickness(
    comparisons: Sequence[Comparison], thickness: float | None
) -> tuple[Comparison, ...]:
    """Return comparisons with models of a thickness (mm), or as they are if it is None."""
    if thickness is None:
        return tuple(comparisons)
    return tuple(
        replace(c, model=c.model.with_parameters({"thickness": thickness - c.model.thickness}))
        for c in comparisons
    )


def with_nuisance(problem: FitProblem, y: np.ndarray, nuisance: NuisanceValues) -> np.ndarray:
    """Return unknowns y (unknowns,) with these values of the nuisance, others at their start."""
    unknowns = y.copy()
    # Shared parameters have one value in all comparisons, so that any of them has it.
    shared = {name: value for values in nuisance.values() for name, value in values.items()}
    for comparison in problem.comparisons:
        values = nuisance.get(comparison.name, {})
        positions = problem.unknowns.nuisance_positions(comparison.name)
        unknowns[positions] = [
            (shared if n.shared else values).get(n.name, n.start) for n in comparison.nuisance
        ]
    return unknowns


def fitted_test(
    prepared: PreparedTest,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
    problem: FitProblem,
    point: Evaluation,
    thickness: float | None,
) -> FittedTest:
    """Return a test as a fit would leave it, weighted as if it were the only test."""
    nuisance: dict[str, float] = {}
    for values in nuisance_of(problem, point.unknowns).values():
        nuisance |= values
    reached = reached_by(point)
    return FittedTest(
        comparisons=_with_thickness(prepared.comparisons(make_solver, Weighting()), thickness),
        histories=point.histories,
        nuisance=nuisance,
        law=law,
        laws=[law],
        reached=reached,
        valid=np.minimum(reached, law.strain_range),
        certainty=None,
    )


def not_judged(name: str, reason: str, units: Mapping[str, str], analyses: int = 0) -> HeldOut:
    """Return the record of a test or part that could not be judged, with the reason."""
    return HeldOut(name, None, {}, units, (Note(FAILED, reason, name),), analyses=analyses)


UP_TO = "{} strain {} % is beyond {} %, up to which the law is known: modulus held there"


def _notes(problem: FitProblem, point: Evaluation, law: HypoelasticLaw) -> list[Note]:
    """Return notes on strains beyond the range of the law, and on instability."""
    notes = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        part = comparison.name if len(problem.comparisons) > 1 else ""
        strains = strains_of(history)
        beyond_law = notes_beyond(strains, law.strain_range, words=UP_TO)
        for note in (*beyond_law, *unstable_words(history.unstable)):
            notes.append(Note(note.kind, str(note), part))
    return notes


def nuisance_of(problem: FitProblem, y: np.ndarray) -> NuisanceValues:
    """Return the values of the nuisance unknowns of every comparison."""
    return {c.name: problem.unknowns.nuisance_values(c.name, y) for c in problem.comparisons}


def errors(problem: FitProblem, residual: np.ndarray) -> dict[str, float]:
    """Return the root mean square of the residual by comparison, in its unit."""
    return {name: misfit.rms for name, misfit in misfits(problem, residual).items()}
