"""Closed-form estimate of a modulus from pressures and apex heights of an inflated circular sheet.

The inflated sheet is taken for a spherical cap, corrected by the apex of Hencky's flat membrane, so
that a sheet of linear material is evaluated exactly while strains are small. Warp and fill count as
equal.

References
----------
W. B. Fichter, Some solutions for the large deflections of uniformly loaded circular membranes, NASA
Technical Paper 3658 (1997).
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..errors import InputError
from ..light_dataclasses import dataclass
from ..materials.forms.base import Array
from ..materials.law import ThicknessChange

#: Hencky's series of the membrane force, sum of c b^(1 - 3 n) (r / R)^(2 n), and of the height,
#: sum of c b^-(1 + 3 n) (1 - (r / R)^(2 n + 2)), with b the force at the apex: c from n = 0 on.
FORCE_SERIES = np.array([1, -1, -2 / 3, -13 / 18, -17 / 18, -37 / 27, -1205 / 567])
HEIGHT_SERIES = np.array([1, 1 / 2, 5 / 9, 55 / 72, 7 / 6, 205 / 108, 17051 / 5292])
#: Where b lies for Poisson's ratios of 0 to `MAX_NU12`, beyond which the series converge slowly.
FORCE_BRACKET = (1.5, 3.0)
MAX_NU12 = 0.9
#: Least exponent of stress as a power of strain, so that the modulus is positive with any data.
MIN_EXPONENT = 0.1


@dataclass(frozen=True)
class HenckyApex:
    """The apex of Hencky's membrane, flat without load and of a linear material, beside a cap's.

    Attributes
    ----------
    strain : float
        Strain at the apex over (height / radius)^2.
    tension : float
        Membrane force at the apex over that of a spherical cap of the same height.
    """

    strain: float
    tension: float


def hencky_apex(nu12: float) -> HenckyApex:
    """Solve Hencky's membrane for a Poisson's ratio; one above 0.9 counts as 0.9."""
    nu12 = min(nu12, MAX_NU12)
    powers = 2.0 * np.arange(len(FORCE_SERIES))

    def strain_of_rim(force: float) -> float:
        return float((FORCE_SERIES * force ** (1.0 - 1.5 * powers)) @ (powers + 1.0 - nu12))

    force = float(scipy.optimize.brentq(strain_of_rim, *FORCE_BRACKET))
    height = float(HEIGHT_SERIES @ force ** -(1.0 + 1.5 * powers))
    return HenckyApex((1.0 - nu12) * force / (4.0 * height**2), height * force)


@dataclass(frozen=True, eq=False)
class CapEstimate:
    """The curve of equal biaxial stress that pressures and apex heights give in closed form.

    Attributes
    ----------
    strain : (n,) array
        Logarithmic strain at the apex, alike along warp and fill.
    stress : (n,) array, MPa
        Cauchy stress at the apex.
    modulus : (n,) array, MPa
        Tangent modulus E of warp and fill, 1 - nu12 times d stress / d strain, with stress as a
        power of strain.
    nu12 : float
        Poisson's ratio.
    """

    strain: Array
    stress: Array
    modulus: Array
    nu12: float

    @property
    def result(self) -> dict[str, list[float]]:
        """Return strain, stress and modulus as plain values."""
        return {
            "strain": self.strain.tolist(),
            "stress_MPa": self.stress.tolist(),
            "modulus_MPa": self.modulus.tolist(),
        }

    @property
    def words(self) -> str:
        """Return the modulus at the first, the middle and the last strain in words."""
        ends = dict.fromkeys((0, len(self.strain) // 2, len(self.strain) - 1))
        values = [f"{self.modulus[k]:.3g} at {100 * self.strain[k]:.2g} %" for k in ends]
        return f"closed form, E1 = E2, MPa: {', '.join(values)}"


def cap_estimate(
    pressures: ArrayLike,
    heights: ArrayLike,
    radius: float,
    thickness: float,
    nu12: float = 0.24,
    thickness_change: ThicknessChange = "constant",
) -> CapEstimate:
    """Estimate stress, strain and modulus from the apex of an inflated circular sheet.

    Parameters
    ----------
    pressures : (n,) array_like, MPa
        Pressures of first loading, in any order.
    heights : (n,) array_like, mm
        Rises of the apex above the flat sheet; pairs that are not both positive are left out.
    radius : float, mm
        Radius of the rim; `Outline.dome_radius` of an ellipse.
    thickness : float, mm
        Thickness without load.
    nu12 : float
        Poisson's ratio, 0 to below 1.
    thickness_change : {"constant", "incompressible"}
        As a law has it.

    Returns
    -------
    CapEstimate
        Sorted by strain; n counts the pairs that are used.

    Raises
    ------
    InputError
        No pair is positive.

    Notes
    -----
    A cap of height h has the radius of curvature (R^2 + h^2) / (2 h), in which the membrane force
    is half of it times the pressure; its strain is 2/3 (h / R)^2 where it is small. Both factors
    are those of `hencky_apex`, and the strain is log(1 + factor (h / R)^2).
    """
    rises = np.asarray(heights, dtype=float)
    loads = np.asarray(pressures, dtype=float)
    is_used = (rises > 0) & (loads > 0)
    if not is_used.any():
        raise InputError(None, "heights", "no pair of pressure and apex height is positive")
    order = np.argsort(rises[is_used])
    height = rises[is_used][order]
    pressure = loads[is_used][order]
    apex = hencky_apex(nu12)
    strain = np.log1p(apex.strain * (height / radius) ** 2)
    tension = apex.tension * pressure * (radius**2 + height**2) / (4.0 * height)
    area_ratio = np.exp(2.0 * strain) if thickness_change == "incompressible" else 1.0
    stress = tension * area_ratio / thickness
    return CapEstimate(strain, stress, (1.0 - nu12) * _slope(strain, stress, height), nu12)


def _slope(strain: Array, stress: Array, height: Array) -> Array:
    """Return d stress / d strain, the secant times the exponent of stress as a power of strain.

    The exponent is fitted to relative errors that are inverse to the heights, whose errors are
    alike; a parabola would follow a sheet that was not taut down to no stiffness at all.

    Parameters
    ----------
    strain, stress : (n,) array
        Of the apex; the unit of the stress is that of the result.
    height : (n,) array, mm
        Rise of the apex.
    """
    exponent = 1.0
    if len(np.unique(strain)) > 1:
        exponent = float(np.polyfit(np.log(strain), np.log(stress), 1, w=height)[0])
    return max(exponent, MIN_EXPONENT) * stress / strain
