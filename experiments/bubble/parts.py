"""What a bubble's fit compares, of another mesh and increments: the same points, row by row."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.comparison import Comparison
from ...meshes.mesh import Mesh
from ...meshes.reading import FacetReading, SmoothReading
from ..kinds import MakeSolver, Masks, Weighting
from .objective import FieldObjective, FieldTarget, reading_of
from .prepared import PreparedBubble
from .sheet import with_sheet
from .test import PART

Array = NDArray[np.float64]

#: Quads of the full disk: with fewer it is no disk any more.
LEAST_QUADS = 48
#: A place between the polygons of two rims is looked for so much nearer to the centre, in turn.
INWARD = (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.95, 0.9)


def finer_bubble(
    prepared: PreparedBubble, make_solver: MakeSolver, weighting: Weighting, factor: float
) -> tuple[Comparison, ...]:
    """Its one comparison, of quads and increments divided by a factor; only of quads below one.

    What lies between nodes is read as the fit reads it: what that does is part of the
    difference.

    Raises
    ------
    InputError : the mesh would be too coarse for a disk, or for the places of the data.
    """
    test = prepared.test
    (own,) = prepared.comparisons(make_solver, weighting)
    finer = test.models(what="elements", factor=factor)[PART]
    whole = len(finer.mesh.quads) * (4 if test.symmetry == "quarter" else 1)
    if whole < LEAST_QUADS and factor < 1:
        problem = f"{whole} quads are too few for a disk, of which {LEAST_QUADS} are the least"
        raise InputError(None, "elements", problem)
    steps = test.models(what="increments", factor=max(1, round(factor)))[PART].increments
    model = with_sheet(replace(finer, increments=steps), test.sheet, test.outline, prepared.sheet)
    objective = own.objective
    assert isinstance(objective, FieldObjective)
    moved = copy.copy(objective)
    reading = reading_of(test, model.mesh)
    moved.targets = resampled(objective.targets, own.model.mesh, model.mesh, reading)
    return (replace(own, model=model, objective=moved),)


def resampled(
    targets: tuple[FieldTarget, ...],
    own: Mesh,
    other: Mesh,
    reading: SmoothReading | FacetReading | None = None,
) -> tuple[FieldTarget, ...]:
    """The same targets at the same places, from the nodes of another mesh.

    reading : of that mesh, smooth unless given.
    """
    reading = reading or SmoothReading.of(other)
    found: list[tuple[Array, sp.csr_matrix]] = []
    moved = []
    for target in targets:
        rest = target.at(own.points)[:, :2] if target.at_rest is None else target.at_rest
        places = np.ascontiguousarray(rest)
        sample = next((s for p, s in found if np.array_equal(p, places)), None)
        if sample is None:
            sample = _sample(reading, places)
            found.append((places, sample))
        moved.append(replace(target, sample=sample))
    return tuple(moved)


def _sample(reading: SmoothReading | FacetReading, places: Array) -> sp.csr_matrix:
    at, inside = places.copy(), np.zeros(len(places), dtype=bool)
    for share in INWARD:
        at[~inside] = share * places[~inside]
        matrix, inside = reading.matrix(at)
        if inside.all():
            return matrix
    problem = f"{(~inside).sum()} places of the data lie outside of it"
    raise InputError(None, "mesh", problem)


def frames_of(prepared: PreparedBubble) -> Mapping[str, Mapping[str, Masks]]:
    """The points that are kept without each frame, by its pressure.

    None of a single frame, nor where a field that is the same in all frames is projected out: it
    is known of all of them together only.
    """
    if prepared.test.sheet.constant:
        return {}
    targets = prepared.targets
    if len(targets) < 2:
        return {}
    whose = np.repeat(np.arange(len(targets)), [len(t.displacement) for t in targets])
    names = [f"{1e3 * target.pressure:.5g} kPa" for target in targets]
    if len(set(names)) < len(names):
        names = [f"{name} (frame {k + 1})" for k, name in enumerate(names)]
    return {
        "frames": {name: {prepared.test.name: whose != k} for k, name in enumerate(names)},
    }


def kept_targets(
    targets: Sequence[FieldTarget], mask: NDArray[np.bool_] | None
) -> list[FieldTarget]:
    """What a mask over the points of all targets leaves of them, each of its own frame."""
    if mask is None:
        return list(targets)
    ends = np.cumsum([len(target.displacement) for target in targets])[:-1]
    kept = []
    for k, (target, own) in enumerate(zip(targets, np.split(mask, ends), strict=True)):
        if not own.any():
            continue
        frame = k if target.frame is None else target.frame
        whole = target.sample
        if whole is None and not own.all():
            whole = sp.identity(len(own), format="csr")
        kept.append(
            replace(
                target,
                displacement=target.displacement[own],
                sample=whole if whole is None else sp.csr_matrix(whole[own]),
                places=None if target.places is None else target.places[own],
                at_rest=None if target.at_rest is None else target.at_rest[own],
                frame=frame,
            )
        )
    return kept
