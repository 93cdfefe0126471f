"""The inflated cylinder as Marc decks: inflation alone, and with bending."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from .bodies import COLLAR_PATH, SUPPORT_PATH, contact_bodies, paths
from .bubble import pressure_context
from .deck import deck_text, fixed, law_context, schedule, supports, time_table
from .fabric import fabric_context, node_sets
from .settings import MarcSettings

Array = NDArray[np.float64]

TEMPLATE = "cylinder.dat.j2"
HELD = "support_bottom"
#: Increments between inflation and bending, in which the support comes up.
APPROACH = 1
TONNES = 1e-12  # t/mm^3 in a kg/m^3


def inflation_deck(model: CylinderModel, law: HypoelasticLaw, settings: MarcSettings) -> str:
    """Inflation by a pressure, the bottom held in height at the supports.

    Raises
    ------
    InputError : a template that cannot be used, a law that Marc's shells do not carry.
    """
    return _deck(model, law, settings, None)


def bending_deck(
    model: CylinderModel, law: HypoelasticLaw, settings: MarcSettings, inflated: Array
) -> str:
    """Inflation of a cavity, the support brought up, and bending with a constant mass of gas.

    Parameters
    ----------
    inflated : (nodes, 3) mm of displacement of the inflated cylinder.

    Raises
    ------
    InputError : as `inflation_deck`; a whole cylinder.
    """
    gas = model.gas
    cavity = {
        "pressure": gas.ambient,
        "temperature": gas.temperature,
        "density": TONNES * gas.density,
    }
    return _deck(model, law, settings, {"gas": cavity, "bodies": contact_bodies(model, inflated)})


def _deck(
    model: CylinderModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    bending: dict[str, Any] | None,
) -> str:
    mesh, filling, steps = model.mesh, len(model.inflation), len(model.increments)
    warp = np.asarray(mesh.warp)
    fabric = fabric_context(mesh, warp, model.thickness)
    guided = supports(model.guides, settings.element)
    names = [one["name"] for one in guided]
    hold = fixed("hold", HELD, (1,))
    load = [0.0, *model.inflation]
    tables = []
    if bending is None:
        cases = [("inflation", filling, [*names, "hold", "pressure"])]
    else:
        cases = [
            ("inflation", filling, [*names, "hold", "fill"]),
            ("approach", APPROACH, [*names, "hold", "closed"]),
            ("bending", steps, [*names, "closed"]),
        ]
        load += [model.pressure] * (APPROACH + steps)
        support, collar = paths(filling, model.increments)
        tables = [
            time_table(SUPPORT_PATH, "support_path", support),
            time_table(COLLAR_PATH, "collar_path", collar),
        ]
    return deck_text(
        TEMPLATE,
        "Cylinder",
        settings,
        {
            **fabric,
            "sets": [*fabric["sets"], *node_sets(mesh, [*model.guides, HELD])],
            **law_context(law, settings),
            **schedule(settings, cases),
            "follower": True,
            "time_tables": [time_table(1, "load", load), *tables],
            "fixed": [*guided, hold],
            "pressure": pressure_context(settings),
            "start": {"name": "start", "conditions": [*names, "hold"]},
            **(bending or {}),
        },
    )
