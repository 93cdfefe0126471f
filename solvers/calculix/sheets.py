"""Bubble, strip and patch in CalculiX: their decks of shells, and their results."""

import math
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
    without_stress,
)
from .frd import FrdFile
from .library import constants

ROUNDING = 1e-6
#: Largest residual force over the mean force, and largest correction over the largest change
#: (CalculiX: 5e-3, 1e-2, off by up to 7e-3 mm). A bubble's are within 1.4e-6 mm of converged, for
#: half as many iterations again. A strip's increments are a hundredth of the whole: the load is
#: within 2e-8 of what the bubble's give, for a sixth fewer iterations.
TOLERANCES, TOLERANCES_STRIP = (1e-7, 1e-6), (1e-5, 1e-4)
#: First increment as a part of the first step: the flat disk has no stiffness but bending.
FIRST = 0.003
#: Least increment of the first step and of the others, or of one of the law. A later step that
#: needs more cuts has met an instability, along which CalculiX would creep for hours.
SMALLEST_INCREMENTS = (1e-6, 1 / 256)
MOST_INCREMENTS = 200
#: Of the force of a patch's edge: its corners and, where there is one, its midside.
SHARES = {2: (0.5, 0.5), 3: (1 / 6, 1 / 6, 2 / 3)}


def whole_times(path: Path, count: int, nodes: int) -> tuple[Array, Array]:
    """Return displacement and force, (count, nodes, 3), at times 1 to `count`; or SolverFailure."""
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
    model: BubbleModel, law: HypoelasticLaw, setup: Setup, run: CalculixRun
) -> History:
    """Inflate a bubble; SolverFailure where the run does not end well, InputError for cords."""
    without_cords(model, "CalculiX")
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
    """Return the text of `job.inp` and of the mesh; InputError: a template that cannot be used."""
    supports = {
        name: held_dofs(directions)
        for name, directions in model.supports.items()
        if name in model.mesh.node_sets
    }
    rim = rim_paths(shells, model)
    later = FIRST_OF_STEP if rim else 1.0
    context: dict[str, Any] = {
        # The law's increments are the model's, whatever CalculiX makes of them.
        "constants": constants(
            law, angle=math.degrees(math.atan2(*model.yarn[1::-1])), whole_times=True
        ),
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
    return deck_files("bubble.inp.j2", "Bubble", sheet, element, TOLERANCES, context, folder)


def bubble_history(path: Path, model: BubbleModel, shells: ShellMesh, iterations: int) -> History:
    """Return displacements, support forces and strains; SolverFailure as `whole_times`."""
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
    model: UniaxialModel, law: HypoelasticLaw, setup: Setup, run: CalculixRun
) -> History:
    """Pull a strip to the gauge's elongations; SolverFailure: no good end, or not so far."""
    shells = setup.shells(model.mesh)

    def decks(pulls: Array) -> dict[str, str]:
        return strip_decks(model, law, shells, setup.element, pulls, setup.templates)

    def opened(pulls: Array) -> Array:
        u, _ = run(decks(pulls), lambda frd, _: whole_times(frd, len(pulls), len(shells.points)))
        return gauge_opened(model, u)

    pulls, _ = grip_pulls(model, law, opened, "calculix")

    def read(frd: Path, iterations: int) -> History:
        # What a support gives is what CalculiX calls the force of its nodes: the inner one.
        u, force = whole_times(frd, len(pulls), len(shells.points))
        corners = u[:, : shells.corners]
        return strip_history(model, corners, force, shells.node_sets, "calculix", iterations)

    return run(decks(pulls), read)


def strip_decks(
    model: UniaxialModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    pulls: Array,
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the text of each input file; `pulls` (increments,) mm of the pulled end, along -y."""
    angle = math.degrees(math.atan2(model.warp[1], model.warp[0]))
    context = {
        # A law's increment is a whole time, whatever CalculiX makes of it.
        "constants": constants(law, angle=angle, whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(model.supports),
        "pulled": model.pulled.upper(),
        "pulls": pulls.tolist(),
        "least": SMALLEST_INCREMENTS[1],
        "most_increments": 4 * len(pulls) + 200,
    }
    return deck_files("strip.inp.j2", "Strip", shells, element, TOLERANCES_STRIP, context, folder)


def analyse_patch(
    model: PatchModel, law: HypoelasticLaw, setup: Setup, run: CalculixRun
) -> History:
    """Load a patch with every one of its loads; SolverFailure where the run does not end well."""
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
                    (int(node) + 1, share)
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
        "patch.inp.j2", "Patch", shells, setup.element, TOLERANCES_STRIP, context, setup.templates
    )
    return run(files, read)
