"""Forms with moduli that are polynomials of strain (Eqs 3.1-3.3), or linear in the load ratio.

The polynomials have degree 0 to 3. The form of the load ratio is that of Galliot and Luchsinger,
Composite Structures 90 (2009) 438: at one load ratio the fabric is linear and orthotropic, and E1,
E2 are linear in the normalised load ratio, n1 and n2 being the loads along warp and fill,

    E1 = E1(1:1) + dE1 (gamma1 - 1/sqrt 2),    gamma1 = n1 / sqrt(n1^2 + n2^2),
    E2 = E2(1:1) + dE2 (gamma2 - 1/sqrt 2),    gamma2 = n2 / sqrt(n1^2 + n2^2).

Here they are tangent moduli; on a path of proportional stresses they are the secant ones as well.
"""

from collections.abc import Sequence

import numpy as np

from ...light_dataclasses import dataclass
from .base import COMPONENTS, EVEN, GRID, ORDER, Array, LawForm, Offer, register_form

DEGREES = ("constant", "linear", "quadratic", "cubic")


@dataclass(frozen=True)
class Polynomial(LawForm):
    """Moduli that are polynomials of strain of a degree from 0 to 3.

    beta has four coefficients (MPa) of G12, of E2 and of E1, the highest power first; those of
    powers above the degree are zero.
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
        rows = np.zeros((3, 1, 4, 12))
        for block, name in enumerate(ORDER):
            rows[COMPONENTS[name], 0, :, 4 * block : 4 * block + 4] = np.eye(4)
        return rows

    def grid(self, component: int, end: float) -> Array:
        return np.linspace(0.0, end, GRID)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from moduli at Chebyshev points, which are the control strains.

        Its condition number is 6e3, against 1e8 with coefficients of monomials.
        """
        n = self.degree + 1
        share = 0.5 * (1.0 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
        matrix = np.zeros((3 * n, 3 * n))
        for block, name in enumerate(ORDER):
            part = slice(n * block, n * block + n)
            points = strain_range[COMPONENTS[name]] * share
            matrix[part, part] = np.linalg.inv(np.vander(points, n))
        return matrix

    def describe(self) -> str:
        return (
            "beta_0..3: G12 of |gamma12|, beta_4..7: E2 of eps2, beta_8..11: E1 of eps1, "
            "highest power first."
        )


CONSTANT = Polynomial(0)
LINEAR = Polynomial(1)
QUADRATIC = Polynomial(2)
CUBIC = Polynomial(3)


for _degree, _form_name in enumerate(DEGREES):
    _polynomial = Polynomial(_degree)
    register_form(Offer(_form_name, lambda *_, form=_polynomial: form, of_strain=_degree > 0))


#: Of beta: G12, then E2 and E1 where both yarns carry the same, each followed by what it gains
#: where its own normalised load ratio goes from 0 to 1.
LABELS = ("G12", "E2 at 1:1", "dE2", "E1 at 1:1", "dE1")
PLACES = {"G12": 0, "E2": 1, "E1": 3}


@dataclass(frozen=True)
class LoadRatio(LawForm):
    """Moduli that do not depend on strain, with E1 and E2 linear in the load ratio.

    beta has G12, E2 at equal loads and its gain dE2, E1 at equal loads and its gain dE1; MPa.
    """

    name = "load-ratio"
    size = len(LABELS)
    labels = LABELS
    modulus_of = ("G12", "E2", "E2", "E1", "E1")

    def piece_map(self) -> Array:
        rows = np.zeros((3, 1, 4, self.size))
        for name, place in PLACES.items():
            rows[COMPONENTS[name], 0, 3, place] = 1.0
        return rows

    def by_load_ratio(self) -> Array:
        """Return the derivatives (2, size) of E1 and E2 by the load ratio, as rows of beta."""
        rows = np.zeros((2, self.size))
        for name in ("E1", "E2"):
            rows[COMPONENTS[name], PLACES[name] + 1] = 1.0
        return rows

    def grid(self, component: int, end: float) -> Array:
        return np.array([0.0, end])

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from E2 and E1 at load ratios 0 and 1 of their own yarns to beta."""
        matrix = np.eye(self.size)
        for name in ("E1", "E2"):
            of_modulus = slice(PLACES[name], PLACES[name] + 2)
            matrix[of_modulus, of_modulus] = [[1.0 - EVEN, EVEN], [-1.0, 1.0]]
        return matrix

    def describe(self) -> str:
        return (
            "beta: G12; E2 at equal loads along warp and fill, and what it gains where its load "
            "ratio n2 / sqrt(n1^2 + n2^2) goes from 0 to 1; the same of E1."
        )


register_form(Offer("load-ratio", lambda *_: LoadRatio(), of_strain=False, of_load_ratio=True))
