"""Compute curves of stress by strain of a law in a uniaxial pull and in a trellis shear.

Uniaxial: free to contract across the pull. Trellis: the yarns keep their length while the angle
between them changes.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .forms.base import Array
from .law import HypoelasticLaw

#: "true": log strain and Cauchy stress. "nominal": change of length (or of angle, radians) and
#: force per reference area (trellis: stress that does work on the angle). "green": Green-Lagrange
#: strain (shear: engineering, 2 E12) and 2nd Piola-Kirchhoff stress. All stresses are forces over
#: areas of the reference thickness.
Measure = Literal["true", "nominal", "green"]
MEASURES: tuple[Measure, ...] = ("true", "nominal", "green")
#: Increments of the law between two points of a curve.
INCREMENTS_PER_POINT = 16
MAX_ITERATIONS = 50
#: Stress across a bar over that along it that is taken as none.
STRESS_TOLERANCE = 1e-13


def bar(law: HypoelasticLaw, pulled: int, log_strain: ArrayLike) -> tuple[Array, Array]:
    """Follow a bar that is pulled along a yarn and free to contract across it.

    Parameters
    ----------
    law : HypoelasticLaw
    pulled : int
        0 along the warp, 1 along the fill.
    log_strain : (n,) array_like
        Logarithmic strains along the pull, one after the other.

    Returns
    -------
    strain : (n, 3) ndarray
        Logarithmic strain (eps1, eps2, gamma12).
    stress : (n, 3) ndarray, MPa
        Cauchy stress.

    Raises
    ------
    InputError
        If a modulus, or 1 - nu12 nu21, is not positive on the way.
    """
    across = 1 - pulled
    ends = np.asarray(log_strain, dtype=float)
    strains = np.empty((len(ends), 3))
    stresses = np.empty((len(ends), 3))
    state = np.zeros((1, 3))
    stress = np.zeros((1, 3))
    for i, end in enumerate(ends):
        strain = state[0, :3].copy()
        strain[pulled] = end
        for _ in range(MAX_ITERATIONS):
            trial, tangent, _ = law.follow(state, strain, stress)
            strain[across] -= trial[0, across] / tangent[0, across, across]
            if not abs(trial[0, across]) > STRESS_TOLERANCE * abs(trial[0, pulled]):
                break
        stress, _, state = law.follow(state, strain, stress)
        if not np.isfinite(stress).all():
            problem = "a modulus or 1 - nu12 nu21 is not positive "
            problem += f"at {100 * end:.4g} % of log strain of a bar"
            raise InputError(None, "beta", problem)
        strains[i] = strain
        stresses[i] = stress[0]
    return strains, stresses


def uniaxial_curve(
    law: HypoelasticLaw,
    pulled: int,
    log_strain: ArrayLike,
    measure: Measure,
) -> tuple[Array, Array]:
    """Compute the curve of a bar.

    Parameters
    ----------
    law : HypoelasticLaw
    pulled : int
        0 along the warp, 1 along the fill.
    log_strain : (n,) array_like
        Logarithmic strains along the pull, one after the other.
    measure : {"true", "nominal", "green"}
        Of strain and stress, see `Measure`.

    Returns
    -------
    strain : (n,) ndarray
    stress : (n,) ndarray, MPa
        A force over an area of the thickness before the test.
    """
    ends = np.asarray(log_strain, dtype=float)
    strain, stress = bar(law, pulled, _refine(ends))
    return _along_yarn(law, pulled, _at_ends(ends, strain), _at_ends(ends, stress), measure)


def equibiaxial_curve(
    law: HypoelasticLaw,
    pulled: int,
    log_strain: ArrayLike,
    measure: Measure,
) -> tuple[Array, Array]:
    """Compute the curve of a yarn while both yarns have the same strain, without shear.

    Parameters
    ----------
    law : HypoelasticLaw
    pulled : int
        0 of the warp, 1 of the fill.
    log_strain : (n,) array_like
        Logarithmic strains of both yarns, one after the other.
    measure : {"true", "nominal", "green"}
        Of strain and stress, see `Measure`.

    Returns
    -------
    strain : (n,) ndarray
    stress : (n,) ndarray, MPa
        A force over an area of the thickness before the test.

    Raises
    ------
    InputError
        If a modulus, or 1 - nu12 nu21, is not positive on the way.
    """
    ends = np.asarray(log_strain, dtype=float)
    path = _refine(ends)
    strain = np.column_stack([path, path, np.zeros_like(path)])
    stresses = np.empty_like(strain)
    state = np.zeros((1, 3))
    stress = np.zeros((1, 3))
    for i, end in enumerate(strain):
        stress, _, state = law.follow(state, end, stress)
        stresses[i] = stress[0]
    if not np.isfinite(stresses).all():
        problem = "a modulus or 1 - nu12 nu21 is not positive under equal strain of both yarns"
        raise InputError(None, "beta", problem)
    return _along_yarn(law, pulled, _at_ends(ends, strain), _at_ends(ends, stresses), measure)


def _along_yarn(
    law: HypoelasticLaw,
    pulled: int,
    strain: Array,
    stress: Array,
    measure: Measure,
) -> tuple[Array, Array]:
    """Return strain and stress of a yarn in a measure, of log strain and Cauchy stress (n, 3)."""
    area_log = strain[:, 0] + strain[:, 1]
    stretch = np.exp(strain[:, pulled])
    # Force per reference area: sigma t0 J2^(p - 1) on the width exp(eps across) (law.area_power).
    force = stress[:, pulled] * np.exp(law.area_power * area_log) / stretch
    if measure == "nominal":
        return stretch - 1, force
    if measure == "green":
        return 0.5 * (stretch**2 - 1), force / stretch
    return strain[:, pulled], stress[:, pulled] * np.exp((law.area_power - 1) * area_log)


def trellis_curve(
    law: HypoelasticLaw, angle: ArrayLike, measure: Measure
) -> tuple[Array, Array, Array]:
    """Compute the curve of a trellis shear.

    Parameters
    ----------
    law : HypoelasticLaw
    angle : (n,) array_like, radians
        Rising changes of the angle between the yarns.
    measure : {"true", "nominal", "green"}
        Of shear strain and stress, see `Measure`.

    Returns
    -------
    shear_strain : (n,) ndarray
    shear_stress : (n,) ndarray, MPa
    yarn_stress : (n, 2) ndarray, MPa
        Stress along the yarns, 2nd Piola-Kirchhoff whatever the measure.

    Raises
    ------
    InputError
        If a modulus, or 1 - nu12 nu21, is not positive on the way.
    """
    ends = np.asarray(angle, dtype=float)
    angles = _refine(ends)
    rows = np.empty((len(angles), 9))
    strain = np.zeros((1, 3))
    stress = np.zeros((1, 3))
    for i, shear_angle in enumerate(angles):
        gradient = np.array([[[1.0, np.sin(shear_angle)], [0.0, np.cos(shear_angle)]]])
        pk2, _, strain, stress = law.second_piola_kirchhoff(gradient, strain, stress)
        rows[i] = np.concatenate([pk2[0], strain[0, :3], stress[0]])
    if not np.isfinite(rows).all():
        problem = "a modulus or 1 - nu12 nu21 is not positive in a trellis shear"
        raise InputError(None, "beta", problem)
    rows = _at_ends(ends, rows)
    yarn_stress = rows[:, :2]
    s12 = rows[:, 2]
    area = np.exp(rows[:, 3] + rows[:, 4])
    if measure == "nominal":
        # S12 dC12 = T d(angle) with C12 = sin(angle).
        return ends, s12 * np.cos(ends), yarn_stress
    if measure == "green":
        return np.sin(ends), s12, yarn_stress
    return rows[:, 5], rows[:, 8] * area ** (law.area_power - 1), yarn_stress


def trellis_angle(gamma12: float) -> float:
    """Return the change of angle (radians) at a log strain gamma12 = atanh(sin a)."""
    return float(np.arcsin(np.tanh(gamma12)))


def _refine(ends: Array) -> Array:
    """Return the increments up to each point, from zero; a leading zero adds none.

    Parameters
    ----------
    ends : (n,) array
        Points of the curve.
    """
    starts = np.concatenate([[0.0], ends[:-1]])
    shares = np.arange(1, INCREMENTS_PER_POINT + 1)
    return np.concatenate(
        [a + (b - a) * shares / INCREMENTS_PER_POINT for a, b in zip(starts, ends, strict=True)]
    )


def _at_ends(ends: Array, increments: Array) -> Array:
    """Return the rows at the points of a curve, of those at its increments.

    Parameters
    ----------
    ends : (n,) array
        Points of the curve.
    increments : (n * INCREMENTS_PER_POINT, ...) array
        Rows at the increments that `_refine` returns.
    """
    return increments[INCREMENTS_PER_POINT - 1 :: INCREMENTS_PER_POINT][: len(ends)]
