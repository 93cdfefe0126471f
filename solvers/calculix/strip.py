"""The strip models in CalculiX: what the template is given, and how far the grips are pulled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import (
    PULLED,
    ROLLERS_PATCH,
    SIDE,
    PatchModel,
    UniaxialModel,
    elongations,
)
from ..base import History, extremes, log_strain
from ..pulls import at_elongations, grip_pulls
from .bubble import whole_times
from .deck import Run, Setup, ShellMesh, deck_files, supports_of
from .library import constants

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StripRun:
    """Increment by increment of the pull: elongation of the gauge (n,) mm, displacement and nodal
    force (n, nodes of the shells, 3) mm and N."""

    gauge: Array
    displacement: Array
    force: Array


def strip_run(path: Path, model: UniaxialModel, shells: ShellMesh, count: int) -> StripRun:
    """The `count` increments of a .frd file.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    u, force = whole_times(path, count, len(shells.points))
    lower, upper = (shells.points[n] + u[:, n] for n in model.mesh.node_sets["gauge"])
    return StripRun(np.linalg.norm(upper - lower, axis=1) - model.gauge_length, u, force)


def strip_history(
    run: StripRun, model: UniaxialModel, shells: ShellMesh, iterations: int
) -> History:
    """Load, displacement and reactions where the gauge has the model's elongations.

    Raises
    ------
    SolverFailure : the gauge does not reach its length, or gets shorter on the way.
    """

    def at_levels(values: Array) -> Array:
        return at_elongations(run.gauge, model, values, "calculix")

    corners = np.ascontiguousarray(at_levels(run.displacement[:, : shells.corners]))
    strain = log_strain(model.mesh, corners, model.warp)
    low, high = extremes(strain)
    # What a support gives is what CalculiX calls the force of its nodes: the inner one.
    sums = {
        name: at_levels(run.force[:, shells.node_sets[name]].sum(axis=1))
        for name in (*model.supports, model.pulled)
    }
    load = -model.load_factor * sums[model.pulled][:, 1]
    return History(load, corners, low, high, sums, iterations=iterations, path=corners)


DECK = "strip.inp.j2"
#: Those of the bubble would do, but the increments are a hundredth of the whole: the load is
#: within 2e-8 of what they give, for a sixth fewer iterations.
TOLERANCES = (1e-5, 1e-4)
#: Least increment of CalculiX as a part of one of the law.
LEAST = 1 / 256


def analyse(model: UniaxialModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of a strip, at the model's elongations of the gauge.

    CalculiX drives the grips, see `pulls`.

    Raises
    ------
    SolverFailure : a run that did not end well, a gauge that did not reach its length.
    """
    shells = setup.shells(model.mesh)

    def decks(pulls: Array) -> dict[str, str]:
        return strip_decks(model, law, shells, setup.element, pulls, setup.templates)

    def opened(pulls: Array) -> Array:
        return run(decks(pulls), lambda frd, _: strip_run(frd, model, shells, len(pulls))).gauge

    pulls, _ = grip_pulls(model, law, opened, "calculix")
    count = len(pulls)

    def read(frd: Path, iterations: int) -> History:
        return strip_history(strip_run(frd, model, shells, count), model, shells, iterations)

    return run(decks(pulls), read)


def strip_decks(
    model: UniaxialModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    pulls: Array,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file; `pulls` (increments,) mm of the pulled end, along -y.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    angle = math.degrees(math.atan2(model.warp[1], model.warp[0]))
    context = {
        # A law's increment is a whole time, whatever CalculiX makes of it.
        "constants": constants(law, angle=angle, whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(model.supports),
        "pulled": model.pulled.upper(),
        "pulls": pulls.tolist(),
        "least": LEAST,
        "most_increments": 4 * len(pulls) + 200,
    }
    return deck_files(DECK, "Strip", shells, element, TOLERANCES, context, folder)


DECK_PATCH = "patch.inp.j2"
#: Of the force of an edge: its corners and, where there is one, its midside.
SHARES = {2: (0.5, 0.5), 3: (1 / 6, 1 / 6, 2 / 3)}


def analyse_patch(model: PatchModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of a patch, at every one of its loads.

    Raises
    ------
    SolverFailure : a run that did not end well.
    """
    shells = setup.shells(model.mesh)

    def read(frd: Path, iterations: int) -> History:
        u, _ = whole_times(frd, len(model.loads), len(shells.points))
        corners = np.ascontiguousarray(u[:, : shells.corners])
        strain = np.column_stack([np.log1p(elongations(corners)), np.zeros(len(corners))])
        low, high = strain.min(axis=0), strain.max(axis=0)
        return History(model.loads.sum(axis=1), corners, low, high, iterations=iterations)

    return run(patch_decks(model, law, shells, setup.element, setup.templates), read)


def patch_decks(
    model: PatchModel,
    law: HypoelasticLaw,
    shells: ShellMesh,
    element: str,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    count = len(model.loads)
    context = {
        # A law's increment is a whole time, whatever CalculiX makes of it.
        "constants": constants(law, whole_times=True),
        "thickness": model.thickness,
        "supports": supports_of(ROLLERS_PATCH),
        "edges": [
            {
                "name": name.upper(),
                "dof": axis + 1,
                "forces": (SIDE * model.loads[:, axis]).tolist(),
                "nodes": _shares(shells.node_sets[name]),
            }
            for axis, name in enumerate(PULLED)
        ],
        "count": count,
        "least": LEAST,
        "most_increments": 4 * count + 200,
    }
    return deck_files(DECK_PATCH, "Patch", shells, element, TOLERANCES, context, folder)


def _shares(nodes: NDArray[np.intp]) -> list[tuple[int, float]]:
    """Number from 1 of each node of an edge, the midside last, and its share of the force."""
    return [(int(n) + 1, share) for n, share in zip(nodes, SHARES[len(nodes)], strict=True)]
