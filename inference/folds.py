"""Folds of cross-validation, the parts of the data that are left out of a fit in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

#: Which of the n points of each comparison the fit is given, by the name of the comparison.
Fold = Mapping[str, NDArray[np.bool_]]


def folds_of(specimens: Mapping[str, Sequence[int]], count: int, seed: int) -> list[Fold]:
    """Return which points each of `count` folds gives to the fit; the others are left out.

    A comparison of several specimens loses whole specimens, because the errors of one specimen's
    points are correlated; one of a single specimen loses points drawn at random. Each point is left
    out of one fold.

    Parameters
    ----------
    specimens : mapping of (n,) int sequences
        By the name of the comparison, the number of the specimen that each point belongs to.
        Comparisons that are not named lose nothing.
    count : int
        Number of folds.
    seed : int
        Seed of the random draws.
    """
    random = np.random.default_rng(seed)
    fold_of = {}
    for name, specimen_of in specimens.items():
        numbers = np.unique(np.asarray(specimen_of))
        if len(numbers) > 1:
            drawn_folds = random.permutation(len(numbers)) % count
            by_number = dict(zip(numbers.tolist(), drawn_folds, strict=True))
            fold_of[name] = np.array([by_number[int(number)] for number in specimen_of])
        else:
            fold_of[name] = random.permutation(len(specimen_of)) % count
    return [{name: folds != fold for name, folds in fold_of.items()} for fold in range(count)]
