"""A fit in which single residuals count more, less, or not at all."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]


@dataclass(eq=False)
class WeightedProblem(FitProblem):
    """The same comparisons and unknowns; every residual is multiplied by a factor.

    Parameters
    ----------
    factors : (m,), zero for what does not count.
    """

    factors: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, problem: FitProblem, factors: Array) -> WeightedProblem:
        """The fit to a problem's data, weighted anew; the other problem is left as it is.

        What was differentiated last in the other problem is where the first analysis starts from.
        """
        comparisons = tuple(replace(comparison) for comparison in problem.comparisons)
        return cls(comparisons, problem.law, problem.unknowns, factors=factors)

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every comparison at unknowns y; None when one did not end well."""
        point = super().evaluate(y, with_jacobian, warm)
        return None if point is None else self.seen(point)

    def seen(self, point: Evaluation) -> Evaluation:
        """An analysis of the problem without factors as this one sees it: nothing is run."""
        residual, slope = self.factors * point.residual, point.jacobian
        return replace(
            point,
            residual=residual,
            value=self.blocks.value(residual),
            jacobian=None if slope is None else self.factors[:, None] * slope,
        )
