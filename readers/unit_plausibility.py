"""Doubt a number that can hardly be in its unit, and name the unit that it seems to be in.

Pressures that no membrane holds, and sizes that no test has, are nearly always in another unit: Pa
for kPa, m for mm. What is wrong by less than that only data can tell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import field
from math import log
from typing import Literal

from ..light_dataclasses import dataclass
from .units import LENGTH_UNITS, PRESSURE_UNITS

Quantity = Literal["pressure", "size", "thickness"]


@dataclass(frozen=True)
class PlausibleRange:
    """Limits of a quantity in its base unit (MPa or mm), and the middle of its usual values.

    Attributes
    ----------
    lowest, highest, usual : float
    units : mapping
        Units that a number may really be in, with their size in the base unit.
    remark : str
        Words that a message adds for a number above the highest.
    """

    lowest: float
    highest: float
    usual: float
    units: Mapping[str, float] = field(repr=False)
    remark: str = ""

    def holds(self, value: float) -> bool:
        """Return whether a value in the base unit lies between the limits."""
        return self.lowest <= value <= self.highest


PRESSURES = {name: PRESSURE_UNITS[name] for name in ("Pa", "mbar", "kPa", "bar", "MPa")}
#: By how much a unit is less likely than the others, as a logarithm.
RARE = {"mbar": 2.0}
LENGTHS = {name: LENGTH_UNITS[name] for name in ("um", "mm", "cm", "in", "m")}
RANGES: Mapping[Quantity, PlausibleRange] = {
    "pressure": PlausibleRange(1e-7, 5.0, 0.05, PRESSURES, ", far beyond what a membrane holds"),
    "size": PlausibleRange(0.5, 1e5, 150.0, LENGTHS),
    "thickness": PlausibleRange(5e-3, 50.0, 0.7, LENGTHS),
}


def unit_doubt(
    quantity: Quantity,
    number: float,
    unit: str,
    scale: float,
    series: Sequence[float] = (),
) -> str:
    """Return what is wrong with a number in a unit, with the factor; "" if it is plausible.

    Parameters
    ----------
    quantity : {"pressure", "size", "thickness"}
    number : float
        Above 0, as the user wrote it.
    unit : str
        Its unit by name, such as "kPa".
    scale : float
        MPa, or mm, per unit.
    series : sequence of float
        The numbers of the same unit among which this one stands, if it does: their largest tells
        the unit that is meant, as small ones fit several.
    """
    limits = RANGES[quantity]
    value = number * scale
    if not value > 0 or limits.holds(value):
        return ""
    if value > limits.highest:
        problem = f"expected {unit}, at most {limits.highest / scale:g}, got {number:g}"
        problem += limits.remark
    else:
        problem = f"expected {unit}, at least {limits.lowest / scale:g}, got {number:g}"
    largest = max([number, *series])
    candidates = {
        name: abs(log(largest * size / limits.usual)) + RARE.get(name, 0.0)
        for name, size in limits.units.items()
        if limits.holds(largest * size)
    }
    if not candidates:
        return problem
    likely = min(candidates, key=lambda name: candidates[name])
    factor = scale / limits.units[likely]
    remedy = f"Divide by {factor:g}" if factor > 1 else f"Multiply by {1 / factor:g}"
    return f"{problem}; is this in {likely}? {remedy}"


#: Mistaken units of pressure, by the factor by which pressures are then too high.
MISTAKES = {
    1e3: "kPa given as MPa, or Pa as kPa",
    1e2: "kPa given as bar",
    1e1: "bar given as MPa",
    1e-1: "MPa given as bar",
    1e-2: "bar given as kPa",
    1e-3: "MPa given as kPa",
}


def pressure_remedy(modulus: float, bounds: tuple[float, float]) -> str:
    """Return the factor of all pressures with which a modulus lies within its bounds; or "".

    Parameters
    ----------
    modulus : float
        Modulus, MPa, that is in equilibrium with the pressures as they are.
    bounds : tuple of float
        Lower and upper bound of the modulus in the law, MPa.
    """
    low, high = bounds
    factors = [factor for factor in MISTAKES if low <= modulus / factor <= high]
    if not factors:
        return ""
    middle = (low * high) ** 0.5
    factor = min(factors, key=lambda trial: abs(log(modulus / trial / middle)))
    remedy = f"divided by {factor:g}" if factor > 1 else f"multiplied by {1 / factor:g}"
    corrected = modulus / factor
    return f" With pressures {remedy} ({MISTAKES[factor]}) it would be {corrected:.3g} MPa"
