"""Parts of a test of strips that a fit can do without: directions, and specimens."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..fittable import Masks
from .strip import Strip

if TYPE_CHECKING:
    from .prepared import PreparedStrips


def parts_of(prepared: PreparedStrips) -> Mapping[str, Mapping[str, Masks]]:
    """By sort and name, the points that are kept without each; sorts of one part left out."""
    test = prepared.test
    points = test.match_by == "points"
    counts = {d: len(test.strips[d].points[0]) if points else test.increments for d in test.matched}
    whole = {prepared.part(d): np.ones(count, dtype=bool) for d, count in counts.items()}
    directions: dict[str, Masks] = {}
    specimens: dict[str, Masks] = {}
    for direction, count in counts.items():
        name = prepared.part(direction)
        directions[direction] = {**whole, name: np.zeros(count, dtype=bool)}
        others = _without(test.strips[direction]) if points else {}
        for which, mask in others.items():
            specimens[f"{direction}, {which}"] = {**whole, name: mask}
    sorts = {"directions": directions, "specimens": specimens}
    return {sort: parts for sort, parts in sorts.items() if len(parts) > 1}


def _without(strip: Strip) -> Mapping[str, NDArray[np.bool_]]:
    """Which points are not of each specimen, by its name; none of a strip of one specimen."""
    numbers = np.unique(strip.specimen_of).tolist()
    if len(numbers) < 2:
        return {}
    names = [strip.curves[number].specimen for number in numbers]
    told = {n: f"specimen {n}" for n in names}
    whose = strip.specimen_of
    if len(told) < len(names):  # files may name theirs alike
        return {f"specimen {n + 1}": whose != n for n in numbers}
    return {told[name]: whose != n for name, n in zip(names, numbers, strict=True)}
