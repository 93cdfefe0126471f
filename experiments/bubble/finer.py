"""What a bubble's fit compares, of a finer mesh and increments: the same points, row by row."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...identification.comparison import Comparison
from ...meshes.location import sampling_matrix
from ...meshes.mesh import Mesh
from ..base import MakeSolver, Weighting
from .objective import FieldObjective, FieldTarget
from .prepared import PreparedBubble
from .sheet import with_sheet
from .test import PART

Array = NDArray[np.float64]

#: A place between the polygons of two rims is looked for so much nearer to the centre, in turn.
INWARD = (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2)


def finer_bubble(
    prepared: PreparedBubble, make_solver: MakeSolver, weighting: Weighting, factor: float
) -> tuple[Comparison, ...]:
    """Its one comparison, of quads and increments divided by a factor.

    What lies between nodes is interpolated by straight lines on either mesh: the chords' sag is
    part of the difference.
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
    found: list[tuple[Array, FieldTarget]] = []
    for target in targets:
        places = np.ascontiguousarray(target.at(own.points)[:, :2])
        sample = next((t.sample for p, t in found if np.array_equal(p, places)), None)
        if sample is None:
            sample = _sample(other, places)
        found.append((places, replace(target, sample=sample)))
    return tuple(target for _, target in found)


def _sample(mesh: Mesh, places: Array):  # type: ignore[no-untyped-def]
    at = places.copy()
    for share in INWARD:
        _, inside = sampling_matrix(mesh, at)
        at[~inside] = share * places[~inside]
    return sampling_matrix(mesh, at)[0]
