"""The bubble model as a Marc deck."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.strip_models import UniaxialModel
from ..base import History
from ..pulls import grip_pulls
from .deck import (
    MEMBRANE,
    Run,
    deck_text,
    fabric_context,
    fixed,
    law_context,
    named_set,
    node_sets,
    schedule,
    supports,
    time_table,
)
from .results import bubble_history, opened, strip_history
from .settings import MarcSettings

TEMPLATE = "bubble.dat.j2"
WARP = np.array([1.0, 0.0, 0.0])


def analyse(model: BubbleModel, law: HypoelasticLaw, settings: MarcSettings, run: Run) -> History:
    """History of the inflation of a bubble.

    Raises
    ------
    SolverFailure : a run that did not end well; a sheet with slack, or a rim that moves, which
        these decks do not have. InputError : as `bubble_deck`.
    """
    if any(model.slack) or model.rim_motion is not None:
        raise SolverFailure(
            "takes no slack sheet and no rim that moves, use another solver", "marc"
        )
    deck, count = bubble_deck(model, law, settings), len(model.increments)
    return run(deck, count, lambda t19, iterations: bubble_history(t19, model, iterations))


def bubble_deck(model: BubbleModel, law: HypoelasticLaw, settings: MarcSettings) -> str:
    """The deck of an inflation; total time counts the model's increments.

    Raises
    ------
    InputError : a template that cannot be used, a law that Marc's shells do not carry.
    """
    warp = WARP if model.mesh.warp is None else model.mesh.warp
    fabric = fabric_context(model.mesh, warp, model.thickness)
    held = {name: dofs for name, dofs in model.supports.items() if name in model.mesh.node_sets}
    fixed = supports(held, settings.element)
    names = [one["name"] for one in fixed]
    cases = [("inflation", len(model.increments), [*names, "pressure"])]
    return deck_text(
        TEMPLATE,
        "Bubble",
        settings,
        {
            **fabric,
            "sets": [*fabric["sets"], *node_sets(model.mesh, list(held))],
            **law_context(law, settings),
            **schedule(settings, cases),
            "follower": True,
            "time_tables": [time_table(1, "load", (0.0, *model.increments))],
            "fixed": fixed,
            "pressure": pressure_context(settings),
            "start": {"name": "start", "conditions": names},
        },
    )


def pressure_context(settings: MarcSettings) -> dict[str, float]:
    """Load type of a pressure on the fabric, and the magnitude that inflates by 1 MPa."""
    return {"type": settings.pressure_type, "magnitude": float(settings.pressure_sign)}


Array = NDArray[np.float64]

TEMPLATE_STRIP = "uniaxial.dat.j2"
FLAT = "all_nodes"


def analyse_strip(
    model: UniaxialModel, law: HypoelasticLaw, settings: MarcSettings, run: Run
) -> History:
    """History of a strip, its grips driven as `pulls` tells.

    Raises
    ------
    SolverFailure : a run that did not end well, a gauge that did not reach its length.
    InputError : as `strip_deck`.
    """

    def gauge(pulls: Array) -> Array:
        deck, count = strip_deck(model, law, settings, pulls), len(pulls)
        return run(deck, count, lambda t19, _: opened(t19, model, count))

    pulls, driven = grip_pulls(model, law, gauge, "marc")
    deck, count = strip_deck(model, law, settings, pulls), len(pulls)
    return run(deck, count, lambda t19, n: strip_history(t19, model, count, driven, n))


def strip_deck(
    model: UniaxialModel, law: HypoelasticLaw, settings: MarcSettings, pulls: Array
) -> str:
    """The deck of a pull; `pulls` (increments,) mm of the pulled end, along -y, at whole times.

    Raises
    ------
    InputError : a template that cannot be used, a law that Marc's shells do not carry.
    """
    mesh = model.mesh
    fabric = fabric_context(mesh, model.warp, model.thickness)
    # In its plane a strip neither bends nor twists.
    flat = (2,) if settings.element == MEMBRANE else (2, 3, 4, 5)
    held = [*supports(model.supports, MEMBRANE), fixed("flat", FLAT, flat)]
    names = [one["name"] for one in held]
    pull = fixed("pull", model.pulled.lower(), (1,), (-1.0,), table=1)
    sets = node_sets(mesh, list(dict.fromkeys([*model.supports, model.pulled])))
    return deck_text(
        TEMPLATE_STRIP,
        "Strip",
        settings,
        {
            **fabric,
            "sets": [*fabric["sets"], *sets, named_set("node", FLAT, np.arange(len(mesh.points)))],
            **law_context(law, settings),
            **schedule(settings, [("pull", len(pulls), [*names, "pull"])]),
            "time_tables": [time_table(1, "load", (0.0, *pulls.tolist()))],
            "fixed": [*held, pull],
            "start": {"name": "start", "conditions": names},
        },
    )
