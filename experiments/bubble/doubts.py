"""Doubts about the data of a bubble test: traps that measured fields may have fallen into.

Each check, one function in `CHECKS`, looks at the measured fields (`MeasuredView`) and yields
doubts.
"""

from collections.abc import Sequence

from ..doubts import Doubt
from .column_doubts import (
    height_flipped,
    places_exchanged,
    rise_exchanged,
    strain_unlike_rise,
    upside_down,
)
from .coordinate_doubts import (
    axes_turned,
    camera_height,
    clamp_scale,
    clamped_elsewhere,
    length_unit,
    off_centre,
    pressure_unit,
    rise_tilted,
    yarns_swapped,
)
from .frame_doubts import (
    deformed_coordinates,
    first_shape,
    frame_order,
    loaded_reference,
    moving_edge,
    repeated_frame,
    same_states,
    states_at_rest,
)
from .measured_view import MeasuredView
from .point_doubts import outliers, rejected_at_zero, repeated_points

#: Later checks reckon with what earlier ones make sure of: a sure doubt ends the list.
CHECKS = (
    places_exchanged,
    rise_exchanged,
    length_unit,
    rejected_at_zero,
    outliers,
    repeated_points,
    upside_down,
    frame_order,
    repeated_frame,
    states_at_rest,
    same_states,
    deformed_coordinates,
    clamped_elsewhere,
    clamp_scale,
    strain_unlike_rise,
    pressure_unit,
    height_flipped,
    first_shape,
    loaded_reference,
    moving_edge,
    camera_height,
    off_centre,
    rise_tilted,
    axes_turned,
    yarns_swapped,
)


def doubts_of(view: MeasuredView) -> Sequence[Doubt]:
    """Return the doubts about measured fields, in the order of the checks up to a sure one."""
    doubts = [Doubt("frame-numbers", False, text) for text in view.number_doubts]
    doubts += [Doubt("pressure-log", False, text) for text in view.log_doubts]
    for check in CHECKS:
        doubts += check(view)
        if any(doubt.sure for doubt in doubts):
            break
    return doubts
