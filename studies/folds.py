"""Cross-validation of a fit: how well it foretells specimens that it was not given."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import NoFeasibleStart
from ..experiments.fittable import Masks
from ..fits.law import law_of
from ..fits.setup import FitSetup
from ..identification.feasibility import feasible_start
from ..identification.fit import fit_from
from ..identification.problem import FitProblem
from ..identification.validation import folds_of


@dataclass(frozen=True)
class FoldError:
    """One fold: errors at the points left out.

    value : their part of the objective; rms : root mean square by comparison, in its unit. None and
    empty where no fit without them, or no analysis, ended well.
    """

    fold: int
    value: float | None
    rms: Mapping[str, float]

    def to_json(self) -> dict[str, Any]:
        """Plain values, exact in JSON."""
        return asdict(self)


def specimens_of(setup: FitSetup) -> dict[str, list[int]]:
    """Number of the specimen of each point that can be left out, by comparison."""
    return {name: list(own) for test in setup.tests for name, own in test.specimens.items()}


def folds(setup: FitSetup, count: int) -> list[Masks]:
    """Which points the folds keep: at most `count` folds, and no more than there are specimens."""
    whose = specimens_of(setup)
    several = [len(set(own)) for own in whose.values() if len(set(own)) > 1]
    return folds_of(whose, min([count, *several]), setup.project.fit.seed)


def validate(
    setup: FitSetup, count: int, starts: int, done: Collection[int] = ()
) -> Iterator[FoldError | None]:
    """Fit without the points of each fold and judge at these points; None now and then.

    What follows from the data (strain range and breaks of the law, what a relative error is over)
    follows from the points matched, and the fits begin at random starts of their own: nothing of
    the points left out is in them but how far the models are strained, to be judged there.

    Parameters
    ----------
    count : of folds, at most. starts : random starts a fold, the best of which counts. done : folds
        that are known already.
    """
    parts = folds(setup, count)
    missing = [fold for fold in range(len(parts)) if fold not in done]
    prepare = functools.partial(_task, setup, parts, starts)
    if not missing:
        return iter(())
    return setup.project.executor.run_tasks(prepare, missing, "folds")


def _task(
    setup: FitSetup, parts: list[Masks], starts: int
) -> Callable[[int, Callable[[Any], None]], FoldError]:
    return lambda fold, tell: _fold(setup, fold, parts[fold], starts)


def fit_of(setup: FitSetup, masks: Masks, starts: int) -> tuple[FitSetup, np.ndarray | None]:
    """The fit with a law of the points that the masks keep; unknowns None where all starts fail."""
    law = law_of(setup.project, [test.reach(masks) for test in setup.tests])
    own = replace(setup, law=law)
    return own, best_of(own, own.problem(masks), starts)


def _fold(setup: FitSetup, fold: int, masks: Masks, starts: int) -> FoldError:
    own, unknowns = fit_of(setup, masks, starts)
    if unknowns is None:
        return FoldError(fold, None, {})
    whole = own.problem({name: ~mask for name, mask in masks.items()})
    judged = whole.part([k for k, c in enumerate(whole.comparisons) if c.name in masks])
    point = judged.evaluate(unknowns, False, warm=False)
    if point is None:
        return FoldError(fold, None, {})
    return FoldError(
        fold, part_of_objective(judged, point.residual), errors(judged, point.residual)
    )


def best_of(setup: FitSetup, problem: FitProblem, starts: int) -> np.ndarray | None:
    """Unknowns of the best of some starts; None where all failed."""
    best, least = None, np.inf
    for number in range(starts):
        problem.reset()
        try:
            start = feasible_start(problem, setup.project.fit.seed, number)
        except NoFeasibleStart:
            continue
        optimum = fit_from(problem, start, setup.options)
        if optimum is not None and optimum.value < least:
            best, least = optimum.best.unknowns, optimum.value
    return best


def part_of_objective(problem: FitProblem, residual: np.ndarray) -> float:
    """What the problem's comparisons add to the objective."""
    return float(problem.blocks.norms(residual).sum())


def errors(problem: FitProblem, residual: np.ndarray) -> dict[str, float]:
    """Root mean square by comparison, in its unit."""
    misfit = residual * problem.scale
    return {
        c.name: float(np.sqrt(np.mean(misfit[problem.rows(k)] ** 2)))
        for k, c in enumerate(problem.comparisons)
    }
