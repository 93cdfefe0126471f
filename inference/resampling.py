"""Draw the data of a fit again: which residuals count how often.

Units (frames, specimens, whole tests) are drawn with replacement, each among its own group. A block
of the objective that is of one unit counts as often as that was drawn; in a block that several
units share, the mean of the squares is over what was drawn.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials.forms.base import Array
from .problem import FitProblem


@dataclass(frozen=True, eq=False)
class Unit:
    """A part of the data that is drawn as a whole; rows : (m,) bool, its residuals."""

    name: str
    rows: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Group:
    """Units that are drawn among each other."""

    name: str
    units: Sequence[Unit]


def draw_counts(groups: Sequence[Group], random: np.random.Generator) -> list[list[int]]:
    """Return the number of draws of each unit of each group: as many as there are units."""
    return [
        random.multinomial(len(group.units), [1 / len(group.units)] * len(group.units)).tolist()
        for group in groups
    ]


def factors_of(
    problem: FitProblem, groups: Sequence[Group], counts: Sequence[Sequence[int]]
) -> Array:
    """Return (m,) factors of the residuals for counts of the units; all else counts once."""
    times = np.ones(len(problem.blocks.of))
    for group, own in zip(groups, counts, strict=True):
        for unit, often in zip(group.units, own, strict=True):
            times[unit.rows] = often
    factors = np.empty_like(times)
    for rows in np.split(np.arange(len(times)), problem.blocks.starts[1:]):
        block = times[rows]
        same = bool((block == block[0]).all())
        factors[rows] = block if same else np.sqrt(block / block.mean())
    return factors


def rows_of(problem: FitProblem, points: Mapping[str, NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Return (m,) which residuals are of points, by comparison.

    Raises InputError where an objective cannot say (`of_points`).
    """
    found = np.zeros(len(problem.blocks.of), dtype=bool)
    for k, comparison in enumerate(problem.comparisons):
        mask = points.get(comparison.name)
        if mask is None:
            continue
        of_points = getattr(comparison.objective, "of_points", None)
        if of_points is None:
            said = f"{comparison.name} does not tell which of its values are of which part"
            raise InputError(None, "--over", said)
        found[problem.rows(k)] = of_points(mask)
    return found


#: Which of its points a fold gives to the fit, by comparison.
Fold = Mapping[str, NDArray[np.bool_]]


def folds_of(specimens: Mapping[str, Sequence[int]], count: int, seed: int) -> list[Fold]:
    """Return the points that each of `count` folds gives to the fit, by comparison.

    A comparison of several specimens loses whole specimens, because the points of one err together;
    one of a single specimen loses points drawn at random. Each point is left out exactly once where
    there are `count` specimens, or fewer than two. specimens : (n,) number of the specimen of each
    point, by comparison; others lose nothing.
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
