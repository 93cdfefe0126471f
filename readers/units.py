"""Tables of units as files name them, with their size in mm, N, MPa or s, and units in headings."""

import re
from collections.abc import Mapping
from functools import lru_cache

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
_UNIT = r"[A-Za-zµμ°%‰\"″][A-Za-z0-9µμ°%‰/^*·²-]{0,6}"
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
