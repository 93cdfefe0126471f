"""Equilibria of a bubble by the rise of its apex, which go on where the pressure has its maximum.

A soft sheet, or one that thins, has a largest pressure (a limit point), beyond which it rises while
the pressure falls. Here the rise of a node is prescribed, and the pressure is an unknown.
"""

from dataclasses import dataclass

import numpy as np

from .factorisation import SingularTangent
from .membrane import Array, Membrane

MAX_ITERATIONS = 30
#: Relative change of the pressure for the derivative of a force that is linear in it.
PRESSURE_STEP = 1e-2


@dataclass(frozen=True, eq=False)
class Inflated:
    """Hold an equilibrium of a bubble.

    Attributes
    ----------
    displacement : (n, 3) ndarray, mm
    pressure : float, MPa
    """

    displacement: Array
    pressure: float

    @property
    def height(self) -> float:
        """Return the largest rise, mm."""
        return float(self.displacement[:, 2].max())


def at_height(membrane: Membrane, start: Inflated, height: float) -> Inflated | None:
    """Return the equilibrium at which the highest node has risen to a height, or None.

    Parameters
    ----------
    membrane : Membrane
        With strain and stress at the start of the increment.
    start : Inflated
        Equilibrium near to it, whose highest node is the one that is prescribed.
    height : float, mm
    """
    node = int(np.argmax(start.displacement[:, 2]))
    place = int(np.searchsorted(membrane.free, 3 * node + 2))
    u = start.displacement * (height / start.height)
    pressure = start.pressure
    for _ in range(MAX_ITERATIONS):
        membrane.unbalance(u, (1.0 + PRESSURE_STEP) * pressure, with_tangent=False)
        residual_beyond = membrane.residual[membrane.free].copy()
        norm = membrane.unbalance(u, pressure, with_tangent=True)
        if not np.isfinite(norm):
            return None
        missing_height = height - u[node, 2]
        if norm < membrane.tolerance and abs(missing_height) < membrane.tolerance * height:
            return Inflated(u, pressure)
        residual = membrane.residual[membrane.free]
        by_pressure = (residual_beyond - residual) / (PRESSURE_STEP * pressure)
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        steps = -membrane.tangent.solve(np.column_stack([residual, by_pressure]))
        pressure_step = (missing_height - steps[place, 0]) / steps[place, 1]
        step = steps[:, 0] + pressure_step * steps[:, 1]
        scale = min(1.0, membrane.step_limit / float(np.abs(step).max()))
        u.reshape(-1)[membrane.free] += scale * step
        pressure += scale * pressure_step
    return None


def limit_point(
    membrane: Membrane,
    start: Inflated,
    *,
    growth: float = 1.03,
    max_growth: float = 3.0,
) -> Inflated | None:
    """Return the first equilibrium above `start` with a maximum of the pressure, or None.

    The strain of the last accepted increment is that at its start. The maximum is that of the
    equilibria found, which are the closer the smaller the growth of a step.

    Parameters
    ----------
    membrane : Membrane
    start : Inflated
    growth, max_growth : float
        Growth of the height in one step, and in all.
    """
    highest = start
    while highest.height < max_growth * start.height:
        following = at_height(membrane, highest, growth * highest.height)
        if following is None:
            return None
        if following.pressure < highest.pressure:
            return highest
        highest = following
    return None
