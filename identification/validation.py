"""Cross-validation: how well a fit foretells points that it was not given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .methods import FitOptions, fit_from
from .problem import FitProblem

Array = NDArray[np.float64]
Kept = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class FoldError:
    """One fold: root mean square error in N at the points left out, by test.

    rms None: the fit without them, or the analysis, failed.
    """

    fold: int
    rms: Mapping[str, float] | None


def folds_of(specimens: Mapping[str, Sequence[int]], count: int, seed: int) -> list[Kept]:
    """Which points each of the folds keeps, by test.

    specimens : (n,) number of the specimen of each point, by test. A test of several specimens
    loses whole specimens, because the points of one err together; one of a single specimen loses
    points drawn at random. Each point is left out exactly once where a test has `count` specimens
    or fewer than two.
    """
    random = np.random.default_rng(seed)
    place = {}
    for name, whose in specimens.items():
        numbers = np.unique(np.asarray(whose))
        if len(numbers) > 1:
            of = dict(zip(numbers.tolist(), random.permutation(len(numbers)) % count, strict=True))
            place[name] = np.array([of[int(w)] for w in whose])
        else:
            place[name] = random.permutation(len(whose)) % count
    return [{name: where != fold for name, where in place.items()} for fold in range(count)]


def validate(
    build: Callable[[Kept | None], FitProblem],
    start: Array,
    folds: Sequence[Kept],
    options: FitOptions,
) -> list[FoldError]:
    """Fit without the points of each fold, from the unknowns `start`, and judge at these points.

    build : the problem of the points kept, of all points for None; its objectives are those of
    strips (`loads.LoadObjective`).
    """
    errors = []
    for number, kept in enumerate(folds):
        left_out = build({name: ~mask for name, mask in kept.items()})
        optimum = fit_from(build(kept), start, options)
        point = None if optimum is None else left_out.evaluate(optimum.best.unknowns, False)
        rms = None
        if point is not None:
            rms = {
                test.name: test.objective.rms(history)
                for test, history in zip(left_out.experiments, point.histories, strict=True)
            }
        errors.append(FoldError(number, rms))
    return errors
