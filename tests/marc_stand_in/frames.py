"""Nodal vectors of an increment as Marc would put them into the post file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from bubblefit.meshes.mesh import volume_gradient
from numpy.typing import NDArray

from .content import Content
from .recording import State
from .schedule import Schedule

Array = NDArray[np.float64]


def vectors_of(
    content: Content, schedule: Schedule, increment: int, state: State
) -> Mapping[str, Array]:
    """Displacement (mm), external, reaction and contact forces (N) of every node."""
    names = schedule.last if increment == 0 else _names(content, schedule, increment)
    held = _held(content, names)
    found = {
        "Displacement": state.displacement,
        "External Force": _pressure_forces(content, schedule, increment, state),
        "Reaction Force": np.where(held, state.unbalance, 0.0),
    }
    if content.bodies:
        none = np.zeros_like(state.displacement)
        found["Contact Normal Force"] = none if state.contact is None else state.contact
    return found


def _names(content: Content, schedule: Schedule, increment: int) -> list[str]:
    return content.cases[int(schedule.case[increment - 1])].conditions


def _held(content: Content, names: list[str]) -> NDArray[np.bool_]:
    """(nodes, 3) translations that have a value, zero or not."""
    held = np.zeros((content.parameters.nodes, 3), dtype=bool)
    for name in names:
        c = content.conditions[name]
        for dof in c.dofs:
            if dof <= 3:
                held[content.node_sets[c.on] - 1, dof - 1] = True
    return held


def _pressure_forces(content: Content, schedule: Schedule, increment: int, state: State) -> Array:
    """Forces of a pressure that is given; a closed cavity's is in no list of loads."""
    assert content.coordinates is not None and content.connectivity is not None
    for name in _names(content, schedule, increment) if increment else []:
        c = content.conditions[name]
        if c.kind != "fixed" and c.tables != [0]:
            level = content.tables[c.tables[0]].at(float(schedule.times[increment - 1]))
            quads = (content.connectivity - 1).astype(np.intp)
            return level * volume_gradient(content.coordinates + state.displacement, quads)
    return np.zeros_like(state.displacement)
