"""Inflation past a limit pressure: the volume is led, the pressure follows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...models.gas import ClosedGas
from .closed import ClosedMembrane
from .settling import settled

Array = NDArray[np.float64]

#: A gas at this many times the pressure nearly prescribes the volume that it fills.
OVERPRESSURE = 50.0
#: Share of the volume for one step, the smallest tried, and how far all of them may lead.
STEP, LEAST_STEP, MOST_GROWTH = 0.01, 1e-4, 2.0


def through_snap(membrane: ClosedMembrane, u: Array, before: float, level: float) -> Array | None:
    """Equilibrium at `level` beyond a limit pressure, from that at `before` (MPa); None if not.

    Under pressure alone the membrane would jump. The law needs the strain path in between, so
    that every step of the volume is an increment of it and is accepted.
    """
    outside = OVERPRESSURE * level
    first, _ = membrane.cavity.measure(membrane.reference + u)
    volume, pressure, step, slope = first, before, STEP, np.zeros_like(u)
    try:
        while step >= LEAST_STEP and volume < MOST_GROWTH * first:
            membrane.gas = ClosedGas((outside + pressure) * volume * (1.0 + step), outside)
            found = membrane.equilibrium(u + step * slope, 0.0)
            if found is None and step < 0.5 * STEP:
                # Snapping gathers in one bulge, and the rest of the wall slackens.
                found = membrane.equilibrium_from_slack(u, level)
                if found is None:
                    found = settled(membrane, u + step * slope)
            if found is None:
                step, slope = 0.5 * step, np.zeros_like(u)
                continue
            if membrane.pressure >= level:
                membrane.gas = None
                return membrane.equilibrium(found, level)
            membrane.accept()
            slope, u = (found - u) / step, found
            volume, pressure = membrane.volume, membrane.pressure
            step = min(STEP, 1.5 * step)
        return None
    finally:
        membrane.gas = None
