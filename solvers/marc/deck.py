"""What the decks of all models have in common: law, schedule, supports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...errors import InputError
from ...materials.exports.marc_hypela2 import STATE_VARIABLES
from ...materials.law import HypoelasticLaw
from ...materials.tables import ModulusTable, modulus_tables
from ..decks import render
from .settings import MarcSettings

JOB = "job"
#: Residual force and displacement, relative (thesis, section 2.2).
TOLERANCE = 1e-3
#: Name and number of the table of each modulus.
TABLES = (("E1", "e1", 11), ("E2", "e2", 12), ("G12", "g12", 13))
#: Strain beyond the ends of a table in which its modulus is held.
GUARD = 1.0
MEMBRANE, THICK = 18, 75
ROTATIONS = {0: (4, 5), 1: (3, 5), 2: (3, 4)}


def law_context(law: HypoelasticLaw, settings: MarcSettings) -> dict[str, Any]:
    """What the templates are given of the law.

    Raises
    ------
    InputError : a law that NLELAST does not carry.
    """
    if settings.law == "hypela2":
        kind = "thick shell" if settings.element == THICK else "membrane"
        return {"law": "hypoelastic", "state_variables": STATE_VARIABLES[kind]}
    if law.thickness_change != "constant":
        problem = (
            "'incompressible' is nothing that NLELAST knows; use 'constant', or [solver.marc] "
            "law = 'hypela2'"
        )
        raise InputError(None, "material.thickness_change", problem)
    tables = modulus_tables(law)
    moduli = [
        {"name": name, "number": number, "points": _held(tables[modulus])}
        for modulus, name, number in TABLES
    ]
    return {"law": "nlelast", "state_variables": 0, "moduli": moduli, "nu12": law.nu12}


def _held(table: ModulusTable) -> list[list[float]]:
    """Its points, and one more beyond each end: held whether or not Marc extrapolates."""
    strain, modulus = (np.pad(values, 1, mode="edge") for values in (table.strain, table.modulus))
    strain[[0, -1]] += [-GUARD, GUARD]
    found: list[list[float]] = np.column_stack([strain, modulus]).tolist()
    return found


def schedule(
    settings: MarcSettings, cases: Sequence[tuple[str, int, Sequence[str]]]
) -> dict[str, Any]:
    """Load cases of so many increments of the model each, with the names of their conditions.

    Every increment of the model is cut into as many as make `settings.increments` in all.
    """
    units = sum(count for _, count, _ in cases)
    cuts = max(1, math.ceil(settings.increments / units))
    return {
        "every": cuts,
        "tolerance": TOLERANCE,
        "cases": [
            {
                "name": name,
                "increments": cuts * count,
                "step": 1 / cuts,
                "conditions": list(conditions),
            }
            for name, count, conditions in cases
        ],
    }


def fixed(
    name: str, members: str, dofs: Sequence[int], values: Sequence[float] = (), table: int = 0
) -> dict[str, Any]:
    """One condition of FIXED DISP on a node set; `dofs` from 0, zero unless `values` are given."""
    given = list(values) or [0.0] * len(dofs)
    return {
        "name": name,
        "set": members,
        "dofs": [dof + 1 for dof in dofs],
        "amounts": given,
        "tables": [table if value else 0 for value in given],
    }


def supports(held: Mapping[str, Sequence[int]], element: int) -> list[dict[str, Any]]:
    """Conditions `fix_SET` from directions held at zero by node set."""
    return [
        fixed(f"fix_{name.lower()}", name.lower(), held_dofs(directions, element))
        for name, directions in held.items()
    ]


def held_dofs(directions: Sequence[int], element: int) -> tuple[int, ...]:
    """Degrees of freedom of a node held where the membrane's `directions` are (from 0).

    One direction: a plane of symmetry, where a shell does not turn about the other two axes.
    More: a pinned edge, which may turn.
    """
    if len(directions) == 1 and element != MEMBRANE:
        return (*directions, *ROTATIONS[directions[0]])
    return tuple(directions)


def time_table(number: int, name: str, values: Sequence[float]) -> dict[str, Any]:
    """A table over time: `values` at times 0, 1, 2, ..."""
    points = [[float(time), float(value)] for time, value in enumerate(values)]
    return {"number": number, "name": name, "points": points}


def deck_text(
    template: str,
    title: str,
    settings: MarcSettings,
    context: Mapping[str, Any],
) -> str:
    """The deck.

    Raises
    ------
    InputError : a template or a file of the site's that cannot be used.
    """
    common = {
        "version": __version__,
        "title": f"{title}, {len(context['elements'])} elements {settings.element}",
        "element": settings.element,
        "shell": settings.element != MEMBRANE,
        "follower": False,
        "gas": None,
    }
    folder = Path(settings.templates) if settings.templates is not None else None
    instead = {f"{name}.dat.j2": Path(file) for name, file in settings.include.items()}
    return render("marc", template, {**common, **context}, folder, instead)
