"""Reference geometry of a 4-node membrane mesh: what does not change during an analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

Array = NDArray[np.float64]

_G = 1.0 / np.sqrt(3.0)
#: 2 x 2 Gauss points of the square; all weights are one.
GAUSS_POINTS = np.array([[-_G, -_G], [_G, -_G], [_G, _G], [-_G, _G]])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
#: Bilinear shape functions (point, node) and their derivatives (point, 2, node) on the square.
VALUES = 0.25 * np.prod(1.0 + GAUSS_POINTS[:, None, :] * _CORNERS[None], axis=2)
NATURAL = 0.25 * np.stack(
    [
        _CORNERS[:, 0] * (1.0 + GAUSS_POINTS[:, None, 1] * _CORNERS[:, 1]),
        _CORNERS[:, 1] * (1.0 + GAUSS_POINTS[:, None, 0] * _CORNERS[:, 0]),
    ],
    axis=1,
)


@dataclass(frozen=True, eq=False)
class ReferenceElements:
    """Shape functions and their derivatives in each facet's material frame.

    values (4 points, 4 nodes); slopes (elements, 4 points, 2, 4) d N/d (warp, fill) in 1/mm;
    area (elements, 4 points) mm^2 of reference surface at each Gauss point.
    """

    values: Array
    slopes: Array
    area: Array


def reference_elements(
    points: Array, quads: NDArray[np.intp], warp: Array | None = None
) -> ReferenceElements:
    """Evaluate the bilinear shape functions on a flat or faceted surface.

    Parameters
    ----------
    points : (n, 2) or (n, 3) mm. quads : (m, 4).
    warp : (m, 3) direction of the warp yarn in each facet; x unless given.

    Raises
    ------
    InputError : a quad that is inside out, or a warp direction normal to its facet.
    """
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    base = np.einsum("pan,mnk->mpak", NATURAL, points[quads])
    normal = np.cross(base[:, :, 0], base[:, :, 1])
    area = np.linalg.norm(normal, axis=2)
    centre = normal.sum(axis=1)
    if (area <= 0).any() or (np.einsum("mpk,mk->mp", normal, centre) <= 0).any():
        bad = int(np.argmin(np.einsum("mpk,mk->mp", normal, centre).min(axis=1)))
        raise InputError(None, f"element {bad}", "is degenerate or inside out; mend the mesh")
    unit = normal / area[:, :, None]
    yarn = np.broadcast_to([1.0, 0.0, 0.0], (len(quads), 3)) if warp is None else warp
    along = yarn[:, None, :] - np.einsum("mk,mpk->mp", yarn, unit)[:, :, None] * unit
    length = np.linalg.norm(along, axis=2, keepdims=True)
    if (length < 1e-6).any():
        raise InputError(None, "warp", "the warp direction is normal to a facet")
    along /= length
    frame = np.stack([along, np.cross(unit, along)], axis=2)  # (m, p, 2, 3)
    jacobian = np.einsum("mpak,mpbk->mpab", base, frame)
    slopes = np.einsum("mpab,pan->mpbn", np.linalg.inv(jacobian).transpose(0, 1, 3, 2), NATURAL)
    return ReferenceElements(VALUES, np.ascontiguousarray(slopes), area)
