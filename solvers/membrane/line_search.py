"""Newton's iteration with a line search, for contact and wrinkles: their stiffness jumps.

A full step from a tangent without a node's contact, or with a wrinkle's next to nothing, lands far
inside a body. The residual's largest entry then says little, but its work along the step does: it
changes its sign where the energy along the step is least (Matthies and Strang, Int. J. Numer.
Methods Eng. 14 (1979) 1613). Gas, contact and an increment of the law are nearly conservative.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .factorisation import SingularTangent
from .newton import MOST_IDLE, ROUNDING_BELOW, Membrane

Array = NDArray[np.float64]

#: Steps that have not found the equilibrium by then rarely do: half the way is tried instead.
MOST_STEPS = 16
#: Residuals looked at in one step, and what is left of the work along it when it is good enough.
MOST_TRIALS, LEFT = 10, 0.5
#: A step is good enough, too, where the residual falls to this part or was as small as this.
GAIN, SMALL = 0.1, 1e-2
#: Part of the way to the end known to be too far: at least, where only that is known, at most.
NEAREST, BLIND, FARTHEST = 0.1, 0.3, 0.9


def searched_equilibrium(membrane: Membrane, u: Array, pressure: float) -> Array | None:
    """Displacement (n, 3) in equilibrium at `pressure`, starting from u; None if not found."""
    u = u.copy()
    norm = membrane.unbalance(u, pressure, with_tangent=True)
    least, idle = np.inf, 0
    for _ in range(MOST_STEPS):
        if norm < membrane.tolerance:
            return u
        idle = idle + 1 if 0.5 * least < norm < ROUNDING_BELOW else 0
        if idle >= MOST_IDLE:
            return u
        least = min(least, norm)
        if not np.isfinite(norm):
            return None
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        step = -membrane.tangent.solve(membrane.residual[membrane.free])
        if not np.isfinite(step).all():
            return None
        norm = _along(membrane, u, pressure, step, norm)
    return u if norm < membrane.tolerance else None


def _along(membrane: Membrane, u: Array, pressure: float, step: Array, norm: float) -> float:
    """Move u along the step as far as is good; the residual there, with its tangent."""
    flat, free = u.reshape(-1), membrane.free
    before = flat[free].copy()
    slope = float(step @ membrane.residual[free])
    largest = float(np.abs(step).max())
    part = min(1.0, membrane.step_limit / largest) if largest > 0 else 1.0
    low, slope_low, high, slope_high = 0.0, slope, math.inf, math.nan
    for trial in range(MOST_TRIALS):
        flat[free] = before + part * step
        # Most steps are taken as they are, so that the first comes with its tangent.
        found = membrane.unbalance(u, pressure, with_tangent=trial == 0)
        now = float(step @ membrane.residual[free]) if np.isfinite(found) else math.nan
        if found < GAIN * norm or norm < SMALL or abs(now) <= LEFT * abs(slope):
            break
        if now * slope > 0 and abs(now) <= abs(slope):
            if high == math.inf:
                break
            low, slope_low = part, now
        else:
            high, slope_high = part, now if now * slope < 0 else math.nan
        share = slope_low / (slope_low - slope_high)
        share = BLIND if math.isnan(share) else min(FARTHEST, max(NEAREST, share))
        part = low + share * (high - low)
    if trial > 0:
        found = membrane.unbalance(u, pressure, with_tangent=True)
    return found
