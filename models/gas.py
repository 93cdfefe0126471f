"""The gas in a cavity: ideal, at one temperature (thesis section 6.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ..errors import InputError


@dataclass(frozen=True)
class Gas:
    """Air as the thesis has it; gauge pressures are above `ambient`.

    Parameters
    ----------
    ambient : MPa, the pressure around and the reference of the density.
    temperature : K, constant. density : kg/m^3 at ambient pressure and this temperature.

    Raises
    ------
    InputError : a value that is not a positive number.
    """

    ambient: float = 0.101
    temperature: float = 300.0
    density: float = 1.2041

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0 < value < math.inf:
                raise InputError(None, f"gas.{field.name}", f"expected > 0, got {value!r}")

    def mass(self, gauge: float, volume: float) -> float:
        """Mass in kg of gas at a gauge pressure (MPa) in a volume (mm^3)."""
        return self.density * 1e-9 * volume * (gauge + self.ambient) / self.ambient

    def closed_in(self, gauge: float, volume: float) -> ClosedGas:
        """The gas that fills a volume (mm^3) at a gauge pressure (MPa), and stays in it."""
        return ClosedGas((gauge + self.ambient) * volume, self.ambient)


@dataclass(frozen=True)
class ClosedGas:
    """A constant mass at constant temperature: absolute pressure times volume stays.

    Parameters
    ----------
    amount : MPa mm^3, absolute pressure times volume. ambient : MPa outside.
    """

    amount: float
    ambient: float

    def pressure(self, volume: float) -> float:
        """Gauge pressure (MPa) in `volume` (mm^3)."""
        return self.amount / volume - self.ambient

    def stiffness(self, volume: float) -> float:
        """Loss of pressure per volume, -dp/dV (MPa/mm^3)."""
        return self.amount / volume**2
