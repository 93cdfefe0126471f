"""Folds of a cross-validation: which points a fit is not given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

#: Which of its points a fold gives to the fit, by comparison.
Fold = Mapping[str, NDArray[np.bool_]]


def folds_of(specimens: Mapping[str, Sequence[int]], count: int, seed: int) -> list[Fold]:
    """Which points each of `count` folds gives to the fit, by comparison.

    A comparison of several specimens loses whole specimens, because the points of one err
    together; one of a single specimen loses points drawn at random. Each point is left out exactly
    once where there are `count` specimens, or fewer than two.

    Parameters
    ----------
    specimens : (n,) number of the specimen of each point, by comparison; those that are not named
        lose nothing.
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
