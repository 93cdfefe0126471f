"""Another assumption on a test, fitted beside that of the project: which explains the data better.

A sheet that comes out shorter than flat, or that stands as a dome, may have been under pressure in
the reference picture. A test that suspects such a thing gives an `Alternative` with one unknown
amount, here the pressure. The law is fitted with it at some amounts from the best fit on, and the
misfits of both are told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import scipy

from ..errors import InputError
from ..experiments.base import Alternative, PreparedTest
from ..inference.descent import descend
from ..inference.noise import Misfit, misfits
from ..inference.problem import Evaluation, FitProblem
from ..materials.forms.base import Array
from ..notes import Note, NoteKind
from .best import BestFit
from .setup import FitSetup

NOT_BETTER = NoteKind("alternative explains less")


@dataclass(frozen=True)
class SearchSettings:
    """Settings of the search for the amount of an alternative."""

    factor: float = 4.0  # times and by which the amount may differ from its estimate
    max_fits: int = 7
    precision: float = 0.05  # absolute, of the logarithm of the amount
    max_analyses: int = 15  # of each fit, as the law hardly changes from amount to amount
    equal_misfits: float = 0.02  # relative difference of two misfits that tells nothing


SEARCH = SearchSettings()


def with_alternatives(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """Return the best fit with a note on each alternative that a test suspects.

    Without derivatives of the project's own solver the fit is returned as it is, since many runs of
    another program would be needed.

    Parameters
    ----------
    setup : FitSetup
    problem : FitProblem
        The problem of the fit.
    best : BestFit
    """
    point = best.with_derivatives
    if point is None or problem.solver.external:
        return best
    fitted = misfits(problem, point.residual)
    notes: list[Note] = []
    for number, prepared in enumerate(setup.tests):
        name = prepared.test.name
        values = problem.unknowns.nuisance_values(name, point.unknowns)
        alternative = prepared.alternative(values) if name in fitted else None
        if alternative is not None:
            fits = AlternativeFits(setup, number, alternative, point)
            fits.search()
            notes += fits.notes(fitted[name])
    return replace(best, notes=(*best.notes, *notes))


class AlternativeFit(NamedTuple):
    """A fit with an amount of an alternative, and the misfit of its test."""

    amount: float
    evaluation: Evaluation
    misfit: Misfit


@dataclass(eq=False)
class AlternativeFits:
    """Fits with an alternative to what a project assumes of one of its tests.

    Attributes
    ----------
    setup : FitSetup
    number : int
        Number of the test among those of the setup.
    alternative : Alternative
    point : Evaluation
        The best fit, at whose law the first fit begins.
    best : AlternativeFit or None
        The best fit so far.
    """

    setup: FitSetup
    number: int
    alternative: Alternative
    point: Evaluation
    best: AlternativeFit | None = field(default=None, init=False)

    def notes(self, assumed: Misfit) -> Sequence[Note]:
        """Return a note on which explains the test better; none where no fit ended well.

        Parameters
        ----------
        assumed : Misfit
            Of the test as the project assumes it.
        """
        if self.best is None:
            return ()
        misfit = self.best.misfit
        words = self.alternative.words.format(self.best.amount)
        words += (
            f" leaves {misfit.rms:.3g} {misfit.unit} RMS, "
            f"{self.alternative.assumed} {assumed.rms:.3g} {assumed.unit}: "
        )
        kind = NOT_BETTER
        if misfit.rms < (1.0 - SEARCH.equal_misfits) * assumed.rms:
            kind = self.alternative.is_better
            words += "the former explains the data better"
        elif misfit.rms < (1.0 + SEARCH.equal_misfits) * assumed.rms:
            words += "the data do not tell the two apart"
        else:
            words += "the latter explains the data better"
        return (Note(kind, words, self._test.test.name),)

    @property
    def _test(self) -> PreparedTest:
        return self.setup.tests[self.number]

    def search(self) -> None:
        """Fit at amounts about the estimate, towards the least objective."""
        estimate = self.alternative.estimate
        largest = min(SEARCH.factor * estimate, self.alternative.largest)
        scipy.optimize.minimize_scalar(
            self._objective,
            bounds=np.log([estimate / SEARCH.factor, largest]),
            method="bounded",
            options={"maxiter": SEARCH.max_fits, "xatol": SEARCH.precision},
        )

    def _objective(self, log_amount: float) -> float:
        """Return the objective of the fit at an amount, infinite where it fails."""
        amount = float(np.exp(log_amount))
        tests = list(self.setup.tests)
        try:
            tests[self.number] = self.alternative.prepared(amount)
            problem = replace(self.setup, tests=tuple(tests)).problem()
        except InputError:
            return float("inf")
        first = problem.evaluate(self._start(problem), True)
        if first is None:
            return float("inf")
        tolerance = self.setup.project.fit.tolerance
        evaluation, _ = descend(problem, first, tolerance, SEARCH.max_analyses)
        if self.best is None or evaluation.value < self.best.evaluation.value:
            misfit = misfits(problem, evaluation.residual)[self._test.test.name]
            self.best = AlternativeFit(amount, evaluation, misfit)
        return evaluation.value

    def _start(self, problem: FitProblem) -> Array:
        """Return the unknowns of the best fit so far."""
        if self.best is not None:
            return self.best.evaluation.unknowns
        return problem.unknowns.at(self.point.coefficients)
