"""A fit whose residuals are weighted anew."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..materials.forms.base import Array
from .problem import Evaluation, FitProblem


@dataclass(eq=False)
class WeightedProblem(FitProblem):
    """Comparisons and unknowns of a problem, with every residual multiplied by a factor.

    Attributes
    ----------
    factors : (m,) array
    """

    factors: Array = field(default_factory=lambda: np.empty(0))

    @property
    def scale(self) -> Array:
        """Return (m,) units of the data per unit of the multiplied residual."""
        return super().scale / np.where(self.factors > 0, self.factors, 1.0)

    @classmethod
    def of(cls, problem: FitProblem, factors: Array) -> WeightedProblem:
        """Return the fit to a problem's data with factors, with the problem's warm start.

        Parameters
        ----------
        problem : FitProblem
        factors : (m,) array
        """
        comparisons = tuple(replace(comparison) for comparison in problem.comparisons)
        return cls(comparisons, problem.law, problem.unknowns, factors=factors)

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every comparison as `FitProblem.evaluate`, and weight the result."""
        evaluation = super().evaluate(y, with_jacobian, warm)
        return None if evaluation is None else self.weighted(evaluation)

    def weighted(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation of the problem without factors as one of this: nothing is run."""
        residual = self.factors * evaluation.residual
        slope = evaluation.jacobian
        return replace(
            evaluation,
            residual=residual,
            value=self.blocks.value(residual),
            jacobian=None if slope is None else self.factors[:, None] * slope,
        )
