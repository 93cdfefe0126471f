"""Estimate moduli by virtual work on the measured shapes, and start fits there."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arguments import checked_arguments
from ..errors import InputError, SolverFailure
from ..inference.assessment import certainty
from ..inference.bounded_step import bounded_step
from ..inference.comparison import Comparison
from ..inference.descent import DescentSettings, descend
from ..inference.noise import misfits
from ..inference.problem import Evaluation, FitProblem
from ..inference.starts import EstimatedStarts
from ..inference.weighted_problem import WeightedProblem
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..meshes.bubble_model import MeasuredShape
from ..notes import Note, NoteKind, note_records
from ..processes import one_blas_thread
from ..project.project import Project
from ..version import __version__
from .answers import answer_numbers
from .best import BestFit, reached_by
from .setup import FitSetup, prepare_fit

log = logging.getLogger(__name__)

METHOD = "virtual work"
NOT_ESTIMATED = NoteKind("not estimated")
GAP = NoteKind("not in equilibrium", weight=11)

#: Analyses and tolerance of the descent, which ends early: an estimate need not be exact.
MOST, TOLERANCE = 40, 1e-9
ESTIMATE = DescentSettings(negligible_decrease=1e-4, settled_decrease=1e-2, settled_steps=2)
#: Chi beyond which shape and law are at odds, by more than noise.
LARGE = 2.0
UNBALANCED = (
    "no law within the bounds keeps the measured shape in equilibrium (chi {:.3g}): rim, reference "
    "surface or noise are not as the project says (its unknowns are taken as zero here), or the "
    "form of the law is wrong"
)


@dataclass(frozen=True, eq=False)
class Gap:
    """The distance of one comparison from equilibrium with the estimated law.
    chi : it over the noise, one where nothing but noise is left. rms : in `unit`s, of rows that err
    independently. places (n, 2) mm and field (n, 3) mm, the displacement from the measured shape to
    equilibrium in the last frame, to first order; None where no shape was measured."""

    name: str
    chi: float
    rms: float
    unit: str
    places: Array | None = None
    field: Array | None = None

    @property
    def words(self) -> str:
        if self.field is None:
            return f"{self.rms:.3g} {self.unit} RMS are left, chi {self.chi:.3g}"
        most = float(np.linalg.norm(self.field, axis=1).max())
        return f"the measured shape is up to {most:.2g} mm off equilibrium, chi {self.chi:.3g}"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Moduli by virtual work, as `Fit` has those of a fit; unknowns beside the moduli are as said.
    seconds : of processor time, without reading the data."""

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    gaps: Sequence[Gap]
    seconds: float
    notes: Sequence[Note]

    @property
    def project(self) -> Project:
        return self.setup.project

    @property
    def law(self) -> HypoelasticLaw:
        return self.best.law

    @property
    def thickness(self) -> float:
        return self.project.fabric.thickness

    @property
    def result(self) -> dict[str, Any]:
        return {
            "command": "estimate",
            "version": __version__,
            "method": METHOD,
            "moduli": answer_numbers(self.best, self.thickness),
            "chi": {gap.name: gap.chi for gap in self.gaps},
            "cpu_s": self.seconds,
            "notes": note_records(self.notes),
        }

    def lines(self) -> list[str]:
        return [f"{gap.name}: {gap.words}" for gap in self.gaps]


@checked_arguments
def estimate(project: Project, tests: str | Sequence[str] | None = None) -> Estimate:
    """Estimate the moduli of a project by virtual work: no equilibrium of a bubble is solved for.

    tests : names or a kind, by default all that can be fitted. InputError : in the project or its
    data, or no test that can be estimated from. SolverFailure : no law within the bounds fits.
    """
    chosen = project.chosen(tests, fitted=True)
    return estimate_of(prepare_fit(project, chosen))


def estimate_of(setup: FitSetup) -> Estimate:
    """Return the estimate of prepared tests; raises as `estimate`."""
    begun = time.process_time()
    comparisons: list[Comparison] = []
    notes: list[Note] = []
    with one_blas_thread():
        for test in setup.tests:
            try:
                comparisons += test.virtual_work(setup.make_leading)
            except InputError as error:
                notes.append(Note(NOT_ESTIMATED, f"{error.field} {error.problem}", test.test.name))
        if not comparisons:
            raise InputError(setup.project.path, "tests", f"no estimate: {notes[0]}")
        alone = [replace(one, nuisance=()) for one in comparisons]
        problem, point = _fitted(setup, alone, {})
        if len(alone) > 1:  # what each leaves is its noise, so that none outvotes the others
            left = misfits(problem, point.residual).items()
            problem, point = _fitted(setup, alone, {k: max(m.rms, m.noise) for k, m in left})
        law = problem.unknowns.law(problem.law, point.unknowns)
        best = BestFit(point, point, law, (), (), reached_by(point))
        sure = certainty(problem, point, law, best.valid)
    gaps = []
    free = 1.0 - problem.unknowns.count / len(point.residual)
    every = misfits(problem, point.residual)
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        m = every[comparison.name]
        model = comparison.model
        gap = Gap(comparison.name, m.ratio / max(free, 0.1) ** 0.5, m.rms, m.unit)
        if isinstance(model, MeasuredShape):
            gap = replace(gap, places=model.mesh.points[:, :2], field=history.displacement[-1])
        gaps.append(gap)
        if gap.chi > LARGE and gap.field is not None:
            notes.append(Note(GAP, UNBALANCED.format(gap.chi), gap.name))
    seconds = time.process_time() - begun
    return Estimate(setup, problem, replace(best, certainty=sure), gaps, seconds, notes)


def with_start(setup: FitSetup) -> FitSetup:
    """Return a fit whose first start is the estimate, if that is asked for and there is one."""
    if setup.project.fit.starts_from != "estimate":
        return setup
    try:
        found = estimate_of(setup)
    except (InputError, SolverFailure) as error:
        log.warning("all starts are drawn at random: %s", str(error).splitlines()[0])
        return setup
    return replace(setup, starts=EstimatedStarts(found.best.point.coefficients))


def _fitted(
    setup: FitSetup, comparisons: Sequence[Comparison], levels: Mapping[str, float]
) -> tuple[FitProblem, Evaluation]:
    """Return the fit weighed by noise and its best, from the middle of the bounds; SolverFailure.
    levels : noise by name of a comparison, instead of its data's least."""
    own = setup.problem_of(comparisons)
    factors = []
    for one in own.comparisons:
        objective = one.objective
        level = objective.correlated_count * levels.get(one.name, objective.least_noise)
        factors.append(objective.scale * np.repeat(objective.sizes, objective.sizes) ** 0.5 / level)
    problem = WeightedProblem.of(own, np.concatenate(factors))
    # Nearest to moduli in the middle of their bounds that keep all bounds.
    y = np.ones(problem.unknowns.count)
    step = bounded_step(problem.unknowns, np.eye(len(y)), np.zeros(len(y)), y)
    first = problem.evaluate(y if step is None else y + step, True)
    if first is None:
        raise SolverFailure(f"no estimate: {problem.failure}", METHOD)
    best, _ = descend(problem, first, TOLERANCE, MOST, norms=True, settings=ESTIMATE)
    return problem, best
