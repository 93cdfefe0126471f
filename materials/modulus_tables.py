"""Tables of a law's moduli by their strain, and the pieces of each, for programs that take them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .forms.base import COMPONENTS, SHEAR, UNLIMITED, Array
from .law import HypoelasticLaw

#: Points from zero strain to the end of the range.
POINTS = 121
#: Where a table ends when the law's range does not.
REACH = 0.3
#: Strain over which a table makes the jump of a modulus: a table takes one value a strain.
JUMP = 1e-6
#: Difference of two pieces where they meet, over the modulus there, that is more than rounding.
ROUNDING = 1e-9
#: Strains between two points at which the error of a table is looked for.
CHECKED_BETWEEN = 16


def curve_pieces(law: HypoelasticLaw, name: str, coupled: bool = False) -> Array:
    """Return the pieces of a modulus.

    Parameters
    ----------
    law : HypoelasticLaw
    name : {"E1", "E2", "G12"}
    coupled : bool
        Whether the caller knows that the modulus may also depend on the loads' ratio.

    Returns
    -------
    (n, 5) ndarray, MPa
        Upper end of each piece, then its coefficients, highest power first.

    Raises
    ------
    InputError
        For a law that depends on the loads' ratio, unless `coupled`.
    """
    if law.of_load_ratio and not coupled:
        problem = (
            f"a {law.form.name} law is for the solvers membrane and calculix: its stiffness "
            "depends on the ratio of the loads, and here moduli are of strain"
        )
        raise InputError(None, "form", problem)
    pieces = law.pieces[COMPONENTS[name]]
    # What repeats the last piece ends where it does.
    count = 1 + (np.diff(pieces[:, 0]) > 0).sum()
    return np.asarray(pieces[:count])


def piece_constants(law: HypoelasticLaw, coupled: bool = False) -> tuple[float, ...]:
    """Return the numbers of pieces of E1, E2 and G12 (3), then the pieces of each, row by row."""
    curves = [curve_pieces(law, name, coupled) for name in COMPONENTS]
    numbers = np.concatenate([curve.ravel() for curve in curves])
    return (*(float(len(curve)) for curve in curves), *numbers.tolist())


@dataclass(frozen=True, eq=False)
class ModulusTable:
    """One tangent modulus by its log strain; straight between points, held beyond both ends.

    Attributes
    ----------
    name : {"E1", "E2", "G12"}
    strain : (n,) ndarray
        Of G12 from minus to plus the end.
    modulus : (n,) ndarray, MPa
    error : float
        Largest relative difference from the law between the points.
    jumps : (m,) ndarray
        Strains where the modulus jumps.
    reaches : bool
        Whether the law's range is covered to its end.
    """

    name: str
    strain: Array
    modulus: Array
    error: float
    jumps: Array
    reaches: bool

    def at(self, strain: NDArray[np.float64] | float) -> Array:
        """Return the modulus (MPa) that a solver reads off the table."""
        return np.asarray(np.interp(strain, self.strain, self.modulus))


def modulus_table(
    law: HypoelasticLaw,
    name: str,
    points: int = POINTS,
    reach: float = REACH,
) -> ModulusTable:
    """Tabulate a modulus.

    Parameters
    ----------
    law : HypoelasticLaw
    name : {"E1", "E2", "G12"}
    points : int
        Equally spaced strains from zero to the end; ends of pieces are points, too.
    reach : float
        Log strain at which the table ends where the law has no range.

    Raises
    ------
    InputError
        For too few points or no reach; for a law that depends on the loads' ratio.
    """
    if points < 2:
        raise InputError(None, "points", f"expected at least 2, got {points}")
    if not 0 < reach < UNLIMITED:
        raise InputError(None, "reach", f"expected a positive strain, got {reach:g}")
    range_end = float(law.strain_range[COMPONENTS[name]])
    has_range = range_end < UNLIMITED
    end = range_end if has_range else reach
    knots, jumps = _knots_and_jumps(law, name, end)
    spaced = np.linspace(0.0, end, points)
    # An equally spaced strain inside a jump would make it a step of two slopes.
    spaced = spaced[(np.abs(spaced[:, None] - knots - JUMP / 2) >= JUMP).all(axis=1)]
    after_jumps = np.minimum(jumps + JUMP, end)
    strain = np.unique(np.concatenate([[0.0, end], spaced, knots, after_jumps]))
    modulus = law.modulus(name, strain)
    error = _largest_error(law, name, strain, modulus, jumps)
    if name == SHEAR:
        strain = np.concatenate([-strain[:0:-1], strain])
        modulus = np.concatenate([modulus[:0:-1], modulus])
    return ModulusTable(
        name,
        strain,
        modulus,
        error,
        jumps,
        has_range,
    )


def modulus_tables(
    law: HypoelasticLaw, points: int = POINTS, reach: float = REACH
) -> dict[str, ModulusTable]:
    """Return the table of each modulus by its name, see `modulus_table`."""
    return {name: modulus_table(law, name, points, reach) for name in COMPONENTS}


def _knots_and_jumps(law: HypoelasticLaw, name: str, end: float) -> tuple[Array, Array]:
    """Return strains before `end` where one piece gives way to the next, and where it jumps."""
    pieces = curve_pieces(law, name)
    knots = pieces[:-1, 0]

    def values_at_knots(curves: Array) -> Array:
        return np.array([np.polyval(c[1:], knot) for c, knot in zip(curves, knots, strict=True)])

    left = values_at_knots(pieces[:-1])
    right = values_at_knots(pieces[1:])
    is_jump = np.abs(right - left) > ROUNDING * np.maximum(np.abs(left), np.abs(right))
    in_range = knots < end
    return knots[in_range], knots[in_range & is_jump]


def _largest_error(
    law: HypoelasticLaw,
    name: str,
    strain: Array,
    modulus: Array,
    jumps: Array,
) -> float:
    """Return the largest relative error of straight lines between points, jumps left out.

    Parameters
    ----------
    strain, modulus : (n,) array
        Log strains of the points and the moduli (MPa) at them.
    jumps : (k,) array
        Strains after which the modulus jumps.
    """
    starts = strain[:-1]
    widths = np.diff(strain)
    smooth = ~np.isin(starts, jumps)
    shares = np.arange(1, CHECKED_BETWEEN) / CHECKED_BETWEEN
    between = (starts[smooth, None] + widths[smooth, None] * shares).ravel()
    exact = law.modulus(name, between)
    error = np.abs(np.interp(between, strain, modulus) - exact)
    return float(np.max(error / np.maximum(np.abs(exact), np.finfo(float).tiny)))
