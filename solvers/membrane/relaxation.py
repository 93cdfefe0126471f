"""Viscous motion to an equilibrium, where Newton's iteration fails."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .closed import ClosedMembrane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViscousRelaxation:
    """Settings of the viscous steps that are taken where Newton's method fails.

    Viscosities are relative to the pressure over the size of a facet.
    """

    initial: float = 20.0  #: the first step hardly moves
    decrease: float = 0.3  #: factor after a converged step
    increase: float = 8.0  #: factor after a failed step
    max_steps: int = 60  #: of both kinds
    smallest: float = 1e-3
    largest: float = 1e5  #: beyond: failure
    static_below: float = 10.0  #: at or below, equilibrium is tried
    static_motion: float = 0.05  #: ... if no node moved by more, as a share of a facet's size


SETTINGS = ViscousRelaxation()


def settled(
    membrane: ClosedMembrane, start: Array, settings: ViscousRelaxation = SETTINGS
) -> Array | None:
    """Return the equilibrium (n, 3) to which the membrane alone moves from `start`, or None.

    Backward Euler steps of a viscous motion, residual(u) + viscosity area (u - u_before) = 0; the
    viscosity vanishes as the motion dies down. The law sees the way there as one increment.
    """
    facet = float(np.sqrt(np.median(membrane.elements.area.sum(axis=1))))
    unit = membrane.pressure / facet
    viscosity = settings.initial * unit
    u = start
    try:
        for _ in range(settings.max_steps):
            membrane.drag(viscosity, u)
            viscous = membrane.equilibrium(u, membrane.pressure)
            if viscous is None:
                viscosity *= settings.increase
                if viscosity > settings.largest * unit:
                    return None
                continue
            motion = float(np.abs(viscous - u).max())
            u = viscous
            is_fast = motion > settings.static_motion * facet
            is_viscous = viscosity > settings.static_below * unit
            viscosity = max(settings.decrease * viscosity, settings.smallest * unit)
            if is_viscous or is_fast:
                continue
            membrane.drag(0.0, u)
            equilibrium = membrane.equilibrium(u, membrane.pressure)
            if equilibrium is not None:
                return equilibrium
        return None
    finally:
        membrane.drag(0.0, start)
