"""The best of a fit's starts, run once more from the unloaded state: what counts as its result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..experiments.notes import strains_of
from ..identification.assessment import Certainty
from ..identification.blocks import Blocks
from ..identification.problem import Evaluation, FitProblem
from ..materials.law import HypoelasticLaw
from .start import StartRecord

Array = NDArray[np.float64]

#: Relative difference of an objective and of the same, run again, that is rounding; and of what
#: the data's own noise would add to it, which an objective near zero cannot be told from.
ROUNDING, UNTOLD = 1e-5, 1e-6
#: Least strain that counts as reached.
LEAST_STRAIN = 1e-6


@dataclass(frozen=True, eq=False)
class BestFit:
    """The best fit as it is run again.

    Parameters
    ----------
    point : the analysis by the solver that counts; differentiated : the same point by the solver
        that differentiates, where it could.
    ranked : the starts that ended with a fit, best first, the best with the objective of `point`;
        records : all of them, by number.
    reached : (3,) largest strain (eps1, eps2, gamma12) in all tests. certainty : of
        `budget.with_certainty`; None before it, and where there are no derivatives.
    """

    point: Evaluation
    differentiated: Evaluation | None
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None = None

    @property
    def objective(self) -> float:
        """What the best fit leaves, from the unloaded state."""
        return self.point.value

    @property
    def valid(self) -> Array:
        """(3,) ends of the strains for which the moduli are fitted, not held."""
        return np.minimum(self.reached, self.law.strain_range)


def best_fit(problem: FitProblem, records: Sequence[StartRecord], tolerance: float) -> BestFit:
    """Run the best of the starts again.

    It ran once. Another program that fails now has lost its licence or its machine, most likely,
    and gets a second try.

    Parameters
    ----------
    tolerance : objectives below it are the same.

    Raises
    ------
    SolverFailure : the best fit does not run again, or gives another objective.
    """
    ranked = ranking(records)
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # The derivatives behind what the data could not determine are the surrogate's, if there is one.
    leading = problem.surrogate or problem
    point = problem.evaluate(unknowns, leading is problem, warm=False)
    if point is None and problem.solver.external:
        point = problem.evaluate(unknowns, leading is problem, warm=False)
    if point is None:
        said = f"the best fit does not run again: {problem.failure}"
        raise SolverFailure(f"{said}; its starts are kept, --resume goes on", problem.solver.name)
    first = _repeated(problem, ranked[0], point, tolerance)
    ranked = [_like(r, first) for r in ranked]
    again = [_like(r, first) for r in records]
    strains = [strains_of(h) for h in point.histories]
    reached = np.maximum(np.max(strains, axis=0), LEAST_STRAIN)
    law = problem.unknowns.law(problem.law, unknowns)
    slopes = point if leading is problem else leading.evaluate(unknowns, True, warm=False)
    return BestFit(point, slopes, law, ranked, again, reached)


def _like(record: StartRecord, first: StartRecord) -> StartRecord:
    """A record as it is; that of the best start, or with its fit, as it was run again."""
    if record.number == first.number:
        return first
    return replace(record, objective=first.objective) if record.same_as == first.number else record


def ranking(records: Sequence[StartRecord]) -> list[StartRecord]:
    """The starts that ended with a fit, best first."""
    ended = [r for r in records if r.objective is not None]
    return sorted(ended, key=lambda r: (r.objective, r.number))


def noise_of(problem: FitProblem) -> dict[str, float]:
    """What the data's own noise adds to the objective, by comparison: no law can do better.

    The noise is the specimens' scatter where it is known, or what the instrument is good for.
    """
    return {
        c.name: Blocks(c.objective.sizes).value(c.objective.least_noise / c.objective.scale)
        for c in problem.comparisons
    }


def _repeated(
    problem: FitProblem, record: StartRecord, point: Evaluation, tolerance: float
) -> StartRecord:
    """The record of the best start with the objective that the run from the unloaded state has."""
    assert record.objective is not None
    before, now = record.objective, point.value
    untold = tolerance + UNTOLD * sum(noise_of(problem).values())
    if abs(now - before) > ROUNDING * max(now, before) + untold:
        raise SolverFailure(
            f"start {record.number} ended with an objective of {before:.6g}, and the same moduli "
            f"give {now:.6g} from the unloaded state: the fit hangs on the way it was reached; "
            "more increments usually help",
            problem.solver.name,
        )
    return replace(record, objective=now)
