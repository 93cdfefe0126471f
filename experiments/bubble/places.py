"""From measured or computed fields to targets of a fit: on the model's nodes, or at the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from ...data.fields import DisplacementField
from ...data.surfaces import DisplacementSurface
from ...errors import InputError
from ...meshes.facet_reading import FacetReading
from ...meshes.mesh import Mesh
from ...meshes.smooth_reading import SmoothReading
from .objective import FieldTarget
from .test import BubbleTest

Array = NDArray[np.float64]

#: Of the points on the disk, and of its radius covered: less is taken for a wrong unit.
LEAST_SHARE = 0.1


def folded(field: DisplacementField) -> DisplacementField:
    """A full field folded onto the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    moved = field.displacement.copy()
    moved[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=moved)


def mirrored(field: DisplacementField) -> DisplacementField:
    """A quarter's field mirrored to the full disk."""
    if (field.points < -1e-9).any():
        return field
    points, moved = [], []
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        points.append(field.points * (sx, sy))
        moved.append(field.displacement * (sx, sy, 1))
    xy, u = np.concatenate(points), np.concatenate(moved)
    _, once = np.unique(np.round(xy, 6), axis=0, return_index=True)
    z, sigma = (
        None if value is None else np.tile(value, 4)[once] for value in (field.z, field.sigma)
    )
    return replace(field, points=xy[once], displacement=u[once], z=z, sigma=sigma)


def at_nodes(
    sources: Sequence[DisplacementField | DisplacementSurface], mesh: Mesh
) -> list[FieldTarget]:
    """Targets on the model's nodes, from computed fields or polynomial surfaces."""
    nodes = mesh.points[:, :2]
    return [
        FieldTarget(
            source.pressure,
            source.evaluate(nodes)
            if isinstance(source, DisplacementSurface)
            else _interpolated(source, mesh),
            at_rest=nodes,
        )
        for source in sources
    ]


def _interpolated(field: DisplacementField, mesh: Mesh) -> Array:
    """Computed displacements at the model's nodes; exact when the meshes are the same."""
    nodes = mesh.points[:, :2]
    if nodes.shape == field.points.shape and np.allclose(nodes, field.points, atol=1e-9):
        return field.displacement
    # C1 interpolation: the data mesh is curved between its nodes, linear would cut corners.
    whole = mirrored(field)
    between = CloughTocher2DInterpolator(whole.points, whole.displacement)(nodes)
    # Chords of the data's rim can leave a rim node of ours outside: it does not move anyway.
    outside = ~np.isfinite(between).all(axis=1)
    between[outside] = 0.0
    between[mesh.node_sets["rim"]] = 0.0
    return np.asarray(between)


def reading_of(test: BubbleTest, mesh: Mesh) -> SmoothReading | FacetReading:
    """How displacements of the nodes are read at points: as the camera does, if that is known."""
    reading = SmoothReading.of(mesh)
    return reading if test.facet is None else FacetReading(reading, test.facet)


def at_points(
    test: BubbleTest, fields: Sequence[DisplacementField], mesh: Mesh
) -> tuple[list[FieldTarget], int]:
    """Targets at the measured points on the disk, and how many lie beyond its rim.

    Raises
    ------
    InputError : next to no point lies on the disk, or all of them near its centre.
    """
    targets, outside = [], 0
    reading, before = reading_of(test, mesh), None
    for field in fields:
        # Frames of one camera mostly have the same places.
        if before is None or not np.array_equal(before, field.points):
            sample, inside = reading.matrix(field.points)
            before = field.points
        outside += int((~inside).sum())
        _check_scale(test, field, inside)
        rest = field.points[inside]
        targets.append(
            FieldTarget(field.pressure, field.displacement[inside], sample, at_rest=rest)
        )
    return targets, outside


def _check_scale(test: BubbleTest, field: DisplacementField, inside: NDArray[np.bool_]) -> None:
    """Metres taken for millimetres, or the other way round, show in where the points lie."""
    reach = float(np.abs(field.points).max())
    if inside.mean() < LEAST_SHARE:
        where = f"{int(inside.sum())} of {len(inside)} points lie on the disk of"
    elif reach < LEAST_SHARE * test.outline.major:
        where = f"all points lie within {reach:.3g} mm of the centre of a disk of"
    else:
        return
    at = f"{test.place.at}, data at {field.pressure * 1e3:g} kPa"
    problem = f"{where} {test.outline.words}: are the length unit and the columns x and y right?"
    raise InputError(test.place.path, at, problem)
