"""The tests that a project has, at the law of a card: what they say of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SolverFailure
from ..experiments.candidates import Precision
from ..experiments.notes import strains_of
from ..fits.setup import FitSetup
from ..identification.given_law import evaluate_law, problem_at
from ..identification.information import Array, information
from ..identification.noise import Noise
from ..identification.problem import Evaluation, FitProblem
from ..materials.card import MaterialCard
from ..materials.law import HypoelasticLaw


@dataclass(frozen=True, eq=False)
class Present:
    """The project's own tests at the law of a card."""

    problem: FitProblem
    point: Evaluation
    law: HypoelasticLaw
    precision: Mapping[str, Precision]

    @property
    def reached(self) -> Array:
        """(3,) largest strains."""
        return np.max([strains_of(history) for history in self.point.histories], axis=0)

    @property
    def information(self) -> Array:
        """(n, n) of all comparisons."""
        unknowns, point = self.problem.unknowns, self.point
        assert point.jacobian is not None
        whole = np.zeros((unknowns.size, unknowns.size))
        for k, comparison in enumerate(self.problem.comparisons):
            rows, own = self.problem.rows(k), unknowns.nuisance_places(comparison.name)
            slopes = point.jacobian[rows] * self.problem.scale[rows, None]
            slopes = np.hstack([slopes[:, : unknowns.size], slopes[:, own]])
            told = self.precision[comparison.name]
            sigma = told.noise * np.sqrt(told.alike)
            whole += information(slopes, sigma, comparison.nuisance)
        return whole


def present_tests(setup: FitSetup, card: MaterialCard) -> Present:
    """Run the tests with a card, what is no law (offsets, the sheet's surface) fitted to them.

    Raises
    ------
    SolverFailure : they cannot be run with it.
    """
    law = _law(setup, card)
    make = setup.make_leading
    comparisons = tuple(
        comparison
        for test, weighting in zip(setup.tests, setup.weightings, strict=True)
        for comparison in test.comparisons(make, weighting)
    )
    problem, y = problem_at(law, comparisons)
    point = evaluate_law(problem, y, with_jacobian=True)
    if point is None:
        said = f"the present tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(said, problem.solver.name)
    noise = Noise.of(problem, point.residual)
    precision = {
        c.name: Precision(
            noise.level[c.name], noise.alike[c.name], round(np.mean(c.objective.sizes))
        )
        for c in comparisons
    }
    return Present(problem, point, law, precision)


def _law(setup: FitSetup, card: MaterialCard) -> HypoelasticLaw:
    """The card's law over the strains of the project's, where both are of one form."""
    if card.law.form != setup.law.form:
        return card.law
    return replace(setup.law, beta=card.law.beta, nu12=card.law.nu12)
