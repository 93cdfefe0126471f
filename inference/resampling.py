"""Parts of the data of a fit: drawn again for a bootstrap, or left out in cross-validation.

References
----------
B. Efron, Bootstrap methods: another look at the jackknife, Ann. Statist. 7 (1979) 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials.forms.base import Array
from .problem import FitProblem

#: Which of n points or residuals are meant, (n,).
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ResamplingUnit:
    """A part of the data that is drawn as a whole, as a test, a specimen or a frame.

    Attributes
    ----------
    name : str
    rows : (m,) array of bool
        Which residuals belong to it.
    """

    name: str
    rows: Flags


@dataclass(frozen=True, eq=False)
class ResamplingGroup:
    """Units among which is drawn, as the specimens of one test."""

    name: str
    units: Sequence[ResamplingUnit]


def draw_counts(groups: Sequence[ResamplingGroup], random: np.random.Generator) -> list[list[int]]:
    """Draw as many units of each group as there are, with replacement.

    Parameters
    ----------
    groups : sequence of ResamplingGroup
    random : Generator

    Returns
    -------
    list of lists of int
        How often each unit of each group was drawn.
    """
    counts = []
    for group in groups:
        count = len(group.units)
        counts.append(random.multinomial(count, [1 / count] * count).tolist())
    return counts


def factors_of(
    problem: FitProblem, groups: Sequence[ResamplingGroup], counts: Sequence[Sequence[int]]
) -> Array:
    """Return factors of the residuals that make each unit count as often as it was drawn.

    Parameters
    ----------
    problem : FitProblem
    groups : sequence of ResamplingGroup
    counts : sequence of sequences of int
        How often each unit of each group was drawn; all other data count once.

    Returns
    -------
    (m,) array
        A block whose residuals all were drawn equally often is multiplied by that count. In a block
        of several units the squares of the residuals are, by the count over its mean in the block.
    """
    multiplicity = np.ones(len(problem.blocks.block_of))
    for group, group_counts in zip(groups, counts, strict=True):
        for unit, count in zip(group.units, group_counts, strict=True):
            multiplicity[unit.rows] = count
    factors = np.empty_like(multiplicity)
    for rows in np.split(np.arange(len(multiplicity)), problem.blocks.starts[1:]):
        block = multiplicity[rows]
        is_uniform = bool((block == block[0]).all())
        factors[rows] = block if is_uniform else np.sqrt(block / block.mean())
    return factors


def rows_of(problem: FitProblem, points: Mapping[str, Flags]) -> Flags:
    """Return which residuals belong to given points of the data.

    Parameters
    ----------
    problem : FitProblem
    points : mapping of (n,) bool arrays
        Which of the n points of a comparison are meant, by the name of the comparison.

    Returns
    -------
    (m,) bool array

    Raises
    ------
    InputError
        A comparison does not know which of its values are of which point.
    """
    is_of_points = np.zeros(len(problem.blocks.block_of), dtype=bool)
    for k, comparison in enumerate(problem.comparisons):
        mask = points.get(comparison.name)
        if mask is None:
            continue
        flags = comparison.objective.spread_over_residuals(mask)
        if flags is None:
            message = f"{comparison.name} does not tell which of its values are of which part"
            raise InputError(None, "--over", message)
        is_of_points[problem.rows(k)] = flags
    return is_of_points


def folds_of(
    specimens: Mapping[str, Sequence[int]], count: int, seed: int
) -> list[Mapping[str, Flags]]:
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

    Returns
    -------
    list of mappings of (n,) bool arrays
        For each fold, which of the n points of each comparison the fit is given, by its name.
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
