"""Causes that may explain the misfit of a bubble: slopes of its fields by what may be wrong.

Of the model's field u(x) at pressure p: a place is off by d where u is read at x + d; a larger
disk has R u(x / R, R p); turned axes turn places and u, a tilted plane u alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ...solvers.base import Array
from .smooth_field import SmoothField
from .targets import FieldTarget

RADIUS = "a true radius {:+.1%} away (compare it with the clamp)"
CENTRE = "a centre at {:+.2g}, {:+.2g} mm (registration.centre)"
TILT = "a tilt of {:+.2g}, {:+.2g} degrees (registration.plane)"
WARP = "axes turned by {:+.2g} degrees (registration.warp)"
PRESSURES = "pressures off by {:+.2g} kPa (nuisance.pressure_offset)"


def slopes_by_cause(targets: Sequence[FieldTarget], displacement: Array) -> dict[str, list[Array]]:
    """Return what one unit of each cause adds to the model's field at the places of each target.

    Parameters
    ----------
    targets : sequence of FieldTarget
        With positions.
    displacement : (frames, nodes, 3) array, mm
        Of the model.

    Returns
    -------
    mapping
        (n, 3, k) mm of each target by the cause in words, k amounts of it. Empty unless there are
        two rising pressures at least.
    """
    pressures = [0.0, *(target.pressure for target in targets)]
    if len(pressures) < 3 or not (np.diff(pressures) > 0).all():
        return {}
    by_log_pressure = _by_log_pressure(targets, displacement)
    slopes: dict[str, list[Array]] = {}
    for k, target in enumerate(targets):
        by_pressure = target.of(by_log_pressure, k) / target.pressure
        of_target = _slopes_of_target(target, target.of(displacement, k), by_pressure)
        for cause, columns in of_target.items():
            slopes.setdefault(cause, []).append(np.stack(columns, axis=-1))
    return slopes


def _by_log_pressure(targets: Sequence[FieldTarget], displacement: Array) -> Array:
    """Return slopes (frames, nodes, 3) mm by ln(p): a flat sheet rises with a power of p."""
    frames = [k if target.frame is None else target.frame for k, target in enumerate(targets)]
    log_pressures = np.log([target.pressure for target in targets])
    slopes = np.zeros_like(displacement)
    order: Literal[1, 2] = 2 if len(log_pressures) > 2 else 1
    slopes[frames] = np.gradient(displacement[frames], log_pressures, axis=0, edge_order=order)
    return slopes


def _slopes_of_target(target: FieldTarget, u: Array, by_pressure: Array) -> dict[str, list[Array]]:
    """Return columns (n, 3) by cause, of the model's field u (n, 3) mm and its slope by p."""
    assert target.positions is not None
    x, y = target.positions.T
    dx, dy, dz = u.T
    zero = np.zeros(len(u))
    by_x, by_y = SmoothField.through(target.positions, u).slopes()
    turned_field = np.stack([-dy, dx, zero], axis=1)
    turned_axes = turned_field + y[:, None] * by_x - x[:, None] * by_y
    larger_disk = u - x[:, None] * by_x - y[:, None] * by_y + target.pressure * by_pressure
    about_x = np.stack([zero, -dz, dy], axis=1)
    about_y = np.stack([dz, zero, -dx], axis=1)
    degree = np.pi / 180
    return {
        RADIUS: [larger_disk],
        CENTRE: [-by_x, -by_y],
        TILT: [degree * about_x, degree * about_y],
        WARP: [degree * turned_axes],
        PRESSURES: [-1e-3 * by_pressure],
    }
