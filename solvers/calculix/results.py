"""From a result file to a `History`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...models.bubble import BubbleModel
from ..base import History
from ..strains import extremes, log_strain
from .frd import FrdFile
from .pressure import pressure_forces
from .shells import ShellMesh

Array = NDArray[np.float64]
NEAR = 1e-6


def bubble_history(path: Path, model: BubbleModel, shells: ShellMesh, iterations: int) -> History:
    """Displacements, support forces and strains of a bubble's .frd file.

    shells : where the sheet is without stress.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    u, nodal = whole_times(path, len(model.increments), len(shells.points))
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
    strain = log_strain(replace(model.mesh, points=model.stress_free), corners)
    corners += model.stress_free - model.mesh.points
    return History(
        levels[keep],
        corners[keep],
        *extremes(strain),
        reactions,
        iterations=iterations,
        path=corners,
    )


def whole_times(path: Path, count: int, nodes: int) -> tuple[Array, Array]:
    """Displacement and nodal force at the total times 1 to `count`, (count, nodes, 3) each.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every one of them.
    """
    try:
        return _whole_times(path, count, nodes)
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "calculix") from None


def _whole_times(path: Path, count: int, nodes: int) -> tuple[Array, Array]:
    file = FrdFile(path)
    place = np.searchsorted(file.mesh.numbers, np.arange(1, nodes + 1))
    place = np.minimum(place, len(file.mesh.numbers) - 1)
    if (file.mesh.numbers[place] != np.arange(1, nodes + 1)).any():
        raise InputError(path, "nodes", f"are not the deck's {nodes}")
    frames = {round(f.time): f for f in file.frames() if abs(f.time - round(f.time)) < NEAR}
    found = []
    for step in range(1, count + 1):
        for name in ("DISP", "FORC"):
            values = frames[step].fields.get(name) if step in frames else None
            if values is None or not np.isfinite(values[place]).all():
                raise InputError(path, f"step {step} of {count}", f"holds no {name} at every node")
            found.append(values[place])
    whole = np.array(found).reshape(count, 2, nodes, 3)
    return whole[:, 0], whole[:, 1]
