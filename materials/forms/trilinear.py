"""Moduli that are constant in three regions of their strain (after Ambroziak and Klosowski)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from .base import COMPONENTS, GRID, ORDER, STRAIN_NAMES, UNLIMITED, Array, Offer, register_form

Pair = tuple[float, float]


@dataclass(frozen=True)
class TriLinear:
    """Three moduli up to the first break, between the breaks, and beyond the second.

    G12 is beta_3, beta_2 and beta_1 there, E2 beta_7 to beta_5, E1 beta_11 to beta_9; beta_0,
    beta_4 and beta_8 are zero. A break belongs to the region below it. pairs : the two breaks of
    eps1, of eps2 and of gamma12.
    """

    pairs: tuple[Pair, Pair, Pair]

    name = "trilinear"
    size = 12
    labels = tuple(f"beta_{i}" for i in range(12))
    free = (1, 2, 3, 5, 6, 7, 9, 10, 11)
    modulus_of = tuple(name for name in ORDER for _ in range(3))

    @classmethod
    def at(cls, breaks: ArrayLike) -> TriLinear:
        """Return the form with breaks (3, 2); raise InputError unless positive and increasing."""
        try:
            pairs = np.array(breaks, dtype=float)
        except (TypeError, ValueError):
            pairs = np.empty(0)
        good = pairs.shape == (3, 2) and np.isfinite(pairs).all()
        if not good or not (pairs[:, 0] > 0).all() or not (np.diff(pairs) > 0).all():
            raise InputError(
                None,
                "breaks",
                "expected two positive, increasing strains for each of (eps1, eps2, gamma12), "
                f"got {' '.join(str(breaks).split())}",
            )
        first, second, third = ((float(a), float(b)) for a, b in pairs)
        return cls((first, second, third))

    @property
    def breaks(self) -> Array:
        """Return (3, 2) breaks of (eps1, eps2, gamma12), read-only."""
        breaks = np.array(self.pairs)
        breaks.flags.writeable = False
        return breaks

    def piece_map(self) -> Array:
        whole = np.zeros((3, 3, 4, 12))
        for block, name in enumerate(ORDER):
            for piece in range(3):
                whole[COMPONENTS[name], piece, 3, 4 * block + 3 - piece] = 1.0
        return whole

    def uppers(self) -> Array:
        return np.column_stack([self.breaks, np.full(3, UNLIMITED)])

    def grid(self, component: int, end: float) -> Array:
        """Return as many strains in a narrow region as in a wide one."""
        breaks = self.breaks[component]
        knots = np.concatenate([[0.0], breaks[breaks < end], [end]])
        at = np.linspace(0.0, len(knots) - 1, GRID)
        return np.interp(at, np.arange(len(knots)), knots)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        return np.eye(len(self.free))

    def to_card(self) -> dict[str, Any]:
        return {"breaks": dict(zip(STRAIN_NAMES, self.breaks.tolist(), strict=True))}

    def describe(self) -> str:
        return (
            "Tri-linear moduli, beyond the second break, between the breaks, up to the first: "
            "beta_1..3: G12 of |gamma12|, beta_5..7: E2 of eps2, beta_9..11: E1 of eps1; the "
            "others are 0."
        )


def trilinear_named(
    name: str, settings: Mapping[str, Any], strain_range: Sequence[float]
) -> TriLinear:
    """Return the form of `breaks`, {warp = [first, second], fill = ..., shear = ...}."""
    breaks = settings.get("breaks")
    if not isinstance(breaks, Mapping):
        problem = "a trilinear law needs breaks = {warp = [first, second], fill = ..., shear = ...}"
        raise InputError(None, "breaks", problem)
    for key in breaks:
        if key not in STRAIN_NAMES:
            problem = f"unknown direction; allowed: {', '.join(STRAIN_NAMES)}"
            raise InputError(None, f"breaks.{key}", problem)
    pairs = []
    for key in STRAIN_NAMES:
        if key not in breaks:
            raise InputError(None, f"breaks.{key}", "this key is missing")
        pair = breaks[key]
        if not _increasing(pair):
            problem = f"expected [first, second], 0 < first < second, got {pair}"
            raise InputError(None, f"breaks.{key}", problem)
        pairs.append(pair)
    return TriLinear.at(pairs)


def _increasing(pair: Any) -> bool:
    numbers = isinstance(pair, (list, tuple)) and len(pair) == 2
    if not numbers or not all(type(x) in (int, float) for x in pair):
        return False
    return bool(0 < pair[0] < pair[1] < UNLIMITED)


register_form(Offer("trilinear", trilinear_named, ("breaks",)))
