"""Analyses of the bubble, the strip and the patch in CalculiX, by decks of shell elements."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import Array
from ...meshes.strip_models import (
    PULLED,
    ROLLERS_PATCH,
    SIDE,
    PatchModel,
    UniaxialModel,
    elongations,
)
from ..base import History
from ..prescribed import (
    gauge_opened,
    grip_pulls,
    held_dofs,
    inflated_history,
    strip_history,
    without_cords,
)
from ..pretension import stretched
from .deck import (
    FIRST_OF_STEP,
    CalculixRun,
    Setup,
    ShellMesh,
    deck_files,
    pressure_forces,
    rim_paths,
    supports_of,
    tilt_remarks,
    warp_angle,
    without_stress,
)
from .frd import FrdFile
from .library import constants

ROUNDING = 1e-6
#: Largest residual force over the mean force, and largest correction over the largest change.
#: CalculiX' defaults, 5e-3 and 1e-2, leave errors of up to 7e-3 mm. Those for bubbles bring the
#: displacements within 1.4e-6 mm of converged ones, with half as many iterations again. Those for
#: strips, whose increments are a hundredth of the whole, bring the load within 2e-8 of what the
#: tolerances of bubbles give, with a sixth fewer iterations.
TOLERANCES, TOLERANCES_STRIP = (1e-7, 1e-6), (1e-5, 1e-4)
#: First increment as a share of the first step; the flat disk resists only by its bending.
FIRST = 0.003
#: Smallest increment of the first step, and of each later step or increment of the law. A later
#: step that needs smaller ones has met an instability, along which CalculiX would creep for hours.
SMALLEST_INCREMENTS = (1e-6, 1 / 256)
MOST_INCREMENTS = 200
#: Shares of the force on an edge of the patch at its corners and, if there is one, its midside, by
#: the number of these nodes.
SHARES = {2: (0.5, 0.5), 3: (1 / 6, 1 / 6, 2 / 3)}


def whole_times(path: Path, count: int, nodes: int) -> tuple[Array, Array]:
    """Return the displacements (mm) and nodal forces (N) at the times 1 to `count` of a result.

    Both are (count, nodes, 3). SolverFailure if the file does not hold them all.
    """
    try:
        file = FrdFile(path)
        place = np.searchsorted(file.mesh.numbers, np.arange(1, nodes + 1))
        place = np.minimum(place, len(file.mesh.numbers) - 1)
        if (file.mesh.numbers[place] != np.arange(1, nodes + 1)).any():
            raise InputError(path, "nodes", f"are not the deck's {nodes}")
        frames = {round(f.time): f for f in file.frames() if abs(f.time - round(f.time)) < ROUNDING}
        fields = []
        for step in range(1, count + 1):
            for name in ("DISP", "FORC"):
                values = frames[step].fields.get(name) if step in frames else None
                if values is None or not np.isfinite(values[place]).all():
                    at = f"step {step} of {count}"
                    problem = f"holds no {name} at every node"
                    raise InputError(path, at, problem)
                fields.append(values[place])
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "calculix") from None
    displacement = np.array(fields).reshape(count, 2, nodes, 3)
    return displacement[:, 0], displacement[:, 1]


def analyse_bubble(
    model: BubbleModel,
    law: HypoelasticLaw,
    setup: Setup,
    run: CalculixRun,
) -> History:
    """Inflate a bubble; SolverFailure if the run fails, InputError if the sheet has cords."""
    without_cords(model, "CalculiX")
    model = stretched(model, law)
    shells = setup.shells(model.mesh)
    files = bubble_decks(model, law, shells, setup.element, setup.templates)
    sheet = without_stress(shells, model)

    def history(frd: Path, iterations: int) -> History:
        inflation = bubble_history(frd, model, sheet, iterations)
        return replace(inflation, remarks=(*inflation.remarks, *tilt_remarks(sheet)))

    return run(files, history)


def bubble_decks(
    model: BubbleModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the text of the input files of a bubble by name; see `deck_files`."""
    supports = {
        name: held_dofs(directions)
        for name, directions in model.supports.items()
        if name in model.mesh.node_sets
    }
    rim = rim_paths(shells, model)
    later = FIRST_OF_STEP if rim else 1.0
    context: dict[str, Any] = {
        # The law's increments are the model's, whatever CalculiX makes of them.
        "constants": constants(law, angle=warp_angle(model.mesh, model.yarn), whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(supports),
        "rim": rim,
        "most_increments": MOST_INCREMENTS,
        "steps": [
            {"pressure": p, "first": later if i else FIRST, "least": SMALLEST_INCREMENTS[bool(i)]}
            for i, p in enumerate(model.increments)
        ],
    }
    sheet = without_stress(shells, model)
    return deck_files(
        "bubble.inp.j2",
        "Bubble",
        sheet,
        element,
        TOLERANCES,
        context,
        folder,
    )


def bubble_history(
    path: Path,
    model: BubbleModel,
    shells: ShellMesh,
    iterations: int,
) -> History:
    """Return the history of a bubble from its result file; SolverFailure as in `whole_times`."""
    u, nodal = whole_times(path, len(model.increments), len(shells.points))
    # CalculiX reports internal forces: what the support gives and the pressure next to it.
    pushed = [
        pressure_forces(shells.points + u[i], shells.elements, model.increments[i])
        for i in model.reported
    ]
    forces = nodal[model.reported] - np.array(pushed)
    corners = u[:, : shells.corners]
    return inflated_history(model, corners, forces, shells.node_sets, iterations)


def analyse_strip(
    model: UniaxialModel,
    law: HypoelasticLaw,
    setup: Setup,
    run: CalculixRun,
) -> History:
    """Pull a strip to the elongations of its gauge.

    SolverFailure if a run fails, or does not reach the last elongation.
    """
    shells = setup.shells(model.mesh)

    def decks(pulls: Array) -> dict[str, str]:
        return strip_decks(
            model,
            law,
            shells,
            setup.element,
            pulls,
            setup.templates,
        )

    def opened(pulls: Array) -> Array:
        u, _ = run(decks(pulls), lambda frd, _: whole_times(frd, len(pulls), len(shells.points)))
        return gauge_opened(model, u)

    pulls, _ = grip_pulls(model, law, opened, "calculix")

    def read(frd: Path, iterations: int) -> History:
        # What a support gives is what CalculiX calls the force of its nodes: the inner one.
        u, force = whole_times(frd, len(pulls), len(shells.points))
        corners = u[:, : shells.corners]
        return strip_history(
            model,
            corners,
            force,
            shells.node_sets,
            "calculix",
            iterations,
        )

    return run(decks(pulls), read)


def strip_decks(
    model: UniaxialModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    pulls: Array,
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the text of the input files of a strip by name; see `deck_files`.

    Parameters
    ----------
    pulls : array
        Displacement of the pulled end along -y, (increments,) mm.
    """
    context = {
        # A law's increment is a whole time, whatever CalculiX makes of it.
        "constants": constants(law, angle=warp_angle(model.mesh, model.warp), whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(model.supports),
        "pulled": model.pulled.upper(),
        "pulls": pulls.tolist(),
        "least": SMALLEST_INCREMENTS[1],
        "most_increments": 4 * len(pulls) + 200,
    }
    return deck_files(
        "strip.inp.j2",
        "Strip",
        shells,
        element,
        TOLERANCES_STRIP,
        context,
        folder,
    )


def analyse_patch(
    model: PatchModel,
    law: HypoelasticLaw,
    setup: Setup,
    run: CalculixRun,
) -> History:
    """Load a patch biaxially with all its loads in turn; SolverFailure if the run fails."""
    shells = setup.shells(model.mesh)
    count = len(model.loads)
    context = {
        "constants": constants(law, whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(ROLLERS_PATCH),
        "edges": [
            {
                "name": name.upper(),
                "dof": axis + 1,
                "forces": (SIDE * model.loads[:, axis]).tolist(),
                # Number of each node, the midside last, and its share of the force.
                "nodes": [
                    (node + 1, share)
                    for node, share in zip(
                        shells.node_sets[name], SHARES[len(shells.node_sets[name])], strict=True
                    )
                ],
            }
            for axis, name in enumerate(PULLED)
        ],
        "count": count,
        "least": SMALLEST_INCREMENTS[1],
        "most_increments": 4 * count + 200,
    }

    def read(frd: Path, iterations: int) -> History:
        u, _ = whole_times(frd, count, len(shells.points))
        corners = np.ascontiguousarray(u[:, : shells.corners])
        strain = np.column_stack([np.log1p(elongations(corners)), np.zeros(len(corners))])
        low = strain.min(axis=0)
        high = strain.max(axis=0)
        return History(model.loads.sum(axis=1), corners, low, high, iterations=iterations)

    files = deck_files(
        "patch.inp.j2",
        "Patch",
        shells,
        setup.element,
        TOLERANCES_STRIP,
        context,
        setup.templates,
    )
    return run(files, read)
