"""Traps that the data of a bubble test can have fallen into; one module a group of them.

Each check is told what was measured (`view.View`) and gives doubts, none where all is well. A check
of its own is one function in `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...doubts import Doubt, Expected
from .motion import (
    deformed_coordinates,
    mirrored,
    order,
    rejected_at_zero,
    repeated,
    upside_down,
)
from .place import camera_height, off_centre, swapped, tilted, turned
from .size import length_unit, pressure_unit
from .view import View

#: Later checks reckon with what earlier ones make sure of: a sure doubt ends the list.
CHECKS = (
    length_unit,
    rejected_at_zero,
    repeated,
    upside_down,
    order,
    deformed_coordinates,
    mirrored,
    pressure_unit,
    camera_height,
    off_centre,
    tilted,
    turned,
    swapped,
)


def doubts_of(view: View, expected: Expected) -> Sequence[Doubt]:
    """What is doubtful, in the order of the checks."""
    found: list[Doubt] = []
    for check in CHECKS:
        found += check(view, expected)
        if any(doubt.sure for doubt in found):
            break
    return found


__all__ = ["CHECKS", "View", "doubts_of"]
