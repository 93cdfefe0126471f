"""The gas in the cylinder, which CalculiX does not know: its pressure from the volumes found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.gas import ClosedGas

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GasCurve:
    """Gauge pressure (n,) MPa over increasing deflection (n,) mm; constant beyond both ends."""

    deflection: Array
    pressure: Array

    def at(self, deflection: Array) -> Array:
        """Gauge pressure in MPa at deflections in mm."""
        return np.interp(deflection, self.deflection, self.pressure)


def compliance(pressures: Array, volumes: Array) -> float:
    """dV/dp (mm^3/MPa) at the end of inflation, from (n,) MPa and mm^3; n > 1."""
    order: Literal[1, 2] = 2 if len(volumes) > 2 else 1
    return float(np.gradient(volumes, pressures, edge_order=order)[-1])


def gas_pressure(gas: ClosedGas, volumes: Array) -> Array:
    """Gauge pressure (n,) MPa of the gas in volumes (n,) mm^3."""
    return np.array([gas.pressure(float(v)) for v in volumes])


def better_pressure(gas: ClosedGas, volumes: Array, given: Array, slope: float) -> Array:
    """Gauge pressure (n,) MPa for the next pass, from the volumes found at the `given` ones.

    One step of Newton's method on gas(V(p)) = p, the cylinder at any deflection as compliant as
    the inflated one (`slope`, dV/dp in mm^3/MPa). With the gas' own pressure instead the error
    falls to a quarter in each pass only.
    """
    stiffness = np.array([gas.stiffness(float(v)) for v in volumes])
    return np.asarray(given + (gas_pressure(gas, volumes) - given) / (1.0 + stiffness * slope))
