"""A fit problem with factors on its residuals, as a refit of resampled data needs it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..materials.forms.base import Array
from .problem import Evaluation, FitProblem


@dataclass(eq=False)
class WeightedProblem(FitProblem):
    """A fit problem whose residuals are multiplied by factors.

    Attributes
    ----------
    factors : (m,) array
        Factor of each residual.
    """

    factors: Array = field(default_factory=lambda: np.empty(0))

    @property
    def scale(self) -> Array:
        """Return (m,) units of the data per unit of the multiplied residual."""
        return super().scale / np.where(self.factors > 0, self.factors, 1.0)

    @classmethod
    def of(cls, problem: FitProblem, factors: Array) -> WeightedProblem:
        """Return a problem with factors on its residuals; it keeps the warm starts.

        Parameters
        ----------
        problem : FitProblem
        factors : (m,) array
            Factor of each residual.
        """
        comparisons = tuple(replace(comparison) for comparison in problem.comparisons)
        return cls(comparisons, problem.law, problem.unknowns, factors=factors)

    def evaluate(self, y: Array, with_jacobian: bool, warm: bool = True) -> Evaluation | None:
        """Run every comparison as `FitProblem.evaluate`, and weight the result."""
        evaluation = super().evaluate(y, with_jacobian, warm)
        return None if evaluation is None else self.weighted(evaluation)

    def weighted(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation of the problem without factors with them, without a run."""
        residual = self.factors * evaluation.residual
        slope = evaluation.jacobian
        return replace(
            evaluation,
            residual=residual,
            value=self.blocks.value(residual),
            jacobian=None if slope is None else self.factors[:, None] * slope,
        )
