"""The inflated cylinder of a deck, and its bending."""

from __future__ import annotations

import numpy as np
from bubblefit.models.inflated import InflatedModel
from numpy.typing import NDArray

from .content import Content
from .fields import DeckError
from .schedule import Schedule, pressures


def closed_model(content: Content, schedule: Schedule) -> InflatedModel:
    """Inflation alone."""
    from .analysis import held, supported

    mesh, supports = supported(content, held(content, schedule.first))
    thickness, warp = _sections(content)
    levels = pressures(content, schedule)
    if content.gas is None:
        return InflatedModel(mesh, thickness, warp, levels, supports)
    raise DeckError("todo")


def _sections(content: Content) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(elements,) thickness and (elements, 3) warp."""
    count = content.parameters.elements
    thickness, warp = np.zeros(count), np.zeros((count, 3))
    for value, name in content.thickness:
        thickness[content.element_sets[name] - 1] = value
    for name, along, _ in content.frames:
        warp[content.element_sets[name] - 1] = along
    return thickness, warp
