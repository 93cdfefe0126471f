"""Linear orthotropic constants per width, in the forms that programs ask for.

Inverse form, strains (change of length over length) of loads per width n (kN/m = N/mm):

    eps_w = n_w / E_w - nu_w n_f / E_f,    eps_f = n_f / E_f - nu_f n_w / E_w.

nu_w is how much the warp contracts when the fill is pulled (published as nu_xy beside E_x, E_y, x
the warp), nu_f how much the fill contracts when the warp is pulled (nu12 of this program's law).
Reciprocal constants have nu_w / E_f = nu_f / E_w. The direct form is its inverse:

    n_w = A_w eps_w + A_wf eps_f,    n_f = A_fw eps_w + A_f eps_f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError

Array = NDArray[np.float64]

#: Relative: constants whose cross terms differ by less are reciprocal.
SAME = 1e-9


@dataclass(frozen=True)
class DesignersConstants:
    """Stiffnesses per width in kN/m.

    warp, fill : E_w, E_f. nu_warp, nu_fill : nu_w, nu_f as above. shear : G, None where it is not
    known: a biaxial test along the yarns says nothing of it.
    """

    warp: float
    fill: float
    nu_warp: float
    nu_fill: float
    shear: float | None = None

    @classmethod
    def of_compliance(cls, compliance: ArrayLike, shear: float | None = None) -> DesignersConstants:
        """Of eps = C n, C (2, 2) per kN/m.

        Raises
        ------
        InputError : a diagonal that is not positive: no such constants.
        """
        c = np.asarray(compliance, dtype=float)
        if not (np.isfinite(c).all() and c[0, 0] > 0 and c[1, 1] > 0):
            problem = "a fabric would get shorter when it is pulled: these paths have no constants"
            raise InputError(None, "constants", problem)
        warp, fill = 1 / c[0, 0], 1 / c[1, 1]
        return cls(float(warp), float(fill), float(-c[0, 1] * fill), float(-c[1, 0] * warp), shear)

    @classmethod
    def of_stiffness(cls, stiffness: ArrayLike, shear: float | None = None) -> DesignersConstants:
        """Of n = A eps, A (2, 2) kN/m: the direct form.

        Raises
        ------
        InputError : it has no inverse of that kind.
        """
        a = np.asarray(stiffness, dtype=float)
        det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        if not det > 0:
            problem = "the direct form has no inverse: these paths have no constants"
            raise InputError(None, "constants", problem)
        inverse = np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]) / det
        return cls.of_compliance(inverse, shear)

    @property
    def compliance(self) -> Array:
        """C (2, 2) of eps = C n, per kN/m."""
        across = -self.nu_warp / self.fill, -self.nu_fill / self.warp
        return np.array([[1 / self.warp, across[0]], [across[1], 1 / self.fill]])

    @property
    def stiffness(self) -> Array:
        """A (2, 2) of n = A eps, kN/m: the direct form.

        Raises
        ------
        InputError : nu_warp nu_fill is not below 1.
        """
        rest = 1.0 - self.nu_warp * self.nu_fill
        if not rest > 0:
            problem = f"nu_warp nu_fill is {1 - rest:.3g}; expected below 1"
            raise InputError(None, "constants", problem)
        a = np.array([[self.warp, self.nu_warp * self.warp], [self.nu_fill * self.fill, self.fill]])
        return np.asarray(a / rest)

    @property
    def reciprocal(self) -> bool:
        """Whether a strain energy belongs to them."""
        one, other = self.nu_warp / self.fill, self.nu_fill / self.warp
        return abs(one - other) <= SAME * max(abs(one), abs(other), 1e-300)

    @property
    def stable(self) -> bool:
        """Whether every stretch takes work: nu_warp nu_fill < 1 where they are reciprocal."""
        c = self.compliance
        return bool(c[0, 0] * c[1, 1] > (0.5 * (c[0, 1] + c[1, 0])) ** 2)

    def strain(self, loads: ArrayLike) -> Array:
        """(n, 2) of loads (n, 2) kN/m."""
        return np.asarray(np.asarray(loads, dtype=float) @ self.compliance.T)
