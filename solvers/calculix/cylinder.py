"""The inflated cylinder as a CalculiX deck: what its templates are given."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from ..decks import render
from .deck import MESH_FILE
from .library import MATERIAL, STATE_VARIABLES, constants
from .solids import SolidMesh

DECK, MESH = "cylinder.inp.j2", "solids.inp.j2"
#: Incompatible modes: flat solids lock without.
ELEMENT = "C3D8I"
TOLERANCES = (1e-4, 1e-3)
#: Newton's method gets more iterations than CalculiX gives it by default: contact needs them.
TIME_INCREMENTATION = "6, 10, 9, 30, 14, 6, , 8"
#: First and least increment of CalculiX as parts of one of the law: at first the flat caps have
#: no stiffness but bending. Bending has its own.
FIRST, LEAST = 0.1, 1e-5
MOST_INCREMENTS = 1000


def cylinder_decks(
    model: CylinderModel,
    law: HypoelasticLaw,
    solids: SolidMesh,
    bending: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file by name.

    Parameters
    ----------
    bending : what `bending_context` makes; inflation alone unless given.
    folder : the user's templates.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    mesh: dict[str, Any] = {
        "element": ELEMENT,
        "points": solids.points.tolist(),
        "elements": (solids.elements + 1).tolist(),
        "element_sets": _named(solids.element_sets),
        "node_sets": _named(solids.node_sets),
    }
    # The plane of the caps is xy, where the warp runs along x or y.
    yarn = np.asarray(model.mesh.warp)[solids.element_sets["caps"][0]]
    angle = float(np.degrees(np.arctan2(yarn[1], yarn[0])))
    until = len(model.inflation)
    context: dict[str, Any] = {
        "version": __version__,
        "title": f"Cylinder, {len(solids.elements)} solids {ELEMENT}",
        "mesh_file": MESH_FILE,
        "mesh": mesh,
        "material": MATERIAL,
        "state_variables": STATE_VARIABLES,
        "element": ELEMENT,
        "sections": [
            {
                "set": "TUBE",
                "constants": constants(law, normal_axis=1, whole_until=until),
                "around": True,
            },
            {
                "set": "CAPS",
                "constants": constants(law, angle=angle, whole_until=until),
                "around": False,
            },
        ],
        "supports": [
            {"set": name.upper(), "dof": direction + 1}
            for name, directions in model.guides.items()
            for direction in directions
        ],
        "inflation": list(model.inflation),
        "bending": bending,
        "first": FIRST,
        "least": LEAST,
        "most_increments": MOST_INCREMENTS,
        "force_tolerance": TOLERANCES[0],
        "correction_tolerance": TOLERANCES[1],
        "time_incrementation": TIME_INCREMENTATION,
    }
    ours = folder if folder is not None and (folder / MESH).is_file() else None
    return {
        "job.inp": render("calculix", DECK, context, folder),
        MESH_FILE: render("calculix", MESH, mesh, ours),
    }


def _named(sets: Any) -> dict[str, list[int]]:
    return {name.upper(): (numbers + 1).tolist() for name, numbers in sets.items() if len(numbers)}
