"""Check that a law is possible: positive moduli in its range of strain, and work of closed paths.

Along a closed path of strain the work is zero for a law that has an energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..compilation import compiled
from ..errors import InputError
from .forms.base import COMPONENTS, EVEN, SHEAR, UNLIMITED, Array, crimp_map, ratios_of
from .law import HypoelasticLaw
from .pieces import PointState, point_response
from .point_law import stress_update


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


#: Log strain to which the path goes along yarns whose moduli have no range.
DEFAULT_END = 0.05


@dataclass(frozen=True)
class ClosedPath:
    """The work of a law along strains 0, (a, 0), (a, b), (0, b), 0 of warp and fill.

    Attributes
    ----------
    ends : (float, float)
        a and b, log strain.
    work : float, MPa
        Of the whole path; NaN where the law ends on the way.
    share : float
        Of the work from rest to (a, b).
    """

    ends: tuple[float, float]
    work: float
    share: float

    @property
    def words(self) -> str:
        """Return a sentence with the path, its work and the share."""
        corners = "0, (a, 0), (a, b), (0, b), 0"
        words = f"Work of the path of log strains {corners} with a, b = {self.ends[0]:.4g}, "
        words += f"{self.ends[1]:.4g}"
        if not np.isfinite(self.work):
            return f"{words} is not known: the law ends on the way."
        return f"{words}: {self.work:.3g} MPa, {100 * self.share:.2g} % of that to (a, b)."


def closed_path(
    law: HypoelasticLaw, ends: Sequence[float] | None = None, increments: int = 40
) -> ClosedPath:
    """Compute the work of first loading along a closed path.

    Parameters
    ----------
    law : HypoelasticLaw
    ends : (2,) sequence of float, optional
        Log strains a and b of `ClosedPath`; by default the ends of the law's range, or
        `DEFAULT_END` where it has none.
    increments : int
        Of each of the four sides.
    """
    range_ends = [float(end) for end in law.strain_range[:2]]
    a, b = ends or [end if end < UNLIMITED else DEFAULT_END for end in range_ends]
    first_loading = law if law.memory is None else replace(law, memory=None)
    shares = np.arange(1, increments + 1)[:, None] / increments
    strains = ((0, 0), (a, 0), (a, b), (0, b), (0, 0))
    corners = [np.array([*corner, 0.0]) for corner in strains]
    path = np.concatenate([start + shares * (end - start) for start, end in pairwise(corners)])
    work = _work(first_loading.compiled, path)
    share = work.sum() / work[: 2 * increments].sum()
    return ClosedPath((a, b), float(work.sum()), float(share))


@compiled()
def _work(law, path):  # type: ignore[no-untyped-def]
    """Return (n,) MPa, the work of each increment of strain from rest to path (n, 3), or NaN."""
    work = np.full(len(path), np.nan)
    written = point_response().law
    strain = np.zeros(3)
    stress = np.zeros(3)
    stress_old = np.zeros(3)
    for n in range(len(path)):
        before = PointState(strain, stress_old)
        if not stress_update(law, before, PointState(path[n], stress), written):
            break
        work[n] = 0.5 * ((stress + stress_old) * (path[n] - strain)).sum()
        strain = path[n]
        stress_old = stress.copy()
    return work
