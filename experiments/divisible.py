"""What a prepared test offers beside its protocol so that a fit can do without parts of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from .fittable import Masks


@runtime_checkable
class Divisible(Protocol):
    """A prepared test of which single parts can be left out of a fit.

    Its `comparisons` take the masks of `parts`, and none is among them of which nothing is left.
    Their objectives say by `of_points(values)` which residuals are of which points: (m,) of values
    for the points of a mask; a bootstrap lets parts count several times, or not at all.
    """

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """By sort ("frames", "specimens") and by name ("97 kPa"): the points kept without it.

        Only sorts of which the test has two or more. Masks are of every comparison of the test,
        over its points in the order of its data; where they are turned round, its `comparisons`
        are the part alone.
        """
