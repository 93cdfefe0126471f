"""Causes that may explain the misfit of a bubble: derivatives of the model's fields by them.

Let u(x, p) be the model's displacement at the position x (mm, about the centre) and pressure p.
Positions that are off by d change it to u(x + d, p). A disk larger by the factor R has the field
R u(x / R, R p). Axes that are turned turn positions and displacements, a plane that is tilted turns
displacements alone.
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
#: A drift has the same shape, as moduli take up a factor of all pressures.
PRESSURES = (
    "pressures off by {:+.2g} kPa (nuisance.pressure_offset), or more and more from frame to frame "
    "(dropped frames, a slow clock: give the frames' times)"
)
SINGLE_PRESSURE = "a pressure off by {{:+.2g}} kPa at {pressure:.4g} kPa alone (a wrong frame)"


def slopes_by_cause(targets: Sequence[FieldTarget], displacement: Array) -> dict[str, list[Array]]:
    """Return what one unit of each cause adds to the model's field at the places of each target.

    Parameters
    ----------
    targets : sequence of FieldTarget
        Measured fields with known positions, by rising pressure.
    displacement : (frames, nodes, 3) array, mm
        The model's displacements.

    Returns
    -------
    dict
        By cause (its words, in which the amounts are to be filled in): for each target an
        (n, 3, k) array of changes, mm, per unit of each of the k amounts of the cause. Units are
        those of the words. Empty unless there are at least two pressures and they rise.
    """
    pressures = [0.0, *(target.pressure for target in targets)]
    if len(pressures) < 3 or not (np.diff(pressures) > 0).all():
        return {}
    by_log_pressure = _by_log_pressure(targets, displacement)
    slopes: dict[str, list[Array]] = {}
    for k, target in enumerate(targets):
        by_pressure = target.modelled_displacement(by_log_pressure, k) / target.pressure
        of_target = _slopes_of_target(target, target.modelled_field(displacement, k), by_pressure)
        for cause, columns in of_target.items():
            slopes.setdefault(cause, []).append(np.stack(columns, axis=-1))
    if len(targets) > 2:
        for k, target in enumerate(targets):
            cause = SINGLE_PRESSURE.format(pressure=1e3 * target.pressure)
            slopes[cause] = [(n == k) * part for n, part in enumerate(slopes[PRESSURES])]
    return slopes


def _by_log_pressure(targets: Sequence[FieldTarget], displacement: Array) -> Array:
    """Return derivatives (frames, nodes, 3), mm, of the model's displacements by ln(p).

    They are finite differences between frames, and ln(p) suits them: a flat sheet rises with a
    power of p.

    Parameters
    ----------
    displacement : (frames, nodes, 3) array, mm
        The model's displacements.
    """
    frames = [k if target.frame is None else target.frame for k, target in enumerate(targets)]
    log_pressures = np.log([target.pressure for target in targets])
    slopes = np.zeros_like(displacement)
    order: Literal[1, 2] = 2 if len(log_pressures) > 2 else 1
    slopes[frames] = np.gradient(displacement[frames], log_pressures, axis=0, edge_order=order)
    return slopes


def _slopes_of_target(target: FieldTarget, u: Array, by_pressure: Array) -> dict[str, list[Array]]:
    """Return the columns (n, 3), one for each amount, of every cause at one target.

    Parameters
    ----------
    u : (n, 3) array, mm
        The model's field at the places.
    by_pressure : (n, 3) array, mm/MPa
        Its derivative by the pressure.
    """
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
