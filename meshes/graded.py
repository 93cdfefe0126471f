"""Rows of nodes along a line, closer together where something happens."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

#: mm of element size for each mm away from a refined zone: neighbours differ by less than half.
GROWTH = 0.35
#: Points at which the wanted density of rows is looked at, for each row.
SAMPLES = 20


@dataclass(frozen=True)
class Refinement:
    """Small elements around a place on the axis, and a row of nodes exactly there.

    Parameters
    ----------
    name : of the node set that holds the row.
    position : mm from the middle, 0 or more.
    reach : mm to either side in which the elements are small; beyond, they grow.
    size : mm along the axis.

    Raises
    ------
    InputError : a name that is not letters, digits and _; lengths that are negative or no numbers.
    """

    name: str
    position: float
    reach: float
    size: float

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.isidentifier()):
            problem = f"expected a name of letters, digits and _, got {self.name!r}"
            raise InputError(None, "refinements", problem)
        for field in ("position", "reach"):
            if not 0 <= getattr(self, field) < math.inf:
                problem = f"expected 0 mm or more, got {getattr(self, field)!r}"
                raise InputError(None, f"refinements.{self.name}.{field}", problem)
        if not 0 < self.size < math.inf:
            problem = f"expected a length above 0 mm, got {self.size!r}"
            raise InputError(None, f"refinements.{self.name}.size", problem)


def rows(end: float, size: float, refinements: Sequence[Refinement] = ()) -> Array:
    """Positions of rows from 0 to `end`, `size` apart and closer at the refinements.

    Parameters
    ----------
    end, size : mm.

    Returns
    -------
    (rows,) mm, increasing, with 0, `end` and the position of every refinement among them.

    Raises
    ------
    InputError : a refinement beyond the end, or nearer than half its size to the end or another.
    """
    places = sorted({0.0, float(end)} | {float(r.position) for r in refinements})
    for r in refinements:
        if r.position > end:
            problem = f"{r.position:g} mm lies beyond the end, {end:g} mm from the middle"
            raise InputError(None, f"refinements.{r.name}.position", problem)
        gap = min(abs(p - r.position) for p in places if p != r.position)
        if gap < 0.5 * r.size:
            problem = (
                f"{r.position:g} mm is {gap:.3g} mm from the end, the middle or another row, less"
                f" than half an element of {r.size:g} mm; move it or make it the same place"
            )
            raise InputError(None, f"refinements.{r.name}.position", problem)
    pieces = [_between(a, b, size, refinements) for a, b in pairwise(places)]
    return np.concatenate([[0.0], *pieces])


def _between(start: float, end: float, size: float, refinements: Sequence[Refinement]) -> Array:
    """Rows after `start` up to `end`: equal parts of the integral of the wanted density."""
    finest = min([size, *(r.size for r in refinements)])
    count = max(SAMPLES, math.ceil(SAMPLES * (end - start) / finest))
    z = np.linspace(start, end, count + 1)
    wanted = np.full(len(z), float(size))
    for r in refinements:
        beyond = np.maximum(np.abs(z - r.position) - r.reach, 0.0)
        wanted = np.minimum(wanted, r.size + GROWTH * beyond)
    density = 1 / wanted
    total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(z))])
    parts = max(1, round(total[-1]))
    places = np.interp(np.linspace(0.0, total[-1], parts + 1)[1:], total, z)
    places[-1] = end
    return np.asarray(places)
