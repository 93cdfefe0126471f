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

    def gauge_pressure(self, volume: float, filled_to: float, filled_volume: float) -> float:
        """Gauge pressure in `volume` of gas that was closed in at `filled_to`, MPa; p V constant.

        Parameters
        ----------
        volume, filled_volume : mm^3, now and when the gas was closed in.
        """
        return (filled_to + self.ambient) * filled_volume / volume - self.ambient

    def pressure_slope(self, volume: float, filled_to: float, filled_volume: float) -> float:
        """Derivative of `gauge_pressure` with respect to `volume`, MPa/mm^3."""
        return -(filled_to + self.ambient) * filled_volume / volume**2
