"""Check that a law is possible: all that must be positive, anywhere in its range of strain."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .forms.base import COMPONENTS, EVEN, SHEAR, UNLIMITED, Array, crimp_map, ratios_of
from .law import HypoelasticLaw


def check_positive(law: HypoelasticLaw) -> None:
    """Check that a law is possible in its range of strain, at every load ratio.

    A card, a draw, a neighbour: whatever makes a law other than a fit, which keeps its bounds, has
    to look at it with this function, or with `is_positive`.

    Raises
    ------
    InputError
        A modulus, a constant of crimp, or 1 - nu12 nu21 at zero strain is not positive.
    """
    for name in COMPONENTS:
        modulus, strain = smallest_modulus(law, name)
        if not modulus > 0:
            problem = f"{name} is {modulus:.4g} MPa at {100 * strain:.4g} % of"
            words = f"{problem} log strain, where the card is to hold; expected > 0"
            raise InputError(None, "beta", words)
    crimp = crimp_map(law.form) @ law.beta
    if not (crimp > 0).all():
        problem = f"a constant of crimp is {crimp.min():.4g} MPa; expected > 0"
        raise InputError(None, "beta", problem)
    if not law.nu12**2 * float(law.E2(0.0) / law.E1(0.0)) < 1:
        problem = f"nu12 nu21 is not below 1 at zero strain, for nu12 = {law.nu12:g}"
        raise InputError(None, "nu12", f"{problem} and E2/E1 of the card")


def is_positive(law: HypoelasticLaw) -> bool:
    """Return whether a law is possible, as `check_positive`."""
    try:
        check_positive(law)
    except InputError:
        return False
    return True


def smallest_modulus(law: HypoelasticLaw, name: str) -> tuple[float, float]:
    """Return the smallest value (MPa) of a modulus in the law's range, and its strain.

    It is exact: at a break, an end, or where the slope of a piece is zero. A piece without an end
    is looked at where it begins.
    """
    smallest = np.inf
    place = 0.0
    lower = 0.0
    for upper, *cubic in law.pieces[COMPONENTS[name]]:
        strains = _extreme_strains(np.array(cubic), lower, upper)
        values = np.polyval(cubic, strains)
        index = np.argmin(np.where(np.isnan(values), -np.inf, values))
        if not values[index] >= smallest:
            smallest = values[index]
            place = strains[index]
        lower = upper
    gain = 0.0 if name == SHEAR else law.coupling[1 + COMPONENTS[name]]
    change = min((ratio - EVEN) * gain for ratio in ratios_of(law.form, name))
    return smallest + change, place


def _extreme_strains(cubic: Array, lower: float, upper: float) -> Array:
    """Return the ends of a piece, and the strains between them where its slope is zero.

    Parameters
    ----------
    cubic : (4,) array
        Coefficients of the modulus in the strain, highest power first.
    """
    if upper >= UNLIMITED:
        return np.array([lower])
    roots = np.roots(np.polyder(cubic))
    extremes = [r.real for r in roots if abs(r.imag) < 1e-12 and lower < r.real < upper]
    return np.array([lower, upper, *extremes])
