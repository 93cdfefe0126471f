"""Fields of a full disk folded onto a quarter, and a quarter mirrored to the full disk."""

from dataclasses import replace

import numpy as np

from ...readers.fields import DisplacementField


def folded(field: DisplacementField) -> DisplacementField:
    """Fold a full field onto the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    displacement = field.displacement.copy()
    displacement[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=displacement)


def mirrored(field: DisplacementField) -> DisplacementField:
    """Mirror a quarter's field to the full disk; a full field is returned as it is."""
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
