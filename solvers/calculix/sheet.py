"""A sheet that is not flat, or not taut, and a rim that moves, as shells of CalculiX.

CalculiX counts displacements from the nodes of the deck, which are where the sheet is without
stress; the model counts them from its reference surface. The two differ by the sheet's slack.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...models.bubble import BubbleModel
from ...notes import Note, NoteKind
from .shells import ShellMesh

Array = NDArray[np.float64]
#: Longest first increment of a step in which the rim moves, and how long it stays for it.
FIRST_OF_STEP = 0.01
#: Slope of a shell that lowers its stiffness by 2 %.
STEEP = 0.1


def without_stress(shells: ShellMesh, model: BubbleModel) -> ShellMesh:
    """The shells where the sheet is without stress; of those on the reference surface."""
    warp, fill = model.slack
    return replace(shells, points=shells.points * (1.0 + warp, 1.0 + fill, 1.0))


def rim_paths(shells: ShellMesh, model: BubbleModel) -> list[dict[str, object]]:
    """Node and direction (from 1) of the rim's unknowns, and their paths; none if it stays.

    A path is a list of (total time, displacement in mm from the node without stress). A step is 1
    long, and its first increment (`FIRST_OF_STEP`) has to leave the rim where it is: where a
    prescribed displacement changes in it, CalculiX begins with a linear iteration, from which a
    membrane under pressure does not recover.

    Raises
    ------
    SolverFailure : the mesh has lines of symmetry; a rim that is moved where shells must not turn
        crashes CalculiX 2.20.
    """
    if model.rim_motion is None and not any(model.slack):
        return []
    if {"symmetry_x", "symmetry_y"} & set(shells.node_sets):
        problem = "takes a slack sheet, or a rim that moves, on the full disk only"
        raise SolverFailure(problem, "calculix")
    rim = shells.node_sets["rim"]
    back = shells.points - without_stress(shells, model).points
    times, places = [0.0], [np.zeros_like(back)]
    for i in range(len(model.increments)):
        moved = back.copy()
        if model.rim_motion is not None:
            moved += _with_midsides(shells, model, model.rim_motion[i])
        times += [i + FIRST_OF_STEP, i + 1.0]
        places += [places[-1], moved]
    return [
        {
            "node": int(node) + 1,
            "dof": axis + 1,
            "path": [(t, float(at[node, axis])) for t, at in zip(times, places, strict=True)],
        }
        for node in rim
        for axis in model.supports["rim"]
    ]


def _with_midsides(shells: ShellMesh, model: BubbleModel, motion: Array) -> Array:
    """(nodes, 3) mm: a midside of the rim moves as the middle of its two ends does."""
    moved = np.zeros_like(shells.points)
    moved[model.mesh.node_sets["rim"]] = motion
    if shells.elements.shape[1] == 8:
        ends = shells.elements[:, :4]
        moved[shells.elements[:, 4:]] = 0.5 * (moved[ends] + moved[np.roll(ends, -1, axis=1)])
    return moved


def tilt_remarks(shells: ShellMesh) -> tuple[Note, ...]:
    """What the tilt of the sheet does to the law, where that is worth a word.

    Warp and fill are x and y of the deck, not laid onto every shell: where a shell stands at a
    slope s, its stiffness along the slope is lower by 2 s^2.
    """
    corner = shells.points[shells.elements[:, :4]]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    slope = float((np.hypot(normal[:, 0], normal[:, 1]) / np.abs(normal[:, 2])).max())
    if slope <= STEEP:
        return ()
    lower = f"the sheet's slopes of up to {slope:.2f} lower its stiffness there by up to"
    words = f"CalculiX takes warp and fill as x and y: {lower} {200 * slope**2:.1f} %"
    return (Note(NoteKind.TILT, words),)
