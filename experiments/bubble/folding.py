"""Symmetry of displacement fields: a full disk folded onto a quarter, a quarter mirrored."""

from dataclasses import replace

import numpy as np

from ...readers.fields import DisplacementField


def folded(field: DisplacementField) -> DisplacementField:
    """Return a field of the full disk with all its points mirrored into the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    displacement = field.displacement.copy()
    displacement[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=displacement)


def mirrored(field: DisplacementField) -> DisplacementField:
    """Return a field of the quarter x, y >= 0 mirrored to the full disk.

    A field with points outside of this quarter is returned as it is.
    """
    if (field.points < -1e-9).any():
        return field
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    points = np.concatenate([field.points * (sx, sy) for sx, sy in signs])
    displacement = np.concatenate([field.displacement * (sx, sy, 1) for sx, sy in signs])
    _, rows = np.unique(np.round(points, 6), axis=0, return_index=True)
    return replace(
        field,
        points=points[rows],
        displacement=displacement[rows],
        z=None if field.z is None else np.tile(field.z, 4)[rows],
        sigma=None if field.sigma is None else np.tile(field.sigma, 4)[rows],
    )
