"""Units as files name them, their size in mm, N, MPa or s, and numbers hardly in their unit.

Pressures that no membrane holds, and sizes that no test has, are nearly always in another unit: Pa
for kPa, m for mm. What is wrong by less than that only data can tell.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import lru_cache
from math import log
from typing import Literal

from ..light_dataclasses import dataclass

#: mm in one of each unit of length.
LENGTH_UNITS = {
    "mm": 1.0,
    "cm": 10.0,
    "m": 1e3,
    "µm": 1e-3,
    "μm": 1e-3,
    "um": 1e-3,
    "in": 25.4,
    "ft": 304.8,
    "mil": 0.0254,
}
#: N in one of each unit of load.
LOAD_UNITS = {
    "N": 1.0,
    "kN": 1e3,
    "daN": 10.0,
    "mN": 1e-3,
    "kgf": 9.80665,
    "kp": 9.80665,
    "gf": 9.80665e-3,
    "lbf": 4.4482216152605,
    "kip": 4448.2216152605,
    "ozf": 0.27801385095378,
}
#: Other names of units, in small letters; a weight is that of its mass.
OTHER_NAMES = {
    "n": "N",
    "kn": "kN",
    "lb": "lbf",
    "lbs": "lbf",
    "lbf": "lbf",
    "g": "gf",
    "kg": "kgf",
    "in": "in",
    "inch": "in",
    "inches": "in",
    "zoll": "in",
    '"': "in",
    "″": "in",
    "mils": "mil",
    "thou": "mil",
    "kips": "kip",
    "kipf": "kip",
    "oz": "ozf",
}
#: N/mm in one of each unit of load per width of the strip.
WIDTH_LOAD_UNITS = {
    "kN/m": 1.0,
    "N/mm": 1.0,
    "N/m": 1e-3,
    "N/cm": 0.1,
    "N/50mm": 0.02,
    "N/5cm": 0.02,
    "daN/5cm": 0.2,
    "lbf/in": 4.4482216152605 / 25.4,
}
#: One in each unit of strain.
STRAIN_UNITS = {"%": 0.01, "‰": 1e-3, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "-": 1.0, "1": 1.0}
#: 1/mm in one of each unit of curvature; of the radius, mm.
CURVATURE_UNITS = {"1/mm": 1.0, "1/m": 1e-3, "1/cm": 0.1, "mm": 1.0, "m": 1e3}
#: MPa in one of each unit of pressure.
PRESSURE_UNITS = {
    "Pa": 1e-6,
    "hPa": 1e-4,
    "mbar": 1e-4,
    "kPa": 1e-3,
    "psi": 6.894757293168e-3,
    "bar": 0.1,
    "MPa": 1.0,
}
#: Seconds in one of each unit of time.
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
#: Letters of a column's name at most: what is longer is none, and would take its time.
MAX_NAME_LENGTH = 300
_UNIT_NAMES = (
    r"%|‰|mm/mm|kN/m|N/mm|N/cm|N/50mm|N/5cm|daN/5cm|N/m|mm|cm|kN|kn|N|n|m|kPa|MPa|hPa|Pa|mbar|bar"
    "|psi|lbf/in|lbf|lbs|lb|kgf|kg|kips|kip|gf|g|ozf|daN|inches|inch|in|ft|mils|mil|µm|μm|um"
)
# "Strain (Extension)", "Load (Channel 1)": what is long or has a blank in it is no unit.
_UNIT = r"(?:1/[cm]?m|-|[A-Za-zµμ°%‰\"″][A-Za-z0-9µμ°%‰/^*·²-]{0,6})"
_PER_WIDTH = re.compile(r"N ?/ ?(50?) ?([cm]m)\b")
_IN_BRACKETS = re.compile(rf"^(.*?)[\s_]*[(\[<{{]\s*({_UNIT}|)\s*[)\]>}}]$")
_AT_THE_END = re.compile(rf"^(.*?)(?:\s*[/,]\s*|\s+in\s+|[\s_]+)({_UNIT_NAMES})$")


def plain_unit(text: str) -> str:
    """Return a text with a load per 5 cm of width, "N / 5 cm", in one word."""
    return _PER_WIDTH.sub(r"N/\1\2", text)


def without_brackets(cell: str) -> str:
    """Return a cell of a row of units without the brackets around the unit."""
    return cell.strip("()[]<>{} ")


@lru_cache(4096)
def split_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit, "" when it names none.

    >>> split_unit("Load (kN)"), split_unit("Weg in mm"), split_unit("load_N"), split_unit("Time")
    (('Load', 'kN'), ('Weg', 'mm'), ('load', 'N'), ('Time', ''))
    """
    if len(name) > MAX_NAME_LENGTH:
        return name, ""
    name = plain_unit(name)
    match = _IN_BRACKETS.match(name) or _AT_THE_END.match(name)
    if match is None:
        return name, ""
    return match[1].strip(), match[2].strip()


def scale_of(unit: str, units: Mapping[str, float]) -> float | None:
    """Return what one unit is in the base unit of a table of units.

    Parameters
    ----------
    unit : str
        Unit as a file or a user names it.
    units : mapping
        One of the tables of this module, such as `LENGTH_UNITS`.

    Returns
    -------
    float or None
        None for a unit that is not in the table.
    """
    if unit in units:
        return units[unit]
    return units.get(OTHER_NAMES.get(unit.casefold(), unit))


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
