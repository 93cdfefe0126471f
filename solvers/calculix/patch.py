"""A patch in a biaxial test in CalculiX: one shell, forces on two of its edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.patch import PULLED, ROLLERS, SIDE, PatchModel, elongations
from ..base import History
from .analysis import Run, Setup
from .deck import deck_files, supports_of
from .library import constants
from .results import whole_times
from .shells import ShellMesh
from .strip import LEAST, TOLERANCES

Array = NDArray[np.float64]

DECK = "patch.inp.j2"
#: Of the force of an edge: its corners and, where there is one, its midside.
SHARES = {2: (0.5, 0.5), 3: (1 / 6, 1 / 6, 2 / 3)}


def analyse(model: PatchModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
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
        "supports": supports_of(ROLLERS),
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
    return deck_files(DECK, "Patch", shells, element, TOLERANCES, context, folder)


def _shares(nodes: NDArray[np.intp]) -> list[tuple[int, float]]:
    """Number from 1 of each node of an edge, the midside last, and its share of the force."""
    return [(int(n) + 1, share) for n, share in zip(nodes, SHARES[len(nodes)], strict=True)]
