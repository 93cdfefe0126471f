"""The bubble model as a CalculiX deck: what its templates are given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ..base import History
from .analysis import Run, Setup
from .deck import deck_files
from .library import constants
from .results import bubble_history
from .sheet import FIRST_OF_STEP, rim_paths, tilt_remarks, without_stress
from .shells import ShellMesh

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
