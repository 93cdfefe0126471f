"""The bubble model as a Marc deck."""

from __future__ import annotations

import numpy as np

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ..base import History
from .analysis import Run
from .deck import deck_text, law_context, schedule, supports, time_table
from .fabric import fabric_context, node_sets
from .results import bubble_history
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
