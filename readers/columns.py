"""What the columns of a test machine's export are called, and the units they name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import permutations

#: Words that make a column one of these quantities, in English and German exports.
WORDS = {
    "elongation": frozenset(
        "elongation extension displacement disp crosshead stroke travel position"
        " weg standardweg traversenweg verfahrweg kolbenweg längenänderung".split()
    ),
    "load": frozenset("load force kraft standardkraft prüfkraft".split()),
    "time": frozenset("time zeit prüfzeit".split()),
    "pressure": frozenset("pressure druck überdruck innendruck p".split()),
    "deflection": frozenset("deflection displacement durchbiegung weg".split()),
}
#: Words of what a biaxial test measures along each yarn, and of the yarns: "n_w", "eps fill".
LOADS = frozenset("n f force load kraft stress spannung tension".split())
STRAINS = frozenset("eps epsilon strain dehnung".split())
WARP = frozenset("w warp kette x".split())
FILL = frozenset("f fill weft schuss y".split())
#: Quantities that need a word of each of two sets.
PAIRS = {
    "warp load": (LOADS, WARP),
    "fill load": (LOADS, FILL),
    "warp strain": (STRAINS, WARP),
    "fill strain": (STRAINS, FILL),
}
#: Words of columns of elongation: those measured on the strip, then those of the machine's travel,
#: which holds the slip in the grips and the machine's own give too.
ON_THE_STRIP = frozenset(
    "extensometer gauge gage video längenänderung feindehnung wegaufnehmer".split()
)
OF_THE_MACHINE = frozenset(
    "crosshead stroke position travel traversenweg traverse verfahrweg kolbenweg".split()
)
#: A column with one of these words is none of them: "Tensile strain (Extension)", "Load rate".
OTHERS = frozenset(
    "strain stress rate speed velocity time cell cycle"
    " dehnung spannung zeit geschwindigkeit".split()
)
#: Whole names of the columns that say which specimen and which direction a row belongs to.
LABELS = {
    "specimen": frozenset({"specimen", "specimen id", "specimen label", "sample id"})
    | {"specimen name", "specimen number", "specimen no", "sample name", "probe"},
    "ratio": frozenset({"ratio", "load ratio", "stress ratio", "lastverhältnis", "verhältnis"}),
    "repetition": frozenset({"repetition", "repeat", "run", "trial", "wiederholung"}),
    "direction": frozenset({"direction", "series", "test direction", "orientation", "richtung"}),
}

#: mm in one of each unit of length, N in one of each unit of load.
LENGTH_UNITS = {"mm": 1.0, "cm": 10.0, "m": 1e3}
LOAD_UNITS = {"N": 1.0, "kN": 1e3}
#: N/mm in one of each unit of load per width of the strip.
WIDTH_LOAD_UNITS = {"kN/m": 1.0, "N/mm": 1.0, "N/m": 1e-3, "N/cm": 0.1, "N/50mm": 0.02}
#: One in each unit of strain.
STRAIN_UNITS = {"%": 0.01, "‰": 1e-3, "mm/mm": 1.0, "-": 1.0, "1": 1.0}
#: MPa in one of each unit of pressure.
PRESSURE_UNITS = {
    "Pa": 1e-6, "hPa": 1e-4, "mbar": 1e-4, "kPa": 1e-3, "psi": 6.894757293168e-3, "bar": 0.1,
    "MPa": 1.0,
}  # fmt: skip
#: Seconds in one of each unit of time.
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}

#: Letters of a name, and names of a table: what is longer is none, and would take its time.
LONGEST, MOST_NAMES = 300, 2000

_KNOWN = r"%|‰|mm/mm|kN/m|N/mm|N/cm|N/50mm|N/m|mm|cm|kN|kn|N|n|m|kPa|MPa|hPa|Pa|mbar|bar|psi"
# "Strain (Extension)", "Load (Channel 1)": what is long or has a blank in it is no unit.
_UNIT = r"[A-Za-zµμ°%‰][A-Za-z0-9µμ°%‰/^*·²-]{0,5}"
_IN_BRACKETS = re.compile(rf"^(.*?)[\s_]*[(\[<{{]\s*({_UNIT}|)\s*[)\]>}}]$")
_AT_THE_END = re.compile(rf"^(.*?)(?:\s*[/,]\s*|\s+in\s+|[\s_]+)({_KNOWN})$")


def split_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit, "" when it names none.

    >>> split_unit("Load (kN)"), split_unit("Weg in mm"), split_unit("load_N"), split_unit("Time")
    (('Load', 'kN'), ('Weg', 'mm'), ('load', 'N'), ('Time', ''))
    """
    if len(name) > LONGEST:
        return name, ""
    found = _IN_BRACKETS.match(name) or _AT_THE_END.match(name)
    return (found[1].strip(), found[2].strip()) if found else (name, "")


def means(name: str, quantity: str) -> bool:
    """Return whether a column holds `quantity`, one of those in `WORDS`, `PAIRS` and `LABELS`."""
    if len(name) > LONGEST:
        return False
    plain = split_unit(name)[0].casefold()
    if quantity in LABELS:
        return re.sub(r"[\W_]+", " ", plain).strip() in LABELS[quantity]
    listed = re.split(r"[\W\d_]+", plain)
    words = set(listed)
    if quantity in PAIRS:
        what, along = PAIRS[quantity]
        # One word is not both: F is a force before the yarn, and the fill after another word.
        both = any(a in what and b in along for a, b in permutations(listed, 2))
        return both and not words & (OTHERS - what)
    return bool(words & WORDS[quantity]) and not words & (OTHERS - WORDS[quantity])


def columns_of(names: list[str], quantity: str, named: Mapping[str, str]) -> list[int]:
    """Return the columns that hold a quantity, by the name given for it, else by meaning."""
    if quantity not in named:
        return [i for i, name in enumerate(names) if name and means(name, quantity)]
    asked = named[quantity].strip()
    exact = [i for i, name in enumerate(names) if name == asked]
    plain = [i for i, name in enumerate(names) if split_unit(name)[0] == asked]
    return exact or plain


def nearest_to_strip(names: list[str], which: list[int]) -> list[int]:
    """Return those columns of elongation that were measured nearest to the strip."""

    def rank(index: int) -> int:
        words = set(re.split(r"[\W\d_]+", split_unit(names[index])[0].casefold()))
        return 0 if words & ON_THE_STRIP else 2 if words & OF_THE_MACHINE else 1

    best = min((rank(i) for i in which), default=0)
    return [i for i in which if rank(i) == best]


def scale_of(unit: str, units: dict[str, float]) -> float | None:
    """Return what one `unit` is in mm or N; None for a unit that is not in `units`."""
    plain = {"n": "N", "kn": "kN", "KN": "kN"}.get(unit, unit)
    return units.get(plain)
