"""Tangent moduli as tables of strain: what solvers without the polynomials of Eqs 3.1-3.3 take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .law import HypoelasticLaw
from .moduli import MODULI, UNLIMITED

Array = NDArray[np.float64]

#: Points from zero strain to the end of the range.
POINTS = 121
#: Where a table ends when the law's range does not: a law without a range holds its polynomials
#: for any strain, a table cannot.
REACH = 0.3
#: Strain over which a table makes the jump of a tri-linear modulus: a table takes one value a
#: strain.
JUMP = 1e-6
#: Strains between two points at which the error of a table is looked for.
BETWEEN = 16


@dataclass(frozen=True, eq=False)
class ModulusTable:
    """One tangent modulus by its log strain; straight between points, held beyond both ends.

    name : "E1" (of eps1), "E2" (of eps2) or "G12" (of gamma12, the engineering shear, from
    -end to end: it is even in it). strain, modulus : (n,), increasing strains and MPa. error :
    largest relative difference from the law between the points, jumps left out. reaches : whether
    the table covers the law's whole range.
    """

    name: str
    strain: Array
    modulus: Array
    error: float
    reaches: bool

    def at(self, strain: NDArray[np.float64] | float) -> Array:
        """The modulus (MPa) that a solver reads off the table."""
        return np.asarray(np.interp(strain, self.strain, self.modulus))


def modulus_table(
    law: HypoelasticLaw, name: str, points: int = POINTS, reach: float = REACH
) -> ModulusTable:
    """The table of one modulus.

    Parameters
    ----------
    points : equally spaced strains from 0 to the end; each break of a tri-linear law adds two.
    reach : the end where the law has no range.

    Raises
    ------
    InputError : fewer than two points, or a reach that is not positive.
    """
    if points < 2:
        raise InputError(None, "points", f"expected at least 2, got {points}")
    if not 0 < reach < UNLIMITED:
        raise InputError(None, "reach", f"expected a positive strain, got {reach:g}")
    component = MODULI[name][1]
    end = float(law.strain_range[component])
    reaches = end < UNLIMITED
    end = end if reaches else reach
    strain = np.linspace(0.0, end, points)
    jumps = np.empty(0)
    if law.breaks is not None:
        jumps = law.breaks[component][law.breaks[component] + JUMP < end]
        # An equally spaced strain inside a jump would make it a step of two slopes.
        near = (np.abs(strain[:, None] - jumps - JUMP / 2) < JUMP).any(axis=1)
        strain = np.unique(np.concatenate([strain[~near], jumps, jumps + JUMP]))
    modulus = law.modulus(name, strain)
    error = _error(law, name, strain, modulus, jumps)
    if name == "G12":
        strain = np.concatenate([-strain[:0:-1], strain])
        modulus = np.concatenate([modulus[:0:-1], modulus])
    return ModulusTable(name, strain, modulus, error, reaches)


def modulus_tables(
    law: HypoelasticLaw, points: int = POINTS, reach: float = REACH
) -> dict[str, ModulusTable]:
    """The tables of E1, E2 and G12, by name; as `modulus_table`."""
    return {name: modulus_table(law, name, points, reach) for name in MODULI}


def _error(law: HypoelasticLaw, name: str, strain: Array, modulus: Array, jumps: Array) -> float:
    starts, widths = strain[:-1], np.diff(strain)
    smooth = ~np.isin(starts, jumps)
    shares = np.arange(1, BETWEEN) / BETWEEN
    x = (starts[smooth, None] + widths[smooth, None] * shares).ravel()
    exact = law.modulus(name, x)
    off = np.abs(np.interp(x, strain, modulus) - exact)
    return float(np.max(off / np.maximum(np.abs(exact), np.finfo(float).tiny)))
