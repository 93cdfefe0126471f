"""The strip models as Marc decks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ..base import History
from ..pulls import grip_pulls
from .analysis import Run
from .deck import MEMBRANE, deck_text, fixed, law_context, schedule, supports, time_table
from .fabric import fabric_context, named_set, node_sets
from .results import opened, strip_history
from .settings import MarcSettings

Array = NDArray[np.float64]

TEMPLATE = "uniaxial.dat.j2"
FLAT = "all_nodes"


def analyse(model: UniaxialModel, law: HypoelasticLaw, settings: MarcSettings, run: Run) -> History:
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
        TEMPLATE,
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
