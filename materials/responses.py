"""What the law answers in a uniaxial test and in a trellis shear, in three measures.

Uniaxial: pulled along one yarn, free to contract across it. Trellis: both yarns keep their
length while the angle between them changes, as in a picture frame.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .law import HypoelasticLaw

Array = NDArray[np.float64]
#: "true": log strain and Cauchy stress. "nominal": change of length (or of angle, radians) and
#: force per reference area (trellis: stress that does work on the angle). "green": Green-Lagrange
#: strain (shear: engineering, 2 E12) and 2nd Piola-Kirchhoff stress. All stresses are forces over
#: areas of the reference thickness.
Measure = Literal["true", "nominal", "green"]
MEASURES: tuple[Measure, ...] = ("true", "nominal", "green")
#: Increments of the law between two points of a curve.
STEPS = 16
ROUNDS = 50


def bar(law: HypoelasticLaw, pulled: int, log_strain: ArrayLike) -> tuple[Array, Array]:
    """Log strain (n, 3) and Cauchy stress (n, 3), MPa, of a bar pulled step by step.

    Parameters
    ----------
    pulled : 0 along the warp, 1 along the fill.
    log_strain : (n,) of the pulled direction, one increment of the law each, from zero.

    Raises
    ------
    InputError : no stress-free width: a modulus is not positive on the way.
    """
    free = 1 - pulled
    ends = np.asarray(log_strain, dtype=float)
    strains, stresses = np.empty((len(ends), 3)), np.empty((len(ends), 3))
    old, stress = np.zeros(3), np.zeros((1, 3))
    for i, end in enumerate(ends):
        new = old.copy()
        new[pulled] = end
        for _ in range(ROUNDS):
            trial, tangent = law.increment(old, new, stress)
            new[free] -= trial[0, free] / tangent[0, free, free]
            if not abs(trial[0, free]) > 1e-13 * abs(trial[0, pulled]):
                break
        trial, _ = law.increment(old, new, stress)
        if not np.isfinite(trial).all():
            problem = f"a modulus or 1 - nu12 nu21 is not positive at log strain {end:.4g} of a bar"
            raise InputError(None, "beta", problem)
        old, stress = new, trial
        strains[i], stresses[i] = new, trial[0]
    return strains, stresses


def uniaxial_curve(
    law: HypoelasticLaw, pulled: int, log_strain: ArrayLike, measure: Measure
) -> tuple[Array, Array]:
    """Strain (n,) and stress (n,), MPa, in `measure` at increasing (or falling) log strains.

    The first log strain may be zero. Raises as `bar`.
    """
    ends = np.asarray(log_strain, dtype=float)
    fine = _refined(ends)
    h, s = bar(law, pulled, fine)
    h, s = _at(ends, h), _at(ends, s)
    # Force per reference area: sigma t0 J2^(p - 1) on the width exp(eps across) (law.area_power).
    area = np.exp(law.area_power * (h[:, 0] + h[:, 1]))
    stretch = np.exp(h[:, pulled])
    force = s[:, pulled] * area / stretch
    if measure == "nominal":
        return stretch - 1, force
    if measure == "green":
        return 0.5 * (stretch**2 - 1), force / stretch
    return h[:, pulled], s[:, pulled] * np.exp((law.area_power - 1) * (h[:, 0] + h[:, 1]))


def trellis_curve(
    law: HypoelasticLaw, angle: ArrayLike, measure: Measure
) -> tuple[Array, Array, Array]:
    """Shear strain (n,), shear stress (n,) and stress along the yarns (n, 2), MPa, in `measure`.

    The stress along the yarns, which a law of curves that do not couple leaves out, is 2nd
    Piola-Kirchhoff stress whatever the measure.

    Parameters
    ----------
    angle : (n,) increasing changes of the angle between the yarns, radians.

    Raises
    ------
    InputError : a modulus is not positive on the way.
    """
    ends = np.asarray(angle, dtype=float)
    fine = _refined(ends)
    rows = np.empty((len(fine), 9))
    strain, stress = np.zeros((1, 3)), np.zeros((1, 3))
    for i, turn in enumerate(fine):
        gradient = np.array([[[1.0, np.sin(turn)], [0.0, np.cos(turn)]]])
        pk2, _, strain, stress = law.second_piola_kirchhoff(gradient, strain, stress)
        rows[i] = np.concatenate([pk2[0], strain[0], stress[0]])
    if not np.isfinite(rows).all():
        raise InputError(
            None, "beta", "a modulus or 1 - nu12 nu21 is not positive in a trellis shear"
        )
    rows = _at(ends, rows)
    yarns, s12, area = rows[:, :2], rows[:, 2], np.exp(rows[:, 3] + rows[:, 4])
    if measure == "nominal":
        # S12 dC12 = T d(angle) with C12 = sin(angle).
        return ends, s12 * np.cos(ends), yarns
    if measure == "green":
        return np.sin(ends), s12, yarns
    return rows[:, 5], rows[:, 8] * area ** (law.area_power - 1), yarns


def trellis_angle(gamma12: float) -> float:
    """Change of angle (radians) at which trellis shear has the log strain gamma12.

    U of C = [[1, sin a], [sin a, 1]] gives gamma12 = atanh(sin a).
    """
    return float(np.arcsin(np.tanh(gamma12)))


def _refined(ends: Array) -> Array:
    """Every point, and STEPS increments up to it, from zero; a leading zero adds none."""
    starts = np.concatenate([[0.0], ends[:-1]])
    return np.concatenate(
        [a + (b - a) * np.arange(1, STEPS + 1) / STEPS for a, b in zip(starts, ends, strict=True)]
    )


def _at(ends: Array, fine: Array) -> Array:
    return fine[STEPS - 1 :: STEPS][: len(ends)]
