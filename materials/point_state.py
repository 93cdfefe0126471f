"""Data structures of the compiled law: its constants, the state at a point, and its results."""

from typing import NamedTuple

import numpy as np

from ..compilation import compiled
from .forms.base import Array

#: Constants of a law beside its moduli. The length of a tuple is part of its type, so that code for
#: crimp or a memory is compiled only for laws that have them.
Coupling = tuple[float, ...]
#: Number of entries of the vector that `point_law.stress_update` writes for the sensitivities.
SLOPES = 31


class CompiledLaw(NamedTuple):
    """Constants of a law, as compiled functions take them.

    Attributes
    ----------
    pieces : (3, P, 5) ndarray, MPa
        The moduli as piecewise cubics, see `forms.base.pieces_of`.
    coupling : tuple of float
        nu12, and the gains (MPa) of E1 and E2 as their normalised load ratios go from 0 to 1; a law
        with crimp has 6 entries, the last T1, T2, S (MPa) of `forms/ratio.py`; a law with a memory
        has 15, the last 12 its constants (`memory.NAMES`).
    area_power : float
        1 for constant thickness, 0 for an incompressible material (`HypoelasticLaw.area_power`).
    """

    pieces: Array
    coupling: Coupling
    area_power: float


class LawSlopes(NamedTuple):
    """Derivatives of a law's constants by p parameters.

    Attributes
    ----------
    rows : (3, P, 4, p) ndarray
        Derivatives of the coefficients of the pieces (`CompiledLaw.pieces` without upper ends).
    coupling : (len(coupling), p) ndarray
        Derivatives of `CompiledLaw.coupling`.
    """

    rows: Array
    coupling: Array


class CauchyGreen(NamedTuple):
    """In-plane Cauchy-Green components: m = (C11 + C22) / 2, q = (C11 - C22) / 2, c = C12."""

    m: float
    q: float
    c: float


class PointState(NamedTuple):
    """Log strain (3,), or (9,) for a law with a memory, and Cauchy stress (3,) MPa at a point."""

    strain: Array
    stress: Array


class LawTangent(NamedTuple):
    """What `point_law.stress_update` writes beside a state.

    Attributes
    ----------
    tangent : (3, 3) array, MPa
        d stress / d strain.
    slopes : (SLOPES,) array
        For `stress_rate`.
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
    """Return a new, empty response, to be overwritten at one point after the other."""
    law = LawTangent(np.empty((3, 3)), np.empty(SLOPES))
    return PointResponse(
        np.empty(3),
        np.empty((3, 3)),
        np.empty((3, 3)),
        law,
        np.empty((3, 3)),
        np.empty((3, 3)),
    )
