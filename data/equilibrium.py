"""Equilibrium at the apex without any model: n1 k1 + n2 k2 = p from the measured shape alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .fields import DisplacementField

Array = NDArray[np.float64]

#: Points within this share of the radius tell the shape about the apex.
WITHIN = 0.5
#: Powers of the polynomial through the deformed places, each up to a total of four.
POWERS = tuple((i, j) for i in range(5) for j in range(5 - i))


@dataclass(frozen=True)
class Apex:
    """What the shape says at the centre of one field.

    Parameters
    ----------
    pressure : MPa. height : mm, rise of the centre.
    curvature : 1/mm, k1 + k2 of the inflated surface; positive where it is a dome.
    force : N/mm, the membrane force p / (k1 + k2), the same in all directions if the two are equal.
    error : N/mm, standard error of the force from the scatter of the points about a smooth surface.
    strain : logarithmic, along x and along y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Force over the mean of the two strains, N/mm; infinite where nothing is strained."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """The apex of a field about the rim's centre; radius of the rim in mm.

    Raises
    ------
    InputError : too few points about the centre.
    """
    x = field.points / radius
    near = np.hypot(*x.T) < WITHIN
    if near.sum() < 2 * len(POWERS):
        problem = f"expected {2 * len(POWERS)} points about the centre, got {int(near.sum())}"
        raise InputError(field.path, "", problem)
    z = np.zeros(len(x)) if field.z is None else field.z
    before = np.column_stack([field.points, z])[near]
    after = before + field.displacement[near]
    terms = np.stack([x[near, 0] ** i * x[near, 1] ** j for i, j in POWERS], axis=1)
    solution, *_ = np.linalg.lstsq(terms, np.hstack([after, before]), rcond=None)
    left = after[:, 2] - terms @ solution[:, 2]

    def slope(i: int, j: int, factor: float = 1.0) -> Array:
        return np.asarray(factor * solution[POWERS.index((i, j))] / radius ** (i + j))

    tangents = np.stack([slope(1, 0), slope(0, 1)])
    metric = tangents[:, :3] @ tangents[:, :3].T
    first = tangents[:, 3:] @ tangents[:, 3:].T
    normal = np.cross(tangents[0, :3], tangents[1, :3])
    normal /= np.linalg.norm(normal)
    second = np.array(
        [
            [slope(2, 0, 2.0)[:3] @ normal, slope(1, 1)[:3] @ normal],
            [slope(1, 1)[:3] @ normal, slope(0, 2, 2.0)[:3] @ normal],
        ]
    )
    curvature = -float(np.trace(np.linalg.solve(metric, second)))
    force = field.pressure / curvature if curvature > 0 else float("inf")
    variance = float(left @ left) / max(len(left) - len(POWERS), 1)
    inverse = np.linalg.pinv(terms.T @ terms)
    both = [POWERS.index((2, 0)), POWERS.index((0, 2))]
    spread = float(np.sqrt(variance * inverse[np.ix_(both, both)].sum())) * 2 / radius**2
    stretch = np.sqrt(np.diag(metric) / np.diag(first))
    strain = float(np.log(stretch[0])), float(np.log(stretch[1]))
    centre = POWERS.index((0, 0))
    height = float(solution[centre, 2] - solution[centre, 5])
    relative = spread / curvature if curvature > 0 else float("inf")
    return Apex(field.pressure, height, curvature, force, force * relative, strain)
