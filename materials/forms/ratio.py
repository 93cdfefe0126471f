"""Moduli of strain AND load ratio: splines of the own strain that gain by the load ratio.

    E1 = E1(eps1) + dE1 (gamma1 - 1/sqrt 2),    gamma1 = n1 / sqrt(n1^2 + n2^2),

and E2 alike: yarns that both carry exchange crimp, a yarn that carries all straightens freely. The
gains are constants, as those of `LoadRatio` are (Galliot and Luchsinger, 2009), of which this is
the form with moduli of strain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .base import EVEN, Array, Offer, register_form
from .spline import Spline, spline_named

GAINS = ("dE2", "dE1")


@dataclass(frozen=True)
class SplineRatio:
    """A spline at equal loads, followed by the gains of E2 and E1 by their load ratios."""

    spline: Spline

    name = "spline-ratio"

    @property
    def size(self) -> int:
        return self.spline.size + 2

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(range(self.size))

    @property
    def modulus_of(self) -> tuple[str, ...]:
        return (*self.spline.modulus_of, "E2", "E1")

    @property
    def labels(self) -> tuple[str, ...]:
        return (*self.spline.labels, *GAINS)

    def piece_map(self) -> Array:
        whole = self.spline.piece_map()
        return np.concatenate([whole, np.zeros((*whole.shape[:-1], 2))], axis=-1)

    def by_load_ratio(self) -> Array:
        whole = np.zeros((2, self.size))
        whole[1, -2] = whole[0, -1] = 1.0
        return whole

    def uppers(self) -> Array:
        return self.spline.uppers()

    def grid(self, component: int, end: float) -> Array:
        return self.spline.grid(component, end)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from moduli at the knots, and at rest where one yarn carries all."""
        whole, share = np.eye(self.size), 1.0 / (1.0 - EVEN)
        first = self.spline.modulus_of.index
        for place, name in ((-2, "E2"), (-1, "E1")):
            whole[place, first(name)], whole[place, place] = -share, share
        return whole

    def to_card(self) -> dict[str, Any]:
        return self.spline.to_card()

    def describe(self) -> str:
        return (
            f"{self.spline.describe()} E2 and E1 are those at equal loads; dE2 and dE1 are what "
            "they gain where their load ratio n / sqrt(n1^2 + n2^2) goes from 0 to 1."
        )


def _named(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> SplineRatio:
    return SplineRatio(spline_named(name, settings, strain_range))


register_form(Offer("spline-ratio", _named, ("knots",), of_load_ratio=True))
