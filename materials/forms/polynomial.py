"""Moduli that are one polynomial each, of degree 0 to 3 (Eqs 3.1-3.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .base import COMPONENTS, GRID, ORDER, UNLIMITED, Array, Offer, register_form

DEGREES = ("constant", "linear", "quadratic", "cubic")


@dataclass(frozen=True)
class Polynomial:
    """Four coefficients a modulus, highest power first: G12, then E2, then E1.

    Whatever the degree beta has twelve entries, so that laws of different degrees compare; those of
    higher powers are zero.
    """

    degree: int

    size = 12
    labels = tuple(f"beta_{i}" for i in range(12))

    @property
    def name(self) -> str:
        return DEGREES[self.degree]

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(4 * block + k for block in range(3) for k in range(3 - self.degree, 4))

    @property
    def modulus_of(self) -> tuple[str, ...]:
        return tuple(ORDER[i // 4] for i in self.free)

    def piece_map(self) -> Array:
        whole = np.zeros((3, 1, 4, 12))
        for block, name in enumerate(ORDER):
            whole[COMPONENTS[name], 0, :, 4 * block : 4 * block + 4] = np.eye(4)
        return whole

    def uppers(self) -> Array:
        return np.full((3, 1), UNLIMITED)

    def grid(self, component: int, end: float) -> Array:
        return np.linspace(0.0, end, GRID)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from Chebyshev points: condition 6e3 where monomials have 1e8."""
        n = self.degree + 1
        share = 0.5 * (1.0 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
        whole = np.zeros((3 * n, 3 * n))
        for block, name in enumerate(ORDER):
            part = slice(n * block, n * block + n)
            points = strain_range[COMPONENTS[name]] * share
            whole[part, part] = np.linalg.inv(np.vander(points, n))
        return whole

    def to_card(self) -> dict[str, Any]:
        return {}

    def describe(self) -> str:
        return (
            "beta_0..3: G12 of |gamma12|, beta_4..7: E2 of eps2, beta_8..11: E1 of eps1, "
            "highest power first."
        )


CONSTANT, LINEAR, QUADRATIC, CUBIC = (Polynomial(degree) for degree in range(4))


for _degree, _form_name in enumerate(DEGREES):
    _made = Polynomial(_degree)
    register_form(Offer(_form_name, lambda *_, form=_made: form, of_strain=_degree > 0))
