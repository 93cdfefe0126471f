"""What a bubble's fit compares, of a finer mesh and increments: the same points, row by row."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...identification.comparison import Comparison
from ...meshes.mesh import Mesh
from ...meshes.smooth_reading import SmoothReading
from ..base import MakeSolver, Weighting
from .objective import FieldObjective, FieldTarget
from .prepared import PreparedBubble
from .sheet import with_sheet
from .test import PART

Array = NDArray[np.float64]

#: A place between the polygons of two rims is looked for so much nearer to the centre, in turn.
INWARD = (1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.9)


def finer_bubble(
    prepared: PreparedBubble, make_solver: MakeSolver, weighting: Weighting, factor: float
) -> tuple[Comparison, ...]:
    """Its one comparison, of quads and increments divided by a factor.

    What lies between nodes is read as the fit reads it: what that does is part of the
    difference.
    """
    test = prepared.test
    (own,) = prepared.comparisons(make_solver, weighting)
    finer = test.models(what="elements", factor=factor)[PART]
    steps = test.models(what="increments", factor=round(factor))[PART].increments
    model = with_sheet(replace(finer, increments=steps), test.sheet, test.outline, prepared.sheet)
    objective = own.objective
    assert isinstance(objective, FieldObjective)
    moved = copy.copy(objective)
    moved.targets = resampled(objective.targets, own.model.mesh, model.mesh)
    return (replace(own, model=model, objective=moved),)


def resampled(targets: tuple[FieldTarget, ...], own: Mesh, other: Mesh) -> tuple[FieldTarget, ...]:
    """The same targets at the same places, from the nodes of another mesh."""
    reading = SmoothReading.of(other)
    found: list[tuple[Array, sp.csr_matrix]] = []
    moved = []
    for target in targets:
        places = np.ascontiguousarray(target.at(own.points)[:, :2])
        sample = next((s for p, s in found if np.array_equal(p, places)), None)
        if sample is None:
            sample = _sample(reading, places)
            found.append((places, sample))
        moved.append(replace(target, sample=sample))
    return tuple(moved)


def _sample(reading: SmoothReading, places: Array) -> sp.csr_matrix:
    at = places.copy()
    for share in INWARD:
        matrix, inside = reading.matrix(at)
        if inside.all():
            break
        at[~inside] = share * places[~inside]
    return matrix
