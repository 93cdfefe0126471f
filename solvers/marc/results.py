"""From a post file to a `History`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import Mesh
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ..base import History, extremes, log_strain
from ..pulls import at_elongations
from .t19 import T19File

Array = NDArray[np.float64]

MOVED, REACTION = "Displacement", "Reaction Force"
#: Six digits: times of some hundreds are good to this, nodes to this part of the mesh's size.
NEAR_TIME, NEAR_PLACE = 1e-2, 1e-5
NO_REACTIONS = (
    f"the .t19 holds no {REACTION!r}; ask for it in a block 'post' of your own "
    "(bubblefit docs marc)"
)


def whole_times(path: Path, mesh: Mesh, count: int) -> list[dict[str, Array]]:
    """Vectors by name at total times 1 to `count`, (nodes, components) each.

    Raises
    ------
    SolverFailure : the file is not there, damaged, of another mesh, or lacks one of the times or
        its displacements.
    """
    try:
        return _whole_times(path, mesh, count)
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "marc") from None


def _whole_times(path: Path, mesh: Mesh, count: int) -> list[dict[str, Array]]:
    found = by_time(path, mesh)
    for time in range(1, count + 1):
        if time not in found:
            raise InputError(path, f"time {time} of {count}", f"holds no {MOVED} of x, y and z")
    return [found[time] for time in range(1, count + 1)]


def by_time(path: Path, mesh: Mesh, ended: bool = True) -> dict[int, dict[str, Array]]:
    """Vectors by name at every whole time that has displacements.

    ended : as for `T19File.frames`.

    Raises
    ------
    InputError : the file is not there, damaged, or of another mesh.
    """
    file = T19File(path)
    nodes = len(mesh.points)
    if not np.array_equal(file.mesh.numbers, np.arange(1, nodes + 1)):
        raise InputError(path, "nodes", f"are not the deck's {nodes}")
    size = float(np.abs(mesh.points).max())
    if np.abs(file.mesh.points - mesh.points).max() > NEAR_PLACE * size:
        raise InputError(path, "nodes", "are not where the deck has them: of another job?")
    found: dict[int, dict[str, Array]] = {}
    for frame in file.frames(ended):
        time, moved = round(frame.time), frame.fields.get(MOVED)
        if abs(frame.time - time) < NEAR_TIME and moved is not None and moved.shape[1] >= 3:
            found[time] = frame.fields
    return found


def displacements(frames: Sequence[Mapping[str, Array]]) -> Array:
    """(frames, nodes, 3) mm."""
    return np.ascontiguousarray([frame[MOVED][:, :3] for frame in frames])


def reactions(frames: Sequence[Mapping[str, Array]]) -> Array | None:
    """Forces of the supports on the nodes, (frames, nodes, 3) N; None where there are none."""
    if any(REACTION not in frame for frame in frames):
        return None
    return np.ascontiguousarray([frame[REACTION][:, :3] for frame in frames])


def bubble_history(path: Path, model: BubbleModel, iterations: int) -> History:
    """Displacements, support forces and strains of a bubble.

    Raises
    ------
    SolverFailure : as `whole_times`.
    """
    frames = whole_times(path, model.mesh, len(model.increments))
    u, forces, keep = displacements(frames), reactions(frames), model.reported
    sums: dict[str, Array] = {}
    if forces is not None:
        sums = {
            name: forces[keep][:, model.mesh.node_sets[name]].sum(axis=1)
            for name in model.supports
            if name in model.mesh.node_sets
        }
    return History(
        np.array(model.increments)[keep],
        u[keep],
        *extremes(log_strain(model.mesh, u, model.mesh.warp)),
        sums,
        iterations=iterations,
        path=u,
        remarks=() if forces is not None else (Note(NoteKind.NO_REACTIONS, NO_REACTIONS),),
    )


def opened(path: Path, model: UniaxialModel, count: int) -> Array:
    """Elongation of the gauge (mm) at the `count` increments of a pull."""
    return _opened(displacements(whole_times(path, model.mesh, count)), model)


def strip_history(
    path: Path, model: UniaxialModel, count: int, driven: bool, iterations: int
) -> History:
    """Load, displacement and reactions where the gauge has the model's elongations.

    driven : the grips are the gauge, so that it has them already.

    Raises
    ------
    SolverFailure : as `whole_times`; no reactions, a gauge that does not reach its length.
    """
    frames = whole_times(path, model.mesh, count)
    u, forces = displacements(frames), reactions(frames)
    if forces is None:
        raise SolverFailure(NO_REACTIONS, "marc")
    gauge = _opened(u, model)

    def at_levels(values: Array) -> Array:
        return values if driven else at_elongations(gauge, model, values, "marc")

    corners = np.ascontiguousarray(at_levels(u))
    sums = {
        name: at_levels(forces[:, model.mesh.node_sets[name]].sum(axis=1))
        for name in (*model.supports, model.pulled)
    }
    return History(
        -model.load_factor * sums[model.pulled][:, 1],
        corners,
        *extremes(log_strain(model.mesh, corners, model.warp)),
        sums,
        iterations=iterations,
        path=corners,
    )


def _opened(u: Array, model: UniaxialModel) -> Array:
    lower, upper = (model.mesh.points[n] + u[:, n] for n in model.mesh.node_sets["gauge"])
    return np.asarray(np.linalg.norm(upper - lower, axis=1) - model.gauge_length)
