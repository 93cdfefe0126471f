"""How the reference geometry of a membrane mesh changes when its stress-free surface does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .element import NATURAL

Array = NDArray[np.float64]


def element_slopes(points: Array, quads: NDArray[np.intp], direction: Array) -> tuple[Array, Array]:
    """Derivatives of `reference_elements` where the points move along a direction.

    The warp yarn is x, laid onto each facet.

    Parameters
    ----------
    points : (n, 3) mm, without stress. quads : (m, 4).
    direction : (n, 3) mm per unit of what moves them.

    Returns
    -------
    Of slopes (m, 4 points, 2, 4 nodes), 1/mm per unit, and of area (m, 4), mm^2 per unit.
    """
    base = np.einsum("pan,mnk->mpak", NATURAL, points[quads])
    base_by = np.einsum("pan,mnk->mpak", NATURAL, direction[quads])
    normal = np.cross(base[:, :, 0], base[:, :, 1])
    normal_by = np.cross(base_by[:, :, 0], base[:, :, 1])
    normal_by += np.cross(base[:, :, 0], base_by[:, :, 1])
    unit, unit_by, _, area_by = _normalised(normal, normal_by)
    # Along the yarn: x less its part along the normal.
    across, across_by = unit[..., :1], unit_by[..., :1]
    along = np.array([1.0, 0.0, 0.0]) - across * unit
    along, along_by, _, _ = _normalised(along, -across_by * unit - across * unit_by)
    frame = np.stack([along, np.cross(unit, along)], axis=2)
    frame_by = np.stack([along_by, np.cross(unit_by, along) + np.cross(unit, along_by)], axis=2)
    jacobian = np.einsum("mpak,mpbk->mpab", base, frame)
    jacobian_by = np.einsum("mpak,mpbk->mpab", base_by, frame)
    jacobian_by += np.einsum("mpak,mpbk->mpab", base, frame_by)
    inverse = np.linalg.inv(jacobian)
    inverse_by = -inverse @ jacobian_by @ inverse
    slopes_by = np.einsum("mpab,pan->mpbn", inverse_by.transpose(0, 1, 3, 2), NATURAL)
    return slopes_by, area_by


def _normalised(vector: Array, by: Array) -> tuple[Array, Array, Array, Array]:
    """Unit vectors (..., 3), lengths (...), each followed by its derivative."""
    length = np.linalg.norm(vector, axis=-1)
    unit = vector / length[..., None]
    length_by = np.einsum("...k,...k->...", unit, by)
    return unit, (by - length_by[..., None] * unit) / length[..., None], length, length_by
