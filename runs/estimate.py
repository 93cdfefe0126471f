"""Estimate of the moduli by the virtual work on measured shapes, as a check and a start of fits."""

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arguments import checked_arguments
from ..errors import InputError, SolverFailure
from ..inference.assessment import certainty
from ..inference.comparison import Comparison
from ..inference.descent import DescentSettings, bounded_step, descend
from ..inference.noise import misfits
from ..inference.problem import Evaluation, FitProblem, WeightedProblem
from ..inference.search import EstimatedStarts
from ..inference.unknowns import Unknowns
from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from ..meshes.bubble_model import MeasuredShape
from ..notes import Note, NoteKind, note_records
from ..processes import one_blas_thread
from ..project.project import Project
from ..version import __version__
from .setup import FitSetup, prepare_fit
from .starts import BestFit, reached_by
from .verdict import answer_numbers

log = logging.getLogger(__name__)

METHOD = "virtual work"
NOT_ESTIMATED = NoteKind("not estimated")
GAP = NoteKind("not in equilibrium", weight=11)

UNBALANCED = (
    "no law within the bounds keeps the measured shape in equilibrium (chi {:.3g}): rim, reference "
    "surface or noise are not as the project says (its unknowns are taken as zero here), or the "
    "form of the law is wrong"
)


@dataclass(frozen=True, eq=False)
class Gap:
    """Hold the distance of one comparison from equilibrium with the estimated law.

    Attributes
    ----------
    name : str
        Name of the comparison.
    chi : float
        Residual of equilibrium divided by its noise; 1 if nothing but noise is left.
    rms : float
        Root mean square of the residual, in `unit`, of rows with independent errors.
    unit : str
        That of the test's residual: "mm" for a measured shape, "N" for strips.
    points : (n, 2) array, mm, or None
        Points of the measured shape, if one was measured.
    displacement : (n, 3) array, mm, or None
        From the measured shape to equilibrium in the last frame, to first order.
    """

    name: str
    chi: float
    rms: float
    unit: str
    points: Array | None = None
    displacement: Array | None = None

    @property
    def words(self) -> str:
        """Return the distance in words."""
        if self.displacement is None:
            return f"{self.rms:.3g} {self.unit} RMS are left, chi {self.chi:.3g}"
        largest = np.linalg.norm(self.displacement, axis=1).max()
        return f"the measured shape is up to {largest:.2g} mm off equilibrium, chi {self.chi:.3g}"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Hold the moduli estimated by virtual work, as `Fit` holds those of a fit.

    Attributes
    ----------
    setup : FitSetup
    problem : FitProblem
        The equations of equilibrium on the measured shapes. Unknowns other than the moduli keep the
        values that the project gives them.
    best : BestFit
    gaps : sequence of Gap
        One for each comparison.
    seconds : float
        Processor time, without reading the data.
    notes : sequence of Note
    """

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    gaps: Sequence[Gap]
    seconds: float
    notes: Sequence[Note]

    @property
    def project(self) -> Project:
        """Return the project of the tests."""
        return self.setup.project

    @property
    def law(self) -> HypoelasticLaw:
        """Return the estimated law."""
        return self.best.law

    @property
    def thickness(self) -> float:
        """Return the thickness of the fabric, mm."""
        return self.project.fabric.thickness

    @property
    def result(self) -> dict[str, Any]:
        """Return the estimate as plain values."""
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
        """Return what a terminal shows of the gaps."""
        return [f"{gap.name}: {gap.words}" for gap in self.gaps]


@checked_arguments
def estimate(project: Project, tests: str | Sequence[str] | None = None) -> Estimate:
    """Estimate the moduli of a project by virtual work, without solving for any equilibrium.

    The law is fitted so that measured shapes are in equilibrium with their loads.

    Parameters
    ----------
    project : Project
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that can be fitted.

    Returns
    -------
    Estimate

    Raises
    ------
    InputError
        The project or its data have an error, or no test allows an estimate.
    SolverFailure
        No law within the bounds fits.
    """
    chosen = project.chosen(tests, fitted=True)
    return estimate_of(prepare_fit(project, chosen))


def estimate_of(setup: FitSetup) -> Estimate:
    """Return the estimate of prepared tests; raises as `estimate`."""
    start_time = time.process_time()
    problem, point, notes = _fit_all(setup)
    with one_blas_thread():
        law = problem.unknowns.law(problem.law, point.unknowns)
        best = BestFit(point, point, law, (), (), reached_by(point))
        best = replace(best, certainty=certainty(problem, point, law, best.valid))
    gaps = _gaps(problem, point)
    for gap in gaps:
        # A chi above 2 is more than noise: the measured shape contradicts the law.
        if gap.chi > 2.0 and gap.displacement is not None:
            notes.append(Note(GAP, UNBALANCED.format(gap.chi), gap.name))
    seconds = time.process_time() - start_time
    return Estimate(setup, problem, best, gaps, seconds, notes)


def _comparisons(setup: FitSetup) -> tuple[list[Comparison], list[float], list[Note]]:
    """Return the comparisons that an estimate matches, their weights, and notes on tests without.

    A weight is that of the test times that of the part.
    """
    comparisons: list[Comparison] = []
    weights: list[float] = []
    notes = []
    for prepared, weighting in zip(setup.tests, setup.weightings, strict=True):
        try:
            of_test = prepared.virtual_work(setup.make_leading)
        except InputError as error:
            problem = f"{error.field} {error.problem}"
            notes.append(Note(NOT_ESTIMATED, problem, prepared.test.name))
            continue
        comparisons += [replace(comparison, nuisance=()) for comparison in of_test]
        weights += [weighting.weight * comparison.weight for comparison in of_test]
    if not comparisons:
        raise InputError(setup.project.path, "tests", f"no estimate: {notes[0]}")
    return comparisons, weights, notes


@one_blas_thread()
def _fit_all(setup: FitSetup) -> tuple[FitProblem, Evaluation, list[Note]]:
    """Fit the equations of all tests; notes are on those without. InputError, SolverFailure."""
    comparisons, weights, notes = _comparisons(setup)
    problem, point = _fit(setup, comparisons, weights, {})
    if len(comparisons) > 1:  # what each leaves is its noise, so that none outvotes the others
        misfit_of = misfits(problem, point.residual).items()
        noise_of = {name: max(misfit.rms, misfit.noise) for name, misfit in misfit_of}
        analyses = problem.analyses
        problem, point = _fit(setup, comparisons, weights, noise_of)
        problem.analyses += analyses
    return problem, point, notes


def _fit(
    setup: FitSetup,
    comparisons: Sequence[Comparison],
    weights: Sequence[float],
    noise_of: Mapping[str, float],
) -> tuple[FitProblem, Evaluation]:
    """Fit the equations weighted by noise from the middle of the bounds; raise SolverFailure.

    `weights` multiply the norms of the comparisons beside that. `noise_of` is the standard
    deviation of one value by name of a comparison, in the unit of its data and in place of their
    least noise.
    """
    unweighted = setup.problem_of(comparisons)
    factors = []
    for comparison, weight in zip(unweighted.comparisons, weights, strict=True):
        objective = comparison.objective
        noise = noise_of.get(comparison.name, objective.least_noise)
        # Minimising norms weighs the squares of a block by the inverse of its norm, which for noise
        # alone is n / correlated_count in a block of n. So each value weighs by the inverse of its
        # variance, and values that err together weigh as one.
        root_of_size = np.sqrt(np.repeat(objective.sizes, objective.sizes))
        root_of_size *= weight / (objective.correlated_count * noise)
        factors.append(objective.scale * root_of_size)
    priors = [n for n in unweighted.unknowns.nuisance.all if n.prior is not None]
    factors.append(np.array([len(priors) ** 0.5 / nuisance.weight for nuisance in priors]))
    problem = WeightedProblem.of(unweighted, np.concatenate(factors))
    # The start is the point within all bounds nearest to moduli in the middle of their bounds, by
    # which unknowns are scaled: there all of them are 1.
    middle = np.ones(problem.unknowns.count)
    step = bounded_step(problem.unknowns, np.eye(len(middle)), np.zeros(len(middle)), middle)
    start = problem.evaluate(middle if step is None else middle + step, True)
    if start is None:
        raise SolverFailure(f"no estimate: {problem.failure}", METHOD)
    # The descent ends early, as an estimate need not be exact.
    settings = DescentSettings(negligible_decrease=1e-4, settled_decrease=1e-2, settled_steps=2)
    best, _ = descend(
        problem, start, tolerance=1e-9, max_analyses=40, norms=True, settings=settings
    )
    return problem, best


def _gaps(problem: FitProblem, point: Evaluation) -> list[Gap]:
    """Return the distance of each comparison from equilibrium at the estimate."""
    free_share = 1.0 - problem.unknowns.count / len(point.residual)
    misfit_of = misfits(problem, point.residual)
    gaps = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        misfit = misfit_of[comparison.name]
        chi = misfit.ratio / max(free_share, 0.1) ** 0.5
        gap = Gap(comparison.name, chi, misfit.rms, misfit.unit)
        model = comparison.model
        if isinstance(model, MeasuredShape):
            points = model.mesh.points[:, :2]
            gap = replace(gap, points=points, displacement=history.displacement[-1])
        gaps.append(gap)
    return gaps


def with_start(setup: FitSetup) -> FitSetup:
    """Return a fit whose first start is the estimate, if that is asked for and there is one.

    Where virtual work gives none, it is the estimate in closed form.
    """
    if setup.project.fit.starts_from != "estimate":
        return setup
    coefficients: Array | None
    try:
        coefficients = _fit_all(setup)[1].coefficients
    except (InputError, SolverFailure) as error:
        coefficients = closed_form_coefficients(setup)
        start = "all starts are" if coefficients is None else "starts after that in closed form are"
        log.warning("%s drawn at random: %s", start, str(error).splitlines()[0])
    return setup if coefficients is None else replace(setup, starts=EstimatedStarts(coefficients))


def closed_form_coefficients(setup: FitSetup, *, pull: float = 1e-3) -> Array | None:
    """Return the free coefficients (MPa) nearest to the closed-form estimates within the bounds.

    Parameters
    ----------
    setup : FitSetup
    pull : float
        Weight of the middle of the bounds, for unknowns that the estimates leave open, beside
        relative differences of E1 and E2 from the estimates.

    Returns
    -------
    (size,) array or None
        None where no test gives an estimate.
    """
    law = setup.law
    unknowns = Unknowns.of(law.form, law.nu12, law.strain_range, setup.bounds)
    rows = [
        unknowns.modulus_rows(name, estimate.strain) / estimate.modulus[:, None]
        for estimate in setup.closed_forms.values()
        for name in ("E1", "E2")
    ]
    if not rows:
        return None
    middle = np.ones(unknowns.count)  # the unknowns in the middle of the bounds
    relative_moduli = np.vstack(rows)  # times unknowns: moduli over their estimates, to become 1
    hessian = relative_moduli.T @ relative_moduli + pull * np.eye(len(middle))
    gradient = relative_moduli.T @ (relative_moduli @ middle - 1.0)
    step = bounded_step(unknowns, hessian, gradient, middle)
    return None if step is None else unknowns.to_coefficients @ (middle + step)
