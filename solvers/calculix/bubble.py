"""The bubble model as a CalculiX deck: what its templates are given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ... import __version__
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ..decks import render
from .library import MATERIAL, STATE_VARIABLES, constants
from .shells import ShellMesh

DECK, MESH = "bubble.inp.j2", "mesh.inp.j2"
MESH_FILE = "mesh.inp"
#: Largest residual force over the mean force, and largest correction over the largest change
#: (CalculiX: 5e-3, 1e-2, off by up to 7e-3 mm). These are within 1.4e-6 mm of converged, for half
#: as many iterations again.
TOLERANCES = (1e-7, 1e-6)
#: First increment as a part of the first step: the flat disk has no stiffness but bending.
FIRST = 0.003
#: Least increment of the first step and of the others. A later step that needs more cuts has met
#: an instability, along which CalculiX would creep for hours.
LEAST = (1e-6, 1 / 256)
#: Iterations before CalculiX judges convergence (8, 12), gives up (24) and so on; cut to half
#: after divergence, grow fourfold after two easy increments (*CONTROLS, TIME INCREMENTATION).
TIME_INCREMENTATION = "8, 12, 9, 24, 20, 4, , 10\n0.5, 0.5, 0.75, 0.85, , , 4"
MOST_INCREMENTS = 200
ROTATIONS = {0: (4, 5), 1: (3, 5), 2: (3, 4)}


def decks(
    model: BubbleModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file by name, `job.inp` and the mesh; `folder`: the user's templates.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    supports = [
        {"set": name.upper(), "dofs": [d + 1 for d in held_directions(directions)]}
        for name, directions in model.supports.items()
        if name in model.mesh.node_sets
    ]
    context: dict[str, Any] = {
        "version": __version__,
        "title": f"Bubble, {len(shells.elements)} shells {element}",
        "mesh_file": MESH_FILE,
        "material": MATERIAL,
        # The law's increments are the model's, whatever CalculiX makes of them.
        "constants": constants(law, whole_times=True),
        "state_variables": STATE_VARIABLES,
        "element": element,
        "thickness": model.thickness,
        "supports": supports,
        "force_tolerance": TOLERANCES[0],
        "correction_tolerance": TOLERANCES[1],
        "time_incrementation": TIME_INCREMENTATION,
        "most_increments": MOST_INCREMENTS,
        "steps": [
            {
                "pressure": p,
                "first": FIRST if i == 0 else 1.0,
                "least": LEAST[0 if i == 0 else 1],
            }
            for i, p in enumerate(model.increments)
        ],
    }
    mesh = {
        "element": element,
        "points": shells.points.tolist(),
        "elements": (shells.elements + 1).tolist(),
        "node_sets": {
            name.upper(): (nodes + 1).tolist() for name, nodes in shells.node_sets.items()
        },
    }
    return {
        "job.inp": render("calculix", DECK, {**context, "mesh": mesh}, folder),
        MESH_FILE: render("calculix", MESH, mesh, _holding(folder, MESH)),
    }


def held_directions(directions: tuple[int, ...]) -> tuple[int, ...]:
    """Degrees of freedom of a shell held where the membrane's `directions` are (from 0).

    One direction: a plane of symmetry, where the shell does not turn about the other two axes.
    More: a pinned edge, which may turn.
    """
    if len(directions) == 1:
        return (*directions, *ROTATIONS[directions[0]])
    return tuple(directions)


def _holding(folder: Path | None, name: str) -> Path | None:
    """The user's folder when it has this template too: a deck of one's own can do with our mesh."""
    return folder if folder is not None and (folder / name).is_file() else None
