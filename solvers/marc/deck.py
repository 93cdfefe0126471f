"""What the decks of all models have in common: law, schedule, supports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ... import __version__
from ...errors import InputError
from ...materials.law import HypoelasticLaw
from ..decks import render
from .settings import MarcSettings
from .tables import modulus_table

JOB = "job"
#: Residual force and displacement, relative (thesis, section 2.2).
TOLERANCE = 1e-3
#: Name and number of the table of each modulus.
TABLES = (("E1", "e1", 11), ("E2", "e2", 12), ("G12", "g12", 13))
MEMBRANE = 18
ROTATIONS = {0: (4, 5), 1: (3, 5), 2: (3, 4)}


def law_context(law: HypoelasticLaw, settings: MarcSettings) -> dict[str, Any]:
    """What the templates are given of the law.

    Raises
    ------
    InputError : a law that Marc's shells do not carry.
    """
    if law.thickness_change != "constant":
        problem = (
            "'incompressible' is not in Marc's deck, where the thickness is constant; "
            "use 'constant', or another solver"
        )
        raise InputError(None, "material.thickness_change", problem)
    moduli = [
        {"name": name, "number": number, "points": modulus_table(law, modulus).tolist()}
        for modulus, name, number in TABLES
    ]
    word = "nlelast" if settings.law == "nlelast" else "hypoelastic"
    return {"law": word, "moduli": moduli, "nu12": law.nu12}


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
