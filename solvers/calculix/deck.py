"""What the decks of all models have in common: shells, material, control of Newton's method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ... import __version__
from ..decks import render
from .library import MATERIAL, STATE_VARIABLES
from .shells import ShellMesh

MESH, MESH_FILE = "mesh.inp.j2", "mesh.inp"
#: Iterations before CalculiX judges convergence (8, 12), gives up (24) and so on; cut to half
#: after divergence, grow fourfold after two easy increments (*CONTROLS, TIME INCREMENTATION).
TIME_INCREMENTATION = "8, 12, 9, 24, 20, 4, , 10\n0.5, 0.5, 0.75, 0.85, , , 4"


def deck_files(
    deck: str,
    name: str,
    shells: ShellMesh,
    element: str,
    tolerances: tuple[float, float],
    context: Mapping[str, Any],
    folder: Path | None = None,
) -> dict[str, str]:
    """Text of each input file by name, `job.inp` and the mesh.

    Parameters
    ----------
    deck : template of `job.inp`. name : of the test, for its title.
    tolerances : largest residual force over the mean force, and largest correction over the
        largest change, at which an increment has converged.
    context : what only this deck's template is given.
    folder : the user's templates.

    Raises
    ------
    InputError : a template that cannot be used.
    """
    mesh = {
        "element": element,
        "points": shells.points.tolist(),
        "elements": (shells.elements + 1).tolist(),
        "node_sets": {
            name.upper(): (nodes + 1).tolist() for name, nodes in shells.node_sets.items()
        },
    }
    common = {
        "version": __version__,
        "title": f"{name}, {len(shells.elements)} shells {element}",
        "mesh_file": MESH_FILE,
        "mesh": mesh,
        "material": MATERIAL,
        "state_variables": STATE_VARIABLES,
        "element": element,
        "force_tolerance": tolerances[0],
        "correction_tolerance": tolerances[1],
        "time_incrementation": TIME_INCREMENTATION,
    }
    return {
        "job.inp": render("calculix", deck, {**common, **context}, folder),
        MESH_FILE: render("calculix", MESH, mesh, _holding(folder, MESH)),
    }


def supports_of(supports: Mapping[str, Sequence[int]]) -> list[dict[str, Any]]:
    """What the templates hold: each set of nodes and its directions, numbered from 1."""
    return [
        {"set": name.upper(), "dofs": [d + 1 for d in directions]}
        for name, directions in supports.items()
    ]


def _holding(folder: Path | None, name: str) -> Path | None:
    """The user's folder when it has this template too: a deck of one's own can do with our mesh."""
    return folder if folder is not None and (folder / name).is_file() else None
