"""The hypoelastic orthotropic law, vectorised over integration points.

d sigma = D(eps) d eps in the convected warp/fill frame; tangent moduli are cubics of the
logarithmic strain component in their own direction (Eqs 3.1-3.3):

    G12 = b0 g^3 + b1 g^2 + b2 g + b3,  E2 = b4 e2^3 + ... + b7,  E1 = b8 e1^3 + ... + b11,

or constant in three regions of that strain each (tri-linear, after Ambroziak and Klosowski):
G12 = b3 up to its first break, b2 up to its second, b1 beyond, b0 = 0; E2 and E1 likewise.

g = |gamma12|; nu21 = nu12 E2/E1; the stress is Cauchy stress in the material frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..caching import compiled
from ..errors import InputError
from .moduli import (
    MODULI,
    UNLIMITED,
    UNUSED,
    Form,
    coefficient_rows,
    held_strain,
    strain_breaks,
)
from .point_law import SLOPES, membrane_stress, stress_update

Array = NDArray[np.float64]
ThicknessChange = Literal["constant", "incompressible"]

__all__ = ["MODULI", "UNLIMITED", "Form", "HypoelasticLaw", "ThicknessChange"]


@dataclass(frozen=True, eq=False)
class HypoelasticLaw:
    """Tangent moduli and Poisson's ratio of a coated fabric.

    Parameters
    ----------
    beta : (12,) MPa, in the order of Eqs 3.1-3.3.
    nu12 : Poisson's ratio; 0.24 in the thesis.
    strain_range : (3,) ends (eps1, eps2, gamma12) of the range the coefficients hold for; beyond
        them, and below zero, a modulus keeps its end value.
    thickness_change : "constant" (the thesis' shells) or "incompressible" (resultant
        sigma t0 / area ratio).
    breaks : (3, 2) two positive, increasing strains for each of (eps1, eps2, gamma12): the law
        is tri-linear then, with beta_3, beta_2, beta_1 for G12 up to the first break, between
        the breaks and beyond, beta_7..5 for E2, beta_11..9 for E1; beta_0, 4 and 8 are zero.
    limits : what the compiled kernels need to know of range and breaks (`point_moduli`); made
        here.

    Raises
    ------
    InputError : not twelve finite coefficients, a range that is not positive, breaks that do not
        increase, or a coefficient that a tri-linear law does not have.
    """

    beta: Array
    nu12: float = 0.24
    strain_range: Array = None  # type: ignore[assignment]
    thickness_change: ThicknessChange = "constant"
    breaks: Array | None = None
    limits: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        beta = np.array(self.beta, dtype=float)
        if beta.shape != (12,) or not np.isfinite(beta).all():
            raise InputError(
                None, "beta", f"expected 12 finite coefficients, got shape {beta.shape}"
            )
        unlimited = [UNLIMITED] * 3
        ends = np.array(unlimited if self.strain_range is None else self.strain_range, dtype=float)
        if ends.shape != (3,) or not (ends > 0).all():
            raise InputError(
                None, "strain_range", f"expected 3 positive ends (eps1, eps2, gamma12), got {ends}"
            )
        if not 0 <= self.nu12 < 1:
            raise InputError(None, "nu12", f"expected 0 <= nu12 < 1, got {self.nu12}")
        if self.thickness_change not in ("constant", "incompressible"):
            raise InputError(
                None,
                "thickness_change",
                f"expected 'constant' or 'incompressible', got {self.thickness_change!r}",
            )
        limits, pairs = ends, None
        if self.breaks is not None:
            pairs = strain_breaks(self.breaks)
            pairs.flags.writeable = False
            if any(beta[i] != 0.0 for i in UNUSED):
                problem = "a tri-linear law has no beta_0, beta_4 and beta_8: expected 0, got "
                raise InputError(
                    None, "beta", problem + ", ".join(f"{beta[i]:g}" for i in sorted(UNUSED))
                )
            # A modulus that is held at its end never reaches a break from there on.
            reached = np.where(pairs < ends[:, None], pairs, UNLIMITED)
            limits = np.concatenate([ends, reached.ravel()])
        beta.flags.writeable = ends.flags.writeable = limits.flags.writeable = False
        for name, value in (
            ("beta", beta), ("strain_range", ends), ("breaks", pairs), ("limits", limits)
        ):  # fmt: skip
            object.__setattr__(self, name, value)

    @classmethod
    def linear(
        cls,
        e1: float,
        e2: float,
        g12: float,
        nu12: float = 0.24,
        thickness_change: ThicknessChange = "constant",
    ) -> HypoelasticLaw:
        """Constant moduli (MPa): the linear orthotropic law."""
        beta = np.zeros(12)
        beta[[3, 7, 11]] = g12, e2, e1
        return cls(beta, nu12, None, thickness_change)  # type: ignore[arg-type]

    @classmethod
    def trilinear(
        cls,
        e1: Sequence[float],
        e2: Sequence[float],
        g12: Sequence[float],
        breaks: ArrayLike,
        nu12: float = 0.24,
        strain_range: ArrayLike | None = None,
        thickness_change: ThicknessChange = "constant",
    ) -> HypoelasticLaw:
        """Moduli (MPa) that are constant in three regions of their strain.

        Parameters
        ----------
        e1, e2, g12 : (3,) moduli up to the first break, between the breaks, beyond the second.
        breaks : (3, 2) two strains for each of (eps1, eps2, gamma12).
        """
        beta = np.zeros(12)
        for name, values in (("E1", e1), ("E2", e2), ("G12", g12)):
            if np.shape(values) != (3,):
                raise InputError(None, name, f"expected 3 moduli, got {values}")
            first = MODULI[name][0]
            beta[[first + 3, first + 2, first + 1]] = values
        return cls(beta, nu12, strain_range, thickness_change, breaks)  # type: ignore[arg-type]

    @property
    def form(self) -> Form:
        """How the moduli depend on strain: "polynomial" or "trilinear"."""
        return "polynomial" if self.breaks is None else "trilinear"

    @property
    def area_power(self) -> float:
        """Power of the area ratio in J sigma: 1 constant, 0 incompressible thickness."""
        return 1.0 if self.thickness_change == "constant" else 0.0

    def with_beta(self, beta: ArrayLike) -> HypoelasticLaw:
        """The same law with other coefficients (MPa)."""
        return replace(self, beta=np.asarray(beta, dtype=float))

    def modulus(self, name: str, strain: ArrayLike) -> Array:
        """Tangent modulus (MPa) 'E1', 'E2' or 'G12' at strains of any shape."""
        first, component = MODULI[name]
        coefficients = self.beta[first : first + 4]
        if self.breaks is not None:
            rows = self.modulus_rows(name, np.ravel(strain))
            return np.asarray((rows @ coefficients).reshape(np.shape(strain)))
        held = held_strain(name, strain, self.strain_range[component])
        return np.asarray(np.polyval(coefficients, held))

    def modulus_rows(self, name: str, strain: ArrayLike) -> Array:
        """d modulus / d (its four coefficients) at strains (n,), (n, 4), held ones included."""
        _, component = MODULI[name]
        held = held_strain(name, strain, self.strain_range[component])
        return coefficient_rows(held, None if self.breaks is None else self.breaks[component])

    def E1(self, strain: ArrayLike) -> Array:
        """Warp tangent modulus (MPa), Eq. 3.3."""
        return self.modulus("E1", strain)

    def E2(self, strain: ArrayLike) -> Array:
        """Fill tangent modulus (MPa), Eq. 3.2."""
        return self.modulus("E2", strain)

    def G12(self, strain: ArrayLike) -> Array:
        """Shear tangent modulus (MPa), Eq. 3.1."""
        return self.modulus("G12", strain)

    def increment(
        self, strain_old: ArrayLike, strain_new: ArrayLike, stress_old: ArrayLike
    ) -> tuple[Array, Array]:
        """Stress (n, 3) MPa after one increment of strain (n, 3), and its tangent (n, 3, 3).

        NaN in the rows where a modulus is not positive.
        """
        old, new, stress = (
            np.ascontiguousarray(np.atleast_2d(a), dtype=float)
            for a in (strain_old, strain_new, stress_old)
        )
        return _increments(self.beta, self.nu12, self.limits, old, new, stress)

    def second_piola_kirchhoff(
        self,
        gradient: ArrayLike,
        strain_old: ArrayLike | None = None,
        stress_old: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array, Array]:
        """From surface deformation gradients to 2nd Piola-Kirchhoff stress.

        Parameters
        ----------
        gradient : (n, k, 2), k = 2 or 3: columns are the images of the unit warp and fill
            vectors.
        strain_old, stress_old : (n, 3) log strain and stress at the start; zero unless given.

        Returns
        -------
        pk2 (n, 3), d(pk2)/dE (n, 3, 3), log strain (n, 3), corotated Cauchy stress (n, 3).
        """
        f = np.asarray(gradient, dtype=float)
        right = np.einsum("nki,nkj->nij", f, f)
        zero = np.zeros((len(f), 3))
        old = zero if strain_old is None else np.ascontiguousarray(strain_old, dtype=float)
        stress = zero if stress_old is None else np.ascontiguousarray(stress_old, dtype=float)
        return _pull_backs(self.beta, self.nu12, self.limits, self.area_power, right, old, stress)


@compiled()
def _increments(beta, nu, limits, old, new, stress_old):  # type: ignore[no-untyped-def]
    n = len(old)
    stress, tangent = np.empty((n, 3)), np.empty((n, 3, 3))
    slopes = np.empty(SLOPES)
    for i in range(n):
        if not stress_update(
            beta, nu, limits, new[i], old[i], stress_old[i], stress[i], tangent[i], slopes
        ):
            stress[i], tangent[i] = np.nan, np.nan
    return stress, tangent


@compiled()
def _pull_backs(beta, nu, limits, power, right, old, stress_old):  # type: ignore[no-untyped-def]
    n = len(right)
    pk2, stiffness = np.empty((n, 3)), np.empty((n, 3, 3))
    strain, stress = np.empty((n, 3)), np.empty((n, 3))
    p, law, pull, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    slopes = np.empty(SLOPES)
    for i in range(n):
        m = 0.5 * (right[i, 0, 0] + right[i, 1, 1])
        q = 0.5 * (right[i, 0, 0] - right[i, 1, 1])
        c = right[i, 0, 1]
        if not membrane_stress(
            m, q, c, beta, nu, limits, power, old[i], stress_old[i], strain[i], stress[i],
            pk2[i], stiffness[i], p, law, slopes, pull, work,
        ):  # fmt: skip
            pk2[i], stiffness[i], strain[i], stress[i] = np.nan, np.nan, np.nan, np.nan
    return pk2, stiffness, strain, stress
