"""The unknowns of a fit: modulus values at Chebyshev points, and nuisance parameters.

Monomial coefficients are badly scaled (condition 1e8 against 6e3 in modulus values), so the fit
works in values of the moduli at Chebyshev points of the strain range; bounds on the coefficients
and positivity of the moduli are linear in either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..materials.positivity import GRID, margins, modulus_grid

Array = NDArray[np.float64]

#: Order of the moduli in beta, and the place of their strain in (eps1, eps2, gamma12).
STRAIN_OF_BLOCK = (2, 1, 0)
#: How far E1 stays above nu12^2 E2, where the law ceases to be positive definite.
DEFINITE = 1.02


@dataclass(frozen=True, eq=False)
class ModuliParameters:
    """Coefficients of the moduli between bounds, and how the fit sees them.

    Parameters
    ----------
    degree : 0 (linear orthotropic constants) to 3 (Eqs 4.1-4.3); 2 for a tri-linear law.
    lower, upper : (3 (degree + 1),) MPa bounds on the coefficients, G12, E2, E1, highest first.
    strain_range : ends (eps1, eps2, gamma12) over which the moduli must be positive.
    margin_E, margin_G : MPa, the least modulus allowed there.
    displacement_offset, pressure_offset : nuisance parameters switched on.
    breaks : (3, 2) strains (eps1, eps2, gamma12) between the regions of a tri-linear law.
    least, largest : (3,) MPa, the least and largest E1, E2, G12 allowed anywhere on the strain
        range, both or neither; `least` then takes the place of the margins, and starts are drawn
        from modulus values between the two instead of from the box of the coefficients.
    strip_nu12 : Poisson's ratio where strips are pulled: they contract, so that the modulus across
        is that at zero strain, and E1 > nu12^2 E2 (a positive definite law) is linear there.
    """

    degree: int
    lower: Array
    upper: Array
    strain_range: Sequence[float]
    margin_E: float
    margin_G: float
    displacement_offset: bool = False
    pressure_offset: bool = False
    least_pressure: float = 1.0
    breaks: Array | None = None
    least: Array | None = None
    largest: Array | None = None
    strip_nu12: float | None = None

    @classmethod
    def between(
        cls, degree: int, strain_range: Sequence[float], least: Array, largest: Array, **other: Any
    ) -> ModuliParameters:
        """Bounds on the moduli E1, E2, G12 (3,) MPa instead of on their coefficients.

        The box of the coefficients is the smallest that holds every modulus whose values at the
        Chebyshev points lie between the bounds.
        """
        size = 3 * (degree + 1)
        ones = np.ones(size)
        margins = float(min(least[:2])), float(least[2])
        draft = cls(degree, ones, ones, strain_range, *margins, **other)
        t = draft.from_values
        block = np.repeat(STRAIN_OF_BLOCK, degree + 1)
        low, high = t * least[block], t * largest[block]
        lower, upper = np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)
        a, b = np.asarray(least, float), np.asarray(largest, float)
        return replace(draft, lower=lower, upper=upper, least=a, largest=b)

    @property
    def places(self) -> NDArray[np.intp]:
        """Place of each free coefficient in beta (12,)."""
        return np.array([4 * b + k for b in range(3) for k in range(3 - self.degree, 4)])

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return 3 * (self.degree + 1)

    @property
    def nuisance(self) -> tuple[str, ...]:
        """Names of the nuisance parameters that are on, in the order of the unknowns."""
        names = ("offset_x", "offset_y", "offset_z") if self.displacement_offset else ()
        return (*names, "pressure_offset") if self.pressure_offset else names

    @cached_property
    def from_values(self) -> Array:
        """(size, size): free coefficients = this @ moduli (MPa) at the Chebyshev points, or in
        the regions of a tri-linear law."""
        n = self.degree + 1
        if self.breaks is not None:
            return np.eye(self.size)
        whole = np.zeros((self.size, self.size))
        for block, strain in enumerate(STRAIN_OF_BLOCK):
            points = (
                0.5
                * self.strain_range[strain]
                * (1.0 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
            )
            part = slice(n * block, n * block + n)
            whole[part, part] = np.linalg.inv(np.vander(points, n))
        return whole

    @cached_property
    def to_coefficients(self) -> Array:
        """(size, size): free coefficients = this @ unknowns."""
        # Values in units of the modulus' own size: G12 is a tenth of E.
        last = np.repeat(np.arange(3), self.degree + 1) * (self.degree + 1) + self.degree
        ends = np.maximum(self.lower[last], 1e-3), np.maximum(self.upper[last], 1e-3)
        return self.from_values * np.sqrt(ends[0] * ends[1])

    def beta(self, y: Array) -> Array:
        """Full beta (12,) MPa of the unknowns y (size + nuisance,)."""
        full = np.zeros(12)
        full[self.places] = self.to_coefficients @ y[: self.size]
        return full

    def unknowns(self, coefficients: Array) -> Array:
        """Unknowns of free coefficients (size,) MPa, nuisance parameters zero."""
        values = np.linalg.solve(self.to_coefficients, coefficients)
        return np.concatenate([values, np.zeros(len(self.nuisance))])

    @cached_property
    def positivity(self) -> tuple[Array, Array]:
        """A, margin of `A @ coefficients >= margin`: moduli on a strain grid."""
        grid = modulus_grid(self.strain_range, self.breaks)
        if self.least is not None:
            return grid[:, self.places], np.repeat(self.least[list(STRAIN_OF_BLOCK)], GRID)
        return grid[:, self.places], margins(self.margin_E, self.margin_G)

    @cached_property
    def inequalities(self) -> tuple[Array, Array]:
        """A, c of `A @ y >= c`: positivity, coefficient bounds, nuisance bounds; rows scaled."""
        grid, margin = self.positivity
        t = self.to_coefficients
        # A coefficient held by equal bounds is scaled by itself.
        width = self.upper - self.lower
        width = np.where(width > 0, width, np.maximum(np.abs(self.upper), 1.0))
        moduli = grid @ t
        size = 1.0 / np.abs(moduli).max(axis=1)
        a = np.vstack([moduli * size[:, None], t / width[:, None], -t / width[:, None]])
        c = np.concatenate([margin * size, self.lower / width, -self.upper / width])
        if self.largest is not None:
            a = np.vstack([a, -moduli * size[:, None]])
            c = np.append(c, -np.repeat(self.largest[list(STRAIN_OF_BLOCK)], GRID) * size)
        if self.strip_nu12 is not None:
            e2, e1 = moduli[GRID : 2 * GRID], moduli[2 * GRID :]
            share = DEFINITE * self.strip_nu12**2
            definite = np.vstack([e1[0] - share * e2, e1 - share * e2[0]])
            definite /= np.abs(definite).max(axis=1, keepdims=True)
            a, c = np.vstack([a, definite]), np.append(c, np.zeros(len(definite)))
        extra = len(self.nuisance)
        if extra:
            wide = np.zeros((len(a) + 2 * extra, self.size + extra))
            wide[: len(a), : self.size] = a
            low, high = self.nuisance_bounds
            wide[len(a) : len(a) + extra, self.size :] = np.eye(extra)
            wide[len(a) + extra :, self.size :] = -np.eye(extra)
            a, c = wide, np.concatenate([c, low, -high])
        return a, c

    @property
    def nuisance_bounds(self) -> tuple[Array, Array]:
        """Offsets within 20 mm; a pressure offset (kPa) leaves the first pressure positive."""
        low = {"pressure_offset": -0.9 * 1e3 * self.least_pressure}
        high = {"pressure_offset": 50.0}
        names = self.nuisance
        return (
            np.array([low.get(name, -20.0) for name in names]),
            np.array([high.get(name, 20.0) for name in names]),
        )

    def offsets(self, y: Array) -> tuple[Array, float]:
        """Displacement offset (3,) mm and pressure offset MPa of the unknowns."""
        named = dict(zip(self.nuisance, y[self.size :], strict=True))
        shift = np.array([named.get(f"offset_{axis}", 0.0) for axis in "xyz"])
        return shift, 1e-3 * named.get("pressure_offset", 0.0)

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """`count` random coefficients (count, size), not all of them feasible.

        Even in the box of the bounds; where the moduli themselves are bounded, even in the
        logarithm of their values at the Chebyshev points.
        """
        share = random.random((count, self.size))
        if self.least is None or self.largest is None:
            return np.asarray(self.lower + (self.upper - self.lower) * share)
        ends = [
            np.log(np.repeat(e[list(STRAIN_OF_BLOCK)], self.degree + 1))
            for e in (self.least, self.largest)
        ]
        return np.asarray(np.exp(ends[0] + (ends[1] - ends[0]) * share) @ self.from_values.T)

    def allowed(self, coefficients: Array) -> NDArray[np.bool_]:
        """Which of the coefficients (n, size) have moduli inside their bounds, (n,)."""
        grid, margin = self.positivity
        moduli = coefficients @ grid.T
        good = (moduli >= margin).all(axis=1)
        if self.largest is not None:
            good &= (moduli <= np.repeat(self.largest[list(STRAIN_OF_BLOCK)], GRID)).all(axis=1)
        return np.asarray(good)

    def is_positive(self, coefficients: Array) -> bool:
        """The thesis' boolean flag (Eq. 4.9): every modulus above its margin on the grid."""
        grid, margin = self.positivity
        return bool((grid @ coefficients >= margin).all())
