"""Tangent moduli as tables of strain: what solvers without the polynomials of Eqs 3.1-3.3 take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .forms.base import COMPONENTS, UNLIMITED
from .law import HypoelasticLaw

Array = NDArray[np.float64]


def curve_pieces(law: HypoelasticLaw, name: str) -> Array:
    """(n, 5) pieces of the modulus "E1", "E2" or "G12", MPa, each of them once.

    A row is the upper end of a piece and its four coefficients, highest power of the strain
    first; below zero strain and beyond the last end the modulus is held.

    Raises
    ------
    InputError : moduli that pieces of strain do not tell, because they depend on the load ratio.
    """
    if law.of_load_ratio:
        problem = (
            f"a {law.form.name} law is for the solver membrane: its moduli depend on the ratio of "
            "the loads, and here they are moduli of strain"
        )
        raise InputError(None, "form", problem)
    rows = law.pieces[COMPONENTS[name]]
    # What repeats the last piece ends where it does.
    return np.asarray(rows[: 1 + int((np.diff(rows[:, 0]) > 0).sum())])


def piece_constants(law: HypoelasticLaw) -> tuple[float, ...]:
    """How many pieces E1, E2 and G12 have (3), then the numbers of each: its pieces, row by row."""
    curves = [curve_pieces(law, name) for name in ("E1", "E2", "G12")]
    numbers = np.concatenate([curve.ravel() for curve in curves])
    return (*(float(len(curve)) for curve in curves), *numbers.tolist())


#: Points from zero strain to the end of the range.
POINTS = 121
#: Where a table ends when the law's range does not: a law without a range holds its polynomials
#: for any strain, a table cannot.
REACH = 0.3
#: Strain over which a table makes the jump of a modulus: a table takes one value a strain.
JUMP = 1e-6
#: Difference of two pieces where they meet, over the modulus there, that is more than rounding.
ROUNDING = 1e-9
#: Strains between two points at which the error of a table is looked for.
BETWEEN = 16


@dataclass(frozen=True, eq=False)
class ModulusTable:
    """One tangent modulus by its log strain; straight between points, held beyond both ends.

    name : "E1" (of eps1), "E2" (of eps2) or "G12" (of gamma12, the engineering shear, from
    -end to end: it is even in it). strain, modulus : (n,), increasing strains and MPa. error :
    largest relative difference from the law between the points, jumps left out. jumps : strains
    from 0 where the modulus jumps. reaches : whether the table covers the law's whole range.
    """

    name: str
    strain: Array
    modulus: Array
    error: float
    jumps: Array
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
    points : equally spaced strains from 0 to the end. Where one piece of the modulus gives way to
        the next there is one more, and two where it jumps.
    reach : the end where the law has no range.

    Raises
    ------
    InputError : fewer than two points, or a reach that is not positive.
    """
    if points < 2:
        raise InputError(None, "points", f"expected at least 2, got {points}")
    if not 0 < reach < UNLIMITED:
        raise InputError(None, "reach", f"expected a positive strain, got {reach:g}")
    component = COMPONENTS[name]
    end = float(law.strain_range[component])
    reaches = end < UNLIMITED
    end = end if reaches else reach
    strain = np.linspace(0.0, end, points)
    knots, jumps = _meetings(law, name, end)
    # An equally spaced strain inside a jump would make it a step of two slopes.
    spaced = strain[(np.abs(strain[:, None] - knots - JUMP / 2) >= JUMP).all(axis=1)]
    beyond = np.minimum(jumps + JUMP, end)
    strain = np.unique(np.concatenate([[0.0, end], spaced, knots, beyond]))
    modulus = law.modulus(name, strain)
    error = _error(law, name, strain, modulus, jumps)
    if name == "G12":
        strain = np.concatenate([-strain[:0:-1], strain])
        modulus = np.concatenate([modulus[:0:-1], modulus])
    return ModulusTable(name, strain, modulus, error, jumps, reaches)


def modulus_tables(
    law: HypoelasticLaw, points: int = POINTS, reach: float = REACH
) -> dict[str, ModulusTable]:
    """The tables of E1, E2 and G12, by name; as `modulus_table`."""
    return {name: modulus_table(law, name, points, reach) for name in COMPONENTS}


def _meetings(law: HypoelasticLaw, name: str, end: float) -> tuple[Array, Array]:
    """Strains before `end` where one piece gives way to the next, and those where it jumps."""
    pieces = curve_pieces(law, name)
    knots = pieces[:-1, 0]
    here, there = (
        np.array([np.polyval(piece[1:], knot) for piece, knot in zip(side, knots, strict=True)])
        for side in (pieces[:-1], pieces[1:])
    )
    jump = np.abs(there - here) > ROUNDING * np.maximum(np.abs(here), np.abs(there))
    inside = knots < end
    return knots[inside], knots[inside & jump]


def _error(law: HypoelasticLaw, name: str, strain: Array, modulus: Array, jumps: Array) -> float:
    starts, widths = strain[:-1], np.diff(strain)
    smooth = ~np.isin(starts, jumps)
    shares = np.arange(1, BETWEEN) / BETWEEN
    x = (starts[smooth, None] + widths[smooth, None] * shares).ravel()
    exact = law.modulus(name, x)
    off = np.abs(np.interp(x, strain, modulus) - exact)
    return float(np.max(off / np.maximum(np.abs(exact), np.finfo(float).tiny)))
