"""Search for an equilibrium by an artificial viscous motion, where Newton's iteration fails."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .closed import ClosedMembrane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViscousRelaxation:
    """Settings of the viscous steps that are taken where Newton's method fails.

    Viscosities are multiples of pressure / size, the size being that of a typical quad in mm.
    """

    initial: float = 20.0  #: the first step hardly moves
    decrease: float = 0.3  #: factor after a converged step
    increase: float = 4.0  #: factor after a failed step
    #: From there it falls to this multiple of the viscosity that failed, less with every step.
    above_failed: float = 2.0
    failed_decrease: float = 0.8
    max_steps: int = 60  #: largest number of steps, converged and failed ones
    smallest: float = 1e-3  #: smallest viscosity
    largest: float = 1e5  #: largest viscosity: the search fails beyond it
    #: A static equilibrium is tried at or below this viscosity, after a step in which no node
    #: moved by more than this share of a quad's size; after a failure, by so much less.
    static_below: float = 10.0
    static_motion: float = 0.05
    static_decrease: float = 0.3


SETTINGS = ViscousRelaxation()


def settled(
    membrane: ClosedMembrane, start: Array, settings: ViscousRelaxation = SETTINGS
) -> Array | None:
    """Return the equilibrium (n, 3) mm to which the membrane moves from `start` under its loads.

    Backward Euler steps of a viscous motion solve residual(u) + viscosity A (u - u_before) = 0,
    where A is the area that belongs to each node; the viscosity is reduced to zero as the motion
    dies down. The law takes the whole motion as one increment. None if no equilibrium is found.
    """
    facet = float(np.sqrt(np.median(membrane.elements.area.sum(axis=1))))
    unit = membrane.pressure / facet
    viscosity = settings.initial * unit
    u = start
    lowest = settings.smallest * unit
    static_motion = settings.static_motion * facet
    try:
        for _ in range(settings.max_steps):
            membrane.drag(viscosity, u)
            viscous = membrane.equilibrium(u, membrane.pressure)
            if viscous is None:
                lowest = settings.above_failed * viscosity
                viscosity *= settings.increase
                if viscosity > settings.largest * unit:
                    return None
                continue
            motion = float(np.abs(viscous - u).max())
            u = viscous
            is_fast = motion > static_motion
            is_viscous = viscosity > settings.static_below * unit
            viscosity = max(settings.decrease * viscosity, lowest)
            lowest = max(settings.failed_decrease * lowest, settings.smallest * unit)
            if is_viscous or is_fast:
                continue
            membrane.drag(0.0, u)
            equilibrium = membrane.equilibrium(u, membrane.pressure)
            if equilibrium is not None:
                return equilibrium
            static_motion = settings.static_decrease * motion
        return None
    finally:
        membrane.drag(0.0, start)
