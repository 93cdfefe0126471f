"""From a result file to a `History`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...models.bubble import BubbleModel
from ..base import History
from ..membrane.element import reference_elements
from .frd import FrdFile
from .pressure import pressure_forces
from .shells import ShellMesh

Array = NDArray[np.float64]
NEAR = 1e-6


def bubble_history(path: Path, model: BubbleModel, shells: ShellMesh, iterations: int) -> History:
    """Displacements, support forces and strains of a bubble's .frd file.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    try:
        u, nodal = _steps(path, len(model.increments), len(shells.points))
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "calculix") from None
    keep, levels = model.reported, np.array(model.increments)
    reactions: dict[str, Array] = {
        name: np.zeros((len(keep), 3)) for name in model.supports if name in shells.node_sets
    }
    for frame, i in enumerate(keep):
        # CalculiX reports internal forces: what the support gives and the pressure next to it.
        support = nodal[i] - pressure_forces(shells.points + u[i], shells.elements, levels[i])
        for name, sums in reactions.items():
            sums[frame] = support[shells.node_sets[name]].sum(axis=0)
    corners = np.ascontiguousarray(u[:, : shells.corners])
    strain = np.array([log_strain(model, moved) for moved in corners])
    return History(
        levels[keep],
        corners[keep],
        np.minimum(strain.min(axis=(0, 1, 2)), 0.0),
        np.maximum(strain.max(axis=(0, 1, 2)), 0.0),
        reactions,
        iterations=iterations,
        path=corners,
    )


def log_strain(model: BubbleModel, displacement: Array) -> Array:
    """(quads, 4, 3) log strain (eps1, eps2, gamma12) at the Gauss points of the four-node mesh."""
    points, quads = np.asarray(model.mesh.points, float), np.asarray(model.mesh.quads)
    slopes = reference_elements(points, quads).slopes
    gradient = np.einsum("mpin,mnk->mpki", slopes, (points + displacement)[quads])
    values, axes = np.linalg.eigh(np.einsum("mpki,mpkj->mpij", gradient, gradient))
    h = np.einsum("mpia,mpa,mpja->mpij", axes, 0.5 * np.log(values), axes)
    return np.stack([h[..., 0, 0], h[..., 1, 1], 2 * h[..., 0, 1]], axis=-1)


def _steps(path: Path, steps: int, nodes: int) -> tuple[Array, Array]:
    """Displacement and nodal force at the end of every step, (steps, nodes, 3) each."""
    file = FrdFile(path)
    place = np.searchsorted(file.mesh.numbers, np.arange(1, nodes + 1))
    place = np.minimum(place, len(file.mesh.numbers) - 1)
    if (file.mesh.numbers[place] != np.arange(1, nodes + 1)).any():
        raise InputError(path, "nodes", f"are not the deck's {nodes}")
    frames = {round(f.time): f for f in file.frames() if abs(f.time - round(f.time)) < NEAR}
    found = []
    for step in range(1, steps + 1):
        for name in ("DISP", "FORC"):
            values = frames[step].fields.get(name) if step in frames else None
            if values is None or not np.isfinite(values[place]).all():
                raise InputError(path, f"step {step} of {steps}", f"holds no {name} at every node")
            found.append(values[place])
    whole = np.array(found).reshape(steps, 2, nodes, 3)
    return whole[:, 0], whole[:, 1]
