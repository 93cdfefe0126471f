"""From a deck to a model of the membrane solver; flat sheets here, closed ones in closed.py."""

from __future__ import annotations

from typing import Any

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import InflatedModel
from bubblefit.meshes.strip_models import UniaxialModel
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

from .closed import closed_model
from .content import Content, Table
from .fields import DeckError
from .schedule import Schedule, pressures
from .supports import held, supported

Array = NDArray[np.float64]


def model_of(
    content: Content, schedule: Schedule, law: HypoelasticLaw
) -> tuple[Any, NDArray[np.bool_]]:
    """The model whose increments are those of the deck, but for those in which nothing moves.

    Raises
    ------
    DeckError : Marc would run this, the stand-in cannot.
    """
    assert content.coordinates is not None
    if content.gas is not None or np.ptp(content.coordinates[:, 2]) > 1e-9:

        def inflate(model: InflatedModel) -> Array:
            return MembraneSolver().run(model, law).displacement[-1]

        return closed_model(content, schedule, inflate)
    return _flat_model(content, schedule), np.zeros(len(schedule.times), dtype=bool)


def _flat_model(content: Content, schedule: Schedule) -> BubbleModel | UniaxialModel:
    thickness, more = content.thickness[0][0], content.thickness[1:]
    if more or len(content.frames) != 1:
        raise DeckError("stand-in: a flat sheet of one thickness and one frame only")
    warp = content.frames[0][1]
    if any(c.kind == "pressure" for c in content.conditions.values()):
        if np.abs(warp - [1.0, 0.0, 0.0]).max() > 1e-9:
            raise DeckError("stand-in: the warp of a bubble has to be x")
        mesh, supports = supported(content, held(content, schedule.first))
        return BubbleModel(mesh, thickness, pressures(content, schedule), supports=supports)
    return _strip(content, schedule, thickness, warp)


def _strip(content: Content, schedule: Schedule, thickness: float, warp: Array) -> UniaxialModel:
    """Its gauge is a line from a pulled node to one that is held, along the pull."""
    conditions = [content.conditions[name] for name in schedule.first]
    moved = [c for c in conditions if any(c.values)]
    if len(moved) != 1 or moved[0].dofs != [2] or moved[0].values != [-1.0]:
        raise DeckError("stand-in: a strip is pulled along -y by one condition")
    table: Table = content.tables[moved[0].tables[0]]
    pulled = content.node_sets[moved[0].on] - 1
    nodes = held(content, [c.name for c in conditions if c is not moved[0]])
    p = content.coordinates
    assert p is not None
    for lower in pulled.tolist():
        for upper, dofs in nodes.items():
            same = abs(p[upper, 0] - p[lower, 0]) < 1e-9 and p[upper, 1] > p[lower, 1]
            if same and 1 in dofs and 0 in nodes.get(lower, ()) and 0 in dofs:
                gauge = np.array([lower, upper])
                mesh, supports = supported(content, nodes, gauge=gauge, pulled=pulled)
                pulls = [table.at(time) for time in schedule.times]
                return UniaxialModel(mesh, warp, thickness, pulls, supports, "pulled")
    raise DeckError("stand-in: no pulled node with a held one above it")
