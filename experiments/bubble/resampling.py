"""Transfer of a bubble's targets and solutions from one mesh to another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from ...errors import InputError
from ...meshes.bubble_model import BubbleModel
from ...meshes.facets import FacetReading
from ...meshes.mesh import Mesh
from ...meshes.sampling import SmoothReading
from ...solvers.base import Array
from .targets import FieldTarget


def resampled(
    targets: tuple[FieldTarget, ...], mesh: Mesh, reading: SmoothReading | FacetReading
) -> tuple[FieldTarget, ...]:
    """Return targets at the same places, whose samples read values at the nodes of another mesh.

    Parameters
    ----------
    targets : tuple of FieldTarget
    mesh : Mesh
        The mesh that the targets read.
    reading : SmoothReading or FacetReading
        Interpolation on the other mesh.

    Raises
    ------
    InputError
        Places lie outside of the other mesh.
    """
    resampled_targets = []
    previous = None
    sample = None
    for target in targets:
        positions = target.at(mesh.points)[:, :2] if target.positions is None else target.positions
        positions = np.ascontiguousarray(positions)
        # Frames of one camera mostly have the same places.
        if previous is None or not np.array_equal(previous, positions):
            previous = positions
            sample = _sample(reading, positions)
        resampled_targets.append(replace(target, sample=sample))
    return tuple(resampled_targets)


def prolonged(model: BubbleModel, finer: BubbleModel, path: Array) -> Array:
    """Return initial displacements for each increment of a finer model from a coarser solution.

    Displacements are interpolated linearly in the cube root of the pressure, and extrapolated in
    the same way below the first pressure: a slack sheet has moved far there, and has folds that a
    finer mesh does not find when it starts from a higher pressure.

    Parameters
    ----------
    model, finer : BubbleModel
    path : (increments, nodes, 3) array, mm
        Displacements of the coarser model.

    Returns
    -------
    (increments, nodes, 3) array, mm
        Displacements of the finer model.
    """
    sample = _sample(SmoothReading.of(model.mesh), finer.mesh.points[:, :2])
    levels = np.cbrt(np.array(model.increments))
    finer_levels = np.cbrt(np.array(finer.increments))
    if model.unloaded:  # pressures fall, too: along the length of the path of the cube roots
        levels = np.cumsum(np.abs(np.diff(levels, prepend=0.0)))
        finer_levels = np.cumsum(np.abs(np.diff(finer_levels, prepend=0.0)))
    order = np.argsort(levels)
    levels = levels[order]
    displacements = path[order]
    if len(levels) == 1:
        levels = np.append(0.0, levels)
        displacements = np.concatenate([0.0 * displacements, displacements])
    starts = np.empty((len(finer.increments), *finer.mesh.points.shape))
    for start, level in zip(starts, finer_levels, strict=True):
        upper = int(np.searchsorted(levels, level))
        upper = min(max(upper, 1), len(levels) - 1)
        share = (level - levels[upper - 1]) / (levels[upper] - levels[upper - 1])
        start[:] = sample @ (
            (1.0 - share) * displacements[upper - 1] + share * displacements[upper]
        )
        start.reshape(-1)[finer.fixed] = 0.0
    return starts


def _sample(reading: SmoothReading | FacetReading, positions: Array) -> scipy.sparse.csr_matrix:
    """Return the sparse matrix that interpolates nodal values at positions (n, 2), mm.

    A position that lies within the rim of one mesh but outside that of another (both are polygons)
    is moved towards the centre, in steps, until it lies on the mesh. Raise InputError if it does
    not.
    """
    shifted = positions.copy()
    is_on_mesh = np.zeros(len(positions), dtype=bool)
    for share in (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.95, 0.9):
        shifted[~is_on_mesh] = share * positions[~is_on_mesh]
        matrix, is_on_mesh = reading.matrix(shifted)
        if is_on_mesh.all():
            return matrix
    problem = f"{(~is_on_mesh).sum()} places of the data lie outside of it"
    raise InputError(None, "mesh", problem)
