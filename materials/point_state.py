"""Groups of arguments of the compiled law: its constants, states, and what it writes at a point."""

from typing import NamedTuple

import numpy as np

from ..compilation import compiled
from .forms.base import Array

#: Constants of a law beside its moduli; a tuple, whose length is a type: what a memory needs is
#: compiled for laws that have one.
Coupling = tuple[float, ...]
#: Entries of what `point_law.stress_update` leaves for the sensitivities.
SLOPES = 31


class CompiledLaw(NamedTuple):
    """Constants of a law, as compiled functions take them.

    Attributes
    ----------
    pieces : (3, P, 5) ndarray, MPa
        The moduli as piecewise cubics, see `forms.base.pieces_of`.
    coupling : tuple of float
        nu12, and what E1 and E2 gain (MPa) by their normalised load ratios; of a law with crimp
        (6,) also T1, T2, S (MPa); of a law that remembers (15,) also its memory.
    area_power : float
        1 for constant and 0 for incompressible thickness.
    """

    pieces: Array
    coupling: Coupling
    area_power: float


class LawSlopes(NamedTuple):
    """Derivatives of a law's constants by np parameters.

    Attributes
    ----------
    rows : (3, P, 4, np) ndarray
        Of the pieces' coefficients.
    coupling : (len(coupling), np) ndarray
    """

    rows: Array
    coupling: Array


class CauchyGreen(NamedTuple):
    """In-plane components of C: m = (C11 + C22) / 2, q = (C11 - C22) / 2, c = C12."""

    m: float
    q: float
    c: float


class PointState(NamedTuple):
    """Log strain (3,), or (9,) of a law that remembers, and Cauchy stress (3,) MPa at a point."""

    strain: Array
    stress: Array


class LawTangent(NamedTuple):
    """What `point_law.stress_update` writes beside a state.

    tangent : (3, 3) MPa, d stress / d strain. slopes : (SLOPES,), for `stress_rate`.
    """

    tangent: Array
    slopes: Array


class PointResponse(NamedTuple):
    """What `point_law.membrane_stress` writes beside a state.

    Attributes
    ----------
    pk2 : (3,) ndarray, MPa
        2nd Piola-Kirchhoff stress.
    stiffness : (3, 3) ndarray, MPa
        d pk2 / d Green-Lagrange strain.
    strain_slope : (3, 3) ndarray
        d log strain / d Green-Lagrange strain.
    law : LawTangent
    pull : (3, 3) ndarray
        d pk2 / d Cauchy stress, area ratio included.
    work : (3, 3) ndarray
        Scratch.
    """

    pk2: Array
    stiffness: Array
    strain_slope: Array
    law: LawTangent
    pull: Array
    work: Array


@compiled()
def point_response() -> PointResponse:
    """Return room for what is written at one point after the other."""
    law = LawTangent(np.empty((3, 3)), np.empty(SLOPES))
    return PointResponse(
        np.empty(3), np.empty((3, 3)), np.empty((3, 3)), law, np.empty((3, 3)), np.empty((3, 3))
    )
