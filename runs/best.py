"""The best fit of all starts, confirmed by running its optimum once more."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SolverFailure
from ..experiments.run_records import strains_of
from ..inference.assessment import Certainty
from ..inference.objective import Blocks
from ..inference.problem import Evaluation, FitProblem
from ..materials.forms.base import Array
from ..materials.forms.symmetry import pooled_ends
from ..materials.law import HypoelasticLaw
from ..notes import Note
from .starts import StartRecord

#: Differences of a repeated objective that count as rounding, relative to the objective and to the
#: share of the noise of the data in it.
OBJECTIVE_ROUNDING = 1e-5
NOISE_ROUNDING = 1e-6
#: Least strain that counts as reached, so that no range of strains is empty.
LEAST_STRAIN = 1e-6


@dataclass(frozen=True, eq=False)
class BestFit:
    """The best fit of all starts, with its optimum run once more.

    Attributes
    ----------
    point : Evaluation
        The analysis of the tests at the optimum, by the project's solver.
    with_derivatives : Evaluation or None
        The same analysis with derivatives, which may be those of a surrogate, as its histories then
        are; None if no solver could give them.
    law : HypoelasticLaw
        The law at the optimum.
    ranked : sequence of StartRecord
        The starts that ended with a fit, best first.
    records : sequence of StartRecord
        All starts, by number.
    reached : (3,) array
        Largest strains (eps1, eps2, gamma12) along warp, along fill and in shear over all tests.
    certainty : Certainty or None
        The uncertainty of the fit; None without derivatives.
    notes : tuple of Note
        Which other assumptions on the tests were tried.
    """

    point: Evaluation
    with_derivatives: Evaluation | None
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None = None
    notes: tuple[Note, ...] = ()

    @property
    def valid(self) -> Array:
        """Return the strains (3,) up to which moduli are fitted; beyond, they are held constant."""
        return np.minimum(pooled_ends(self.law.form, self.reached), self.law.strain_range)


def best_fit(problem: FitProblem, records: Sequence[StartRecord], tolerance: float) -> BestFit:
    """Run the optimum of the best start again from the unloaded state, and return the best fit.

    An analysis by another program that fails is tried a second time.

    Parameters
    ----------
    problem : FitProblem
    records : sequence of StartRecord
        At least one of them with a fit.
    tolerance : float
        Absolute difference up to which two objectives are the same.

    Raises
    ------
    SolverFailure
        The optimum cannot be run again, or gives another objective.
    """
    ranked = ranking(records)
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # Without derivatives of the solver, uncertainty follows from those of its surrogate.
    differentiating = problem.differentiating
    gives_derivatives = differentiating is problem
    point = problem.evaluate(unknowns, gives_derivatives, warm=False)
    if point is None and problem.solver.external:
        point = problem.evaluate(unknowns, gives_derivatives, warm=False)
    if point is None:
        message = f"the best fit does not run again: {problem.failure}"
        raise SolverFailure(
            f"{message}; its starts are kept, --resume goes on", problem.solver.name
        )
    check_objective(problem, ranked[0], point, tolerance)
    first = replace(ranked[0], objective=point.value)
    differentiated: Evaluation | None = point
    if not gives_derivatives:
        differentiated = differentiating.evaluate(unknowns, True, warm=False)
        if differentiated is not None:
            # What the solver leaves is the fit's residual, not its difference to the surrogate.
            differentiated = replace(differentiated, residual=point.residual, value=point.value)
    return BestFit(
        point,
        differentiated,
        problem.unknowns.law(problem.law, unknowns),
        [_like(record, first) for record in ranked],
        [_like(record, first) for record in records],
        reached_by(point),
    )


def check_objective(
    problem: FitProblem, record: StartRecord, point: Evaluation, tolerance: float
) -> None:
    """Raise SolverFailure if the analysis `point` does not give the objective of its start."""
    assert record.objective is not None
    noise = sum(noise_of(problem).values())
    largest = max(point.value, record.objective)
    limit = OBJECTIVE_ROUNDING * largest + NOISE_ROUNDING * noise + tolerance
    if abs(point.value - record.objective) > limit:
        raise SolverFailure(
            f"start {record.number} ended with an objective of {record.objective:.6g}, and the "
            f"same moduli give {point.value:.6g} from the unloaded state: the fit hangs on the way "
            "it was reached; more increments usually help",
            problem.solver.name,
        )


def reached_by(point: Evaluation) -> Array:
    """Return the largest strains (eps1, eps2, gamma12) of all analyses, at least `LEAST_STRAIN`."""
    strains = [strains_of(history) for history in point.histories]
    return np.maximum(np.max(strains, axis=0), LEAST_STRAIN)


def _like(record: StartRecord, first: StartRecord) -> StartRecord:
    """Return a record with the objective of `first`, the best start, if it has the same fit."""
    if record.number == first.number:
        return first
    return replace(record, objective=first.objective) if record.same_as == first.number else record


def ranking(records: Sequence[StartRecord]) -> list[StartRecord]:
    """Return the starts that ended with a fit, best first."""
    fitted = [record for record in records if record.objective is not None]
    return sorted(fitted, key=lambda record: (record.objective, record.number))


def noise_of(problem: FitProblem) -> dict[str, float]:
    """Return the share of noise (scatter or instrument) in the objective, by comparison."""
    return {
        c.name: Blocks(c.objective.sizes).value(c.objective.least_noise / c.objective.scale)
        for c in problem.comparisons
    }
