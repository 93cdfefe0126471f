"""A law whose moduli go from one value at rest to another far away, along an exponential.

    E(x) = E_far + (E_rest - E_far) exp(-x / s)

with a strain s that the project gives for each direction. It is linear in its two unknowns, and the
exponential is a cubic with a continuous slope between a few strains: a piecewise cubic, which is
all that bubblefit needs to know of a law.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from bubblefit.errors import InputError
from bubblefit.materials.forms.base import COMPONENTS, ORDER, STRAIN_NAMES, UNLIMITED, Array, Offer

#: Ends of the pieces in units of s; beyond the last, where 0.2 % is left, a modulus is constant.
ENDS = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0])


@dataclass(frozen=True)
class Saturating:
    """Moduli at rest and far away: G12, then E2, then E1; scale: s of eps1, eps2, gamma12."""

    scale: tuple[float, float, float]

    name = "saturating"
    size = 6
    labels = tuple(f"{modulus} {where}" for modulus in ORDER for where in ("at rest", "far away"))
    free = tuple(range(6))
    modulus_of = tuple(modulus for modulus in ORDER for _ in range(2))

    def piece_map(self) -> Array:
        """d (coefficients of the pieces) / d beta, (3, pieces, 4, 6)."""
        whole = np.zeros((3, len(ENDS), 4, 6))
        for block, modulus in enumerate(ORDER):
            component = COMPONENTS[modulus]
            share = _share_at_rest(self.scale[component])
            whole[component, :, :, 2 * block] = share
            whole[component, :, :, 2 * block + 1] = -share
            whole[component, :, 3, 2 * block + 1] += 1.0
        return whole

    def uppers(self) -> Array:
        """Upper ends of the pieces, (3, pieces)."""
        ends = np.outer(self.scale, ENDS[1:])
        return np.column_stack([ends, np.full(3, UNLIMITED)])

    def grid(self, component: int, end: float) -> Array:
        """A modulus lies between its values at both ends: it is enough to ask there."""
        return np.array([0.0, end])

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Beta from the moduli at rest and at the end of the strain range."""
        whole = np.zeros((6, 6))
        for block, modulus in enumerate(ORDER):
            component = COMPONENTS[modulus]
            left = np.exp(-strain_range[component] / self.scale[component])
            part = slice(2 * block, 2 * block + 2)
            whole[part, part] = np.linalg.inv([[1.0, 0.0], [left, 1.0 - left]])
        return whole

    def to_card(self) -> dict[str, Any]:
        """What a card says beside beta, as [law] of a project says it."""
        return {"scale": dict(zip(STRAIN_NAMES, self.scale, strict=True))}

    def describe(self) -> str:
        """For a card's header."""
        return "Moduli at rest and far away: G12 of |gamma12|, E2 of eps2, E1 of eps1."


def _share_at_rest(scale: float) -> Array:
    """exp(-x / scale) as cubics of x, (pieces, 4), highest power first; the last is constant."""
    pieces = np.zeros((len(ENDS), 4))
    for piece, (a, b) in enumerate(pairwise(ENDS)):
        # Value and slope at both ends: rows of the cubic and of its derivative.
        rows = [np.vander([x], 4)[0] for x in (a, b)]
        rows += [np.array([3 * x**2, 2 * x, 1.0, 0.0]) for x in (a, b)]
        pieces[piece] = np.linalg.solve(rows, [*np.exp([-a, -b]), *-np.exp([-a, -b])])
    pieces[-1, 3] = np.exp(-ENDS[-1])
    return np.asarray(pieces / scale ** np.arange(3, -1, -1))


def make(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> Saturating:
    """The form of the setting scale = { warp = ..., fill = ..., shear = ... }.

    InputError : a direction without a strain above zero.
    """
    given = settings.get("scale")
    if not isinstance(given, Mapping):
        problem = "a saturating law needs scale = { warp = ..., fill = ..., shear = ... }"
        raise InputError(None, "scale", problem)
    for direction in STRAIN_NAMES:
        value = given.get(direction)
        if not isinstance(value, int | float) or not 0 < value < UNLIMITED:
            raise InputError(None, f"scale.{direction}", f"expected a strain above 0, got {value}")
    warp, fill, shear = (float(given[direction]) for direction in STRAIN_NAMES)
    return Saturating((warp, fill, shear))


#: What the entry point names: the maker of the form, and the settings that it takes.
SATURATING = Offer("saturating", make, ("scale",))
