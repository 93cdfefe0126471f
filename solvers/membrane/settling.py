"""Through an instability at fixed loads: the membrane moves as in a viscous bath until it rests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .closed import ClosedMembrane

Array = NDArray[np.float64]

#: Viscosity of the first step over pressure over the size of a facet: so much that it hardly
#: moves. Factor down after a step that was found, up after one that was not; the most of both.
FIRST, DOWN, UP, MOST_STEPS = 20.0, 0.3, 8.0, 60
#: Likewise: the least; above the most, given up; at or below the third, rest is looked for
#: where a step moved no node by more than this share of a facet's size.
LEAST, MOST, LITTLE, NEAR = 1e-3, 1e5, 10.0, 0.05


def settled(membrane: ClosedMembrane, start: Array) -> Array | None:
    """Equilibrium (n, 3) that the membrane moves to from `start`, nothing else moving; or None.

    Backward Euler steps of a viscous motion, residual(u) + viscosity area (u - u_before) = 0, each
    an equilibrium of a membrane that cannot jump. The viscosity is taken away as the motion dies
    down and the answer has none of it: what is returned is in equilibrium without it. The fabric's
    law sees the way there as one increment.
    """
    facet = float(np.sqrt(np.median(membrane.elements.area.sum(axis=1))))
    unit = membrane.pressure / facet
    viscosity, u = FIRST * unit, start
    try:
        for _ in range(MOST_STEPS):
            membrane.drag(viscosity, u)
            found = membrane.equilibrium(u, membrane.pressure)
            if found is None:
                viscosity *= UP
                if viscosity > MOST * unit:
                    return None
                continue
            moved, u = float(np.abs(found - u).max()), found
            restless = viscosity > LITTLE * unit or moved > NEAR * facet
            viscosity = max(DOWN * viscosity, LEAST * unit)
            if restless:
                continue
            membrane.drag(0.0, u)
            rest = membrane.equilibrium(u, membrane.pressure)
            if rest is not None:
                return rest
        return None
    finally:
        membrane.drag(0.0, start)
