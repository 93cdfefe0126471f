"""Rows of nodes along a tube, closer where bodies touch it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import InputError
from .mesh import Array

#: mm of element size for each mm away from a refined zone: neighbours differ by less than half.
GROWTH = 0.35


@dataclass(frozen=True)
class RefinedZone:
    """Smaller elements around a position along the tube, where there is a row of nodes.

    Parameters
    ----------
    name : str
        Of the node set.
    position, reach, size : float
        mm; up to `reach` from the position elements have this size.
    """

    name: str
    position: float
    reach: float
    size: float


def rows(end: float, size: float, refinements: Sequence[RefinedZone] = ()) -> Array:
    """Return positions (n,) mm from 0 to `end`, `size` mm apart, closer at refinements.

    Raises
    ------
    InputError
        If refinements are too near to each other or to the ends.
    """
    places = sorted({0.0, float(end)} | {float(r.position) for r in refinements})
    for r in refinements:
        gap = min(abs(p - r.position) for p in places if p != r.position)
        if gap < 0.5 * r.size:
            problem = (
                f"{r.position:g} mm is {gap:.3g} mm from the end, the middle or another row, less"
                f" than half an element of {r.size:g} mm; move it or make it the same place"
            )
            raise InputError(None, f"refinements.{r.name}.position", problem)
    pieces = [_between(a, b, size, refinements) for a, b in pairwise(places)]
    return np.concatenate([[0.0], *pieces])


def _between(
    start: float,
    end: float,
    size: float,
    refinements: Sequence[RefinedZone],
    samples: int = 20,
) -> Array:
    """Return rows after `start` up to `end`: equal parts of the integral of the density of rows.

    samples : points at which the density is looked at, for each of the closest rows.
    """
    finest = min([size, *(r.size for r in refinements)])
    count = max(samples, math.ceil(samples * (end - start) / finest))
    z = np.linspace(start, end, count + 1)
    sizes = np.full(len(z), float(size))
    for r in refinements:
        distance = np.maximum(np.abs(z - r.position) - r.reach, 0.0)
        sizes = np.minimum(sizes, r.size + GROWTH * distance)
    density = 1 / sizes
    mean_density = 0.5 * (density[1:] + density[:-1])
    total = np.concatenate([[0.0], np.cumsum(mean_density * np.diff(z))])
    parts = max(1, round(total[-1]))
    ends_of_parts = np.linspace(0.0, total[-1], parts + 1)[1:]
    places = np.interp(ends_of_parts, total, z)
    places[-1] = end
    return np.asarray(places)
