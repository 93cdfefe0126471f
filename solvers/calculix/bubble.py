"""The bubble model as a CalculiX deck: what its templates are given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ..base import History, extremes, log_strain
from .deck import (
    FIRST_OF_STEP,
    Run,
    Setup,
    ShellMesh,
    deck_files,
    pressure_forces,
    rim_paths,
    tilt_remarks,
    without_stress,
)
from .frd import FrdFile
from .library import constants

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


DECK = "bubble.inp.j2"
#: Largest residual force over the mean force, and largest correction over the largest change
#: (CalculiX: 5e-3, 1e-2, off by up to 7e-3 mm). These are within 1.4e-6 mm of converged, for half
#: as many iterations again.
TOLERANCES = (1e-7, 1e-6)
#: First increment as a part of the first step: the flat disk has no stiffness but bending.
FIRST = 0.003
#: Least increment of the first step and of the others. A later step that needs more cuts has met
#: an instability, along which CalculiX would creep for hours.
LEAST = (1e-6, 1 / 256)
MOST_INCREMENTS = 200
ROTATIONS = {0: (4, 5), 1: (3, 5), 2: (3, 4)}


def analyse(model: BubbleModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of the inflation of a bubble.

    Raises
    ------
    SolverFailure : a run that did not end well. InputError : a template that cannot be used.
    """
    shells = setup.shells(model.mesh)
    files = decks(model, law, shells, setup.element, setup.templates)
    sheet = without_stress(shells, model)

    def history(frd: Path, iterations: int) -> History:
        found = bubble_history(frd, model, sheet, iterations)
        return replace(found, remarks=(*found.remarks, *tilt_remarks(sheet)))

    return run(files, history)


def decks(
    model: BubbleModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file by name, `job.inp` and the mesh.

    Parameters
    ----------
    shells : on the model's reference surface. folder : the user's templates.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    supports = [
        {"set": name.upper(), "dofs": [d + 1 for d in held_directions(directions)]}
        for name, directions in model.supports.items()
        if name in model.mesh.node_sets
    ]
    rim = rim_paths(shells, model)
    sheet = without_stress(shells, model)
    context: dict[str, Any] = {
        # The law's increments are the model's, whatever CalculiX makes of them.
        "constants": constants(law, whole_times=True),
        "thickness": model.thickness,
        "supports": supports,
        "rim": rim,
        "most_increments": MOST_INCREMENTS,
        "steps": [
            {
                "pressure": p,
                "first": FIRST if i == 0 else FIRST_OF_STEP if rim else 1.0,
                "least": LEAST[0 if i == 0 else 1],
            }
            for i, p in enumerate(model.increments)
        ],
    }
    return deck_files(DECK, "Bubble", sheet, element, TOLERANCES, context, folder)


def held_directions(directions: tuple[int, ...]) -> tuple[int, ...]:
    """Degrees of freedom of a shell held where the membrane's `directions` are (from 0).

    One direction: a plane of symmetry, where the shell does not turn about the other two axes.
    More: a pinned edge, which may turn.
    """
    if len(directions) == 1:
        return (*directions, *ROTATIONS[directions[0]])
    return tuple(directions)
