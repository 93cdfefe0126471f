"""Moduli that go with the ratio of the loads along warp and fill.

After Galliot and Luchsinger, Composite Structures 90 (2009) 438: at one load ratio the fabric is
linear and orthotropic, and the moduli along the yarns are linear in the normalised load ratio,

    E1 = E1(1:1) + dE1 (gamma1 - 1/sqrt 2),    gamma1 = n1 / sqrt(n1^2 + n2^2),
    E2 = E2(1:1) + dE2 (gamma2 - 1/sqrt 2),    gamma2 = n2 / sqrt(n1^2 + n2^2),

with two numbers more than the linear law has. nu12 and G12 are constant, and nu21 = nu12 E2 / E1
at every ratio. Here they are tangent moduli: on a path on which the stresses grow in proportion
they are also the secant ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .base import COMPONENTS, EVEN, UNLIMITED, Array, Offer, register_form

#: Of beta: G12, then E2 and E1 where both yarns carry the same, each followed by what it gains
#: where its own normalised load ratio goes from 0 to 1.
LABELS = ("G12", "E2 at 1:1", "dE2", "E1 at 1:1", "dE1")
PLACES = {"G12": 0, "E2": 1, "E1": 3}


@dataclass(frozen=True)
class LoadRatio:
    """G12, E2 at equal loads and its gain, E1 at equal loads and its gain; no strain matters."""

    name = "load-ratio"
    size = len(LABELS)
    labels = LABELS
    free = tuple(range(len(LABELS)))
    modulus_of = ("G12", "E2", "E2", "E1", "E1")

    def piece_map(self) -> Array:
        whole = np.zeros((3, 1, 4, self.size))
        for name, place in PLACES.items():
            whole[COMPONENTS[name], 0, 3, place] = 1.0
        return whole

    def by_load_ratio(self) -> Array:
        whole = np.zeros((2, self.size))
        for name in ("E1", "E2"):
            whole[COMPONENTS[name], PLACES[name] + 1] = 1.0
        return whole

    def uppers(self) -> Array:
        return np.full((3, 1), UNLIMITED)

    def grid(self, component: int, end: float) -> Array:
        return np.array([0.0, end])

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from E2 and E1 where their own yarn carries nothing, and all.

        If these are positive the modulus is at every ratio.
        """
        whole = np.eye(self.size)
        for name in ("E1", "E2"):
            own = slice(PLACES[name], PLACES[name] + 2)
            whole[own, own] = [[1.0 - EVEN, EVEN], [-1.0, 1.0]]
        return whole

    def to_card(self) -> dict[str, Any]:
        return {}

    def describe(self) -> str:
        return (
            "beta: G12; E2 at equal loads along warp and fill, and what it gains where its load "
            "ratio n2 / sqrt(n1^2 + n2^2) goes from 0 to 1; the same of E1."
        )


register_form(Offer("load-ratio", lambda *_: LoadRatio(), of_strain=False, of_load_ratio=True))
